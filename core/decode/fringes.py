"""The phases' part of the kernel: angle, variance and modulation of every period, and the way to the finest one.

Everything works on a tile of pixels, one row of an array per period or kind of value.
"""

from __future__ import annotations

import numpy as np

from core.decode.compiled import HALF, INT, NONE, ONE, TILE, TINY, F, angle, fill, part, three_sums, turn_of
from core.decode.options import Flag
from core.decode.tables import CODE

LOW, UNSURE, DISAGREEMENT = INT(Flag.LOW_MODULATION), INT(Flag.UNSURE), INT(Flag.DISAGREEMENT)

TWO_PI = F(2 * np.pi)
SIGMAS = F(4.5)  # a step that rounds is trusted when this many of its standard deviations stay below half a cycle
EVIDENCE = F(20)  # twice the logarithm of how much likelier than the second the best place must be
FITTING = F(25)  # chi squared of the phases at the best place
GATE = F(0.4)  # cycles: phases that differ by more contradict each other
SAME = F(0.02)  # cycles²: less does not tell the two ends of the longest beat apart


@part
def fit_phases(  # type: ignore[no-untyped-def]
    table, source, limits, count, parts, turns, variance, means, amplitudes, modulation, flags
):
    """Phase (turns), its variance (turns²) and modulation of every period; the finest period's modulation is kept.

    Where all periods are to be fitted together, their means and amplitudes are kept too.
    """
    covariance, dark, shot, floor = table.covariance, limits.dark, limits.shot, limits.floor
    dimmest, least = limits.modulation, limits.snr * limits.snr * TWO_PI * TWO_PI
    for j in range(len(covariance)):
        three_sums(table.fits, j, source, count, parts)
        mean, cosine, sine = parts[:TILE], parts[TILE : 2 * TILE], parts[2 * TILE :]
        turn, var = turns[j], variance[j]
        cc, cs, ss = covariance[j, 0], covariance[j, 1], covariance[j, 2]
        for i in range(count):
            c, s = cosine[i], sine[i]
            square = c * c + s * s + TINY
            noise = max(dark + shot * mean[i], floor)
            v = noise * (cc * s * s - F(2) * cs * c * s + ss * c * c + TINY) / (square * square * TWO_PI * TWO_PI)
            turn[i] = angle(c, s)
            var[i] = v
            amplitude = np.sqrt(square)
            if j == 0:
                modulation[i] = amplitude
            weak = (not v * least <= ONE) or amplitude < dimmest
            flags[i] |= LOW if weak else NONE
        if len(table.joint) > 0:
            for i in range(count):
                c, s = cosine[i], sine[i]
                means[j, i], amplitudes[j, i] = mean[i], np.sqrt(c * c + s * s)
        if len(table.bend) > 0:
            _straighten(table.bend, j, count, turn, var)


@part
def _straighten(bend, j, count, turn, var):  # type: ignore[no-untyped-def]
    """Correct the phase (turns) for what the wave shows besides its first harmonic, and its variance."""
    grid = bend.shape[2]
    for i in range(count):
        at = min(max(INT((turn[i] + HALF) * F(grid)), 0), grid - 1)
        turn[i] += bend[j, 0, at]
        var[i] = var[i] * bend[j, 1, at] + bend[j, 2, at]


@part
def combine(factors, errors, turns, variance, count, psi, noise):  # type: ignore[no-untyped-def]
    """Give one combination of the phases (turns) and the variance of what it must round."""
    fill(psi, 0, count, F(0))
    fill(noise, 0, count, F(0))
    for j in range(len(factors)):
        factor, error, turn, var = factors[j], errors[j], turns[j], variance[j]
        if factor != F(0) or error != F(0):
            for i in range(count):
                psi[i] += factor * turn[i]
                noise[i] += error * var[i]


@part
def unwrap(table, turns, variance, count, place, psi, noise, flags):  # type: ignore[no-untyped-def]
    """Sharpen the coordinate by one combination of phases after the other."""
    steps, errors, periods = table.steps, table.step_error, table.step_period
    for s in range(1 if table.start == CODE else 0, len(steps)):
        combine(steps[s], errors[s], turns, variance, count, psi, noise)
        period, most = periods[s], F(0.25) / (SIGMAS * SIGMAS)
        per_period = ONE / period
        for i in range(count):
            d = turn_of(psi[i] - (place[i] + HALF) * per_period)
            place[i] += period * d
            if s > 0:
                flags[i] |= UNSURE if noise[i] > most else NONE
                flags[i] |= DISAGREEMENT if abs(d) > GATE else NONE
        if s == 0 and len(steps) > 1:
            _choose_end(table, turns, noise, count, place, flags)
    if table.start != CODE and len(table.period) > 1:
        for i in range(count):
            if flags[i] != NONE and flags[i] & ~(UNSURE | DISAGREEMENT) == NONE:
                place[i], flags[i] = _search(table, turns, variance, i, place[i], flags[i])


@part
def _search(table, turns, variance, i, place, flag):  # type: ignore[no-untyped-def]
    """The likeliest place of one pixel on the projector, of all that its surest phase allows; and if it clearly is."""
    periods, lines = table.period, table.lines
    surest, least = 0, F(np.inf)
    for j in range(len(periods)):
        spread = periods[j] * periods[j] * variance[j, i]
        surest, least = (j, spread) if spread < least else (surest, least)
    period = periods[surest]
    first = (turns[surest, i] - np.floor(turns[surest, i])) * period - HALF - period
    best, second, found = F(1e9), F(1e9), place
    for k in range(INT(lines / period) + 3):
        u = first + F(k) * period
        square, moment, weights = F(0), F(0), TINY
        for j in range(len(periods)):
            d = periods[j] * turn_of(turns[j, i] - (u + HALF) / periods[j])
            weight = ONE / (periods[j] * periods[j] * variance[j, i] + TINY)
            square += weight * d * d
            moment += weight * d
            weights += weight
        shift = moment / weights
        cost = square - moment * shift
        if u + shift >= -HALF and u + shift <= lines - HALF:
            second = min(second, max(cost, best))
            best, found = (cost, u + shift) if cost < best else (best, found)
    clear = best < FITTING and second - best > EVIDENCE
    return (found, NONE) if clear else (place, flag)


@part
def _follow(steps, step_period, periods, turns, i, place):  # type: ignore[no-untyped-def]
    """Where all steps after the first lead one pixel, and the sum of squares of the disagreements (cycles²)."""
    misfit = F(0)
    for s in range(1, len(steps) + len(periods)):
        psi, period = F(0), ONE
        if s < len(steps):
            period = step_period[s]
            for j in range(len(periods)):
                psi += steps[s, j] * turns[j, i]
        else:
            psi, period = turns[s - len(steps), i], periods[s - len(steps)]
        d = turn_of(psi - (place + HALF) / period)
        misfit += d * d
        place += period * d if s < len(steps) else F(0)
    return place, misfit


@part
def _choose_end(table, turns, noise, count, place, flags):  # type: ignore[no-untyped-def]
    """At the ends of the longest beat, let the shorter ones tell if noise has carried a pixel to the other end."""
    steps, step_period, periods = table.steps, table.step_period, table.period
    beat, middle, half = step_period[0], HALF * (table.lines - ONE), HALF * table.lines + HALF * HALF
    for i in range(count):
        away = HALF * beat - abs(place[i] - middle)
        if away * away < SIGMAS * SIGMAS * beat * beat * noise[i] and flags[i] == 0:
            other = place[i] + (beat if place[i] < middle else -beat)
            here, misfit = _follow(steps, step_period, periods, turns, i, place[i])
            there, other_misfit = _follow(steps, step_period, periods, turns, i, other)
            if abs(here - middle) > half:
                misfit = F(1e9)
            if abs(there - middle) > half:
                other_misfit = F(1e9)
            flags[i] |= UNSURE if abs(misfit - other_misfit) < SAME else NONE
            place[i] = other if other_misfit < misfit else place[i]


@part
def _add_misfit(table, misfit, variance, count, weight, sigma):  # type: ignore[no-untyped-def]
    """Add what the misfit of every period makes of the mean."""
    for i in range(count):
        more = F(0)
        for j in range(len(table.period)):
            part_of = ONE / (table.period[j] * variance[j, i] * weight[i] + TINY)
            more += part_of * part_of * misfit * table.covariance[j, 0]
        sigma[i] = np.sqrt(sigma[i] * sigma[i] + more)


@part
def weigh(table, limits, turns, variance, count, place, shift, weight, sigma, flags):  # type: ignore[no-untyped-def]
    """Mean of the coordinates by all periods, weighted by their variances; misfit counts for sigma alone."""
    periods, misfit = table.period, limits.misfit / (TWO_PI * TWO_PI)
    if len(periods) == 1:
        var, period = variance[0], periods[0]
        more = misfit * table.covariance[0, 0]
        for i in range(count):
            sigma[i] = period * np.sqrt(var[i] + more)
    else:
        fill(shift, 0, count, F(0))
        fill(weight, 0, count, F(0))
        for j in range(len(periods)):
            period, turn, var = periods[j], turns[j], variance[j]
            per_period = ONE / period
            for i in range(count):
                d = turn_of(turn[i] - (place[i] + HALF) * per_period)
                w = ONE / (period * period * var[i] + TINY)
                shift[i] += w * period * d
                weight[i] += w
                flags[i] |= DISAGREEMENT if abs(d) > GATE else NONE
        for i in range(count):
            place[i] += shift[i] / weight[i]
            sigma[i] = np.sqrt(ONE / weight[i])
        if misfit > F(0):
            _add_misfit(table, misfit, variance, count, weight, sigma)
    if table.start != CODE:
        # what lies beyond the projector is a whole number of the longest beat away from where it belongs
        middle, beat = HALF * (table.lines - ONE), table.step_period[0]
        for i in range(count):
            place[i] += beat * np.rint((middle - place[i]) / beat)
            flags[i] |= UNSURE if HALF * beat - abs(place[i] - middle) < F(4) * sigma[i] else NONE
