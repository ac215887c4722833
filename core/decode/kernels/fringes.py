"""The phases' part of the kernel: angle, variance and modulation of every period, and the way to the finest one.

Everything works on a tile of pixels, one row of an array per period or kind of value.
"""

from __future__ import annotations

import numpy as np

from core.decode.kernels.compiled import (
    HALF,
    INT,
    NONE,
    ONE,
    TILE,
    TINY,
    ZEROTH,
    F,
    angle,
    fast,
    fill,
    grey_of,
    part,
    three_sums,
    turn_of,
)
from core.decode.options import Flag
from core.decode.tables import CODE

LOW, UNSURE, DISAGREEMENT = INT(Flag.LOW_MODULATION), INT(Flag.UNSURE), INT(Flag.DISAGREEMENT)
SATURATED = INT(Flag.SATURATED)

TWO_PI = F(2 * np.pi)
SIGMAS = F(4.5)  # a step that rounds is trusted when this many of its standard deviations stay below half a cycle
EVIDENCE = F(20)  # twice the logarithm of how much likelier than the second the best place must be
FITTING = F(25)  # chi squared of the phases at the best place
GATE = F(0.4)  # cycles: phases that differ by more contradict each other
LEFT = F(1e-3)  # part of what a step tells that must follow from the others, so that it can be left out
LEAST_NOISE = F(2 * 2.0**-20)  # turns²: more takes the second of the bends by noise, each of twice the last's
ROUNDS = 4  # in which a wave that is no sine is put in the place of steps left out


@part
def fit_phases(  # type: ignore[no-untyped-def]
    table, source, limits, count, scratch, turns, variance, means, amplitudes, modulation, flags, mended
):
    """Phase (turns), its variance (turns²) and modulation of every period; the finest period's modulation is kept.

    Where all periods are to be fitted together, their means and amplitudes are kept too. Pixels with saturated steps
    that the others make up for lose the flag, and are 1 in `mended`; tells if there are any.
    """
    parts = scratch.parts
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
        if len(table.shade) > 0:
            _by_shade(table.shade[j], limits, count, parts, turn, var)
        if len(table.joint) > 0:
            for i in range(count):
                c, s = cosine[i], sine[i]
                means[j, i], amplitudes[j, i] = mean[i], np.sqrt(c * c + s * s)
    any_mended = NONE
    for i in range(count):
        mended[i] = NONE
        if flags[i] & SATURATED != NONE:
            flags[i] = _leave_out(table, source, limits, i, scratch, turns, variance, means, amplitudes)
            if flags[i] & SATURATED == NONE:  # else too few steps are left to tell it
                mended[i], modulation[i] = INT(1), amplitudes[0, i]
            any_mended |= mended[i]
    for j in range(len(table.bend)):
        _straighten(table.bend[j], count, turns[j], variance[j], scratch.masks)
    return any_mended


@part
def _by_shade(shade, limits, count, parts, turn, var):  # type: ignore[no-untyped-def]
    """Make variances by the mean of all steps those by the brightness of the steps that tell each phase."""
    mean, cosine, sine, grid = parts[:TILE], parts[TILE : 2 * TILE], parts[2 * TILE :], len(shade)
    dark, shot, floor = limits.dark, limits.shot, limits.floor
    for i in range(count):
        at = min(INT((turn[i] + HALF) * F(grid)), grid - 1)
        level = mean[i] + shade[at] * np.sqrt(cosine[i] * cosine[i] + sine[i] * sine[i])
        var[i] *= max(dark + shot * level, floor) / max(dark + shot * mean[i], floor)


@part
def _leave_out(table, source, limits, i, scratch, turns, variance, means, amplitudes):  # type: ignore[no-untyped-def]
    """Fit every period of one pixel by least squares without its saturated steps; gives the pixel's flags.

    A step left out is the one that the others would be fitted with just as well: of the hat matrix ``H`` of all steps,
    ``(1 - H_mm) g_m = H_mk g_k``. A wave that is no sine shows `rest` besides, by the phase fitted before.
    """
    fits, hats, rests, flag = table.fits, table.hat, table.rest, NONE
    holes, missing = scratch.holes, scratch.missing
    seen, plain = holes[len(holes) - 2], holes[len(holes) - 1]
    for j in range(len(table.covariance)):
        first, size, number = fits.first[j], fits.first[j + 1] - fits.first[j], ZEROTH
        hat, value = hats[j], fits.value[:, first : first + size]
        for a in range(size):
            g = grey_of(source, fits.frame[first + a], i)
            lost = g >= limits.saturation and hat[a, a] > F(0)
            if lost:
                missing[number] = a
                number += 1
            seen[a], plain[a] = F(0) if lost else g, F(0) if lost else g
        mean, c, s, turn, amplitude = F(0), F(0), F(0), F(0), F(0)
        cc, cs, ss = table.covariance[j, 0], table.covariance[j, 1], table.covariance[j, 2]
        for k in range(ROUNDS if len(rests) > 0 and number > 0 else 1):
            if k > 0:
                at = min(max(INT((turn + HALF) * F(rests.shape[2])), 0), rests.shape[2] - 1)
                for a in range(size):
                    plain[a] = seen[a] - amplitude * rests[j, a, at]
                for p in range(number):
                    plain[missing[p]] = F(0)
            for p in range(number):
                row, known = missing[p], F(0)
                for q in range(number):
                    holes[p, q] = (ONE if p == q else F(0)) - hat[row, missing[q]]
                for a in range(size):
                    known += hat[row, a] * plain[a]
                holes[p, number], holes[p, number + 1], holes[p, number + 2] = known, value[1, row], value[2, row]
            if not _solve(holes, number):
                return SATURATED
            for p in range(number):
                row = missing[p]
                plain[row] = holes[p, number]
                if k == 0:
                    cc += value[1, row] * holes[p, number + 1]
                    cs += value[1, row] * holes[p, number + 2]
                    ss += value[2, row] * holes[p, number + 2]
            mean, c, s = F(0), F(0), F(0)
            for a in range(size):
                mean, c, s = mean + value[0, a] * plain[a], c + value[1, a] * plain[a], s + value[2, a] * plain[a]
            turn, amplitude = angle(c, s), np.sqrt(c * c + s * s)
        square = c * c + s * s + TINY
        noise = max(limits.dark + limits.shot * mean, limits.floor)
        v = noise * (cc * s * s - F(2) * cs * c * s + ss * c * c + TINY) / (square * square * TWO_PI * TWO_PI)
        turns[j, i], variance[j, i], means[j, i], amplitudes[j, i] = turn, v, mean, amplitude
        weak = (not v * limits.snr * limits.snr * TWO_PI * TWO_PI <= ONE) or amplitude < limits.modulation
        flag |= LOW if weak else NONE
    return flag


@part
def _solve(system, count):  # type: ignore[no-untyped-def]
    """Replace the three right sides of a small positive system, its last columns, by their solutions, if it has any."""
    for p in range(count):
        pivot = system[p, p]
        if not pivot > LEFT:
            return False
        for q in range(p, count + 3):
            system[p, q] /= pivot
        for r in range(count):
            if r != p:
                factor = system[r, p]
                for q in range(p, count + 3):
                    system[r, q] -= factor * system[p, q]
    return True


@part
def _straighten(bend, count, turn, var, levels):  # type: ignore[no-untyped-def]
    """Correct phase (turns) and variance for what the wave shows besides its first harmonic; `levels` is scratch."""
    grid, most = INT(bend.shape[1] - 1), LEAST_NOISE
    fill(levels, 0, count, NONE)
    for _ in range(len(bend) - 1):
        for i in range(count):
            levels[i] += INT(var[i] > most)
        most *= F(4)
    for i in range(count):
        along = turn[i] * F(grid) + HALF * F(grid + 1)  # entries stand for the middles of their parts
        before = INT(along)
        level, at = np.uint32(levels[i]), np.uint32(before)
        turn[i] += bend[level, at, 0] + (along - F(before)) * bend[level, at, 1]
        var[i] = var[i] * bend[level, at, 2] + bend[level, at, 3]


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
            elif len(steps) > 1:  # noise may have carried it to the other end of the longest beat
                away = (HALF * period - abs(place[i] - HALF * (table.lines - ONE))) * per_period
                flags[i] |= UNSURE if away * away < SIGMAS * SIGMAS * noise[i] else NONE
    if table.start != CODE and len(table.period) > 1:
        for i in range(count):
            if flags[i] != NONE and flags[i] & ~(UNSURE | DISAGREEMENT) == NONE:
                found, best, second = search(table, turns, variance, F(0), i, place[i])
                clear = best < FITTING and second - best > EVIDENCE
                place[i], flags[i] = (found, NONE) if clear else (place[i], flags[i])


@part
def fit_at(periods, turns, variance, more, i, place):  # type: ignore[no-untyped-def]
    """How all phases of a pixel fit a place: by how much their mean is off it, its weight, and chi squared about it."""
    square, moment, weights = F(0), F(0), TINY
    for j in range(len(periods)):
        d = periods[j] * turn_of(turns[j, i] - (place + HALF) / periods[j])
        weight = ONE / (periods[j] * periods[j] * (variance[j, i] + more) + TINY)
        square += weight * d * d
        moment += weight * d
        weights += weight
    shift = moment / weights
    return shift, weights, square - moment * shift


@part
def search(table, turns, variance, more, i, place):  # type: ignore[no-untyped-def]
    """The likeliest place of a pixel on the projector, and chi squared there and at the likeliest of all others.

    `more` is added to all variances (turns²).
    """
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
        shift, _, cost = fit_at(periods, turns, variance, more, i, u)
        if u + shift >= -HALF and u + shift <= lines - HALF:
            second = min(second, max(cost, best))
            best, found = (cost, u + shift) if cost < best else (best, found)
    return found, best, second


@fast
def orders_stand(table, turns, variance, more, place, stand):  # type: ignore[no-untyped-def]
    """Whether the orders of pixels' fringes are as clear where all phases are less sure than by noise alone.

    `turns` and `variance` are (periods, n); `more`, (n,), is variance (turns²) besides that by noise, `place` the
    coordinates as decoded; `stand` is written.
    """
    for i in range(len(place)):
        found, best, second = search(table, turns, variance, more[i], i, place[i])
        stand[i] = best < FITTING and second - best > EVIDENCE and abs(found - place[i]) < HALF * table.period[0]


@part
def weigh(table, limits, turns, variance, count, place, shift, weight, sigma, flags):  # type: ignore[no-untyped-def]
    """Mean of the coordinates by all periods, weighted by their variances; of one alone the misfit counts for sigma."""
    periods = table.period
    if len(periods) == 1:
        var, period = variance[0], periods[0]
        more = limits.misfit * table.covariance[0, 0] / (TWO_PI * TWO_PI)
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
    if table.start != CODE:
        # what lies beyond the projector is a whole number of the longest beat away from where it belongs
        middle, beat = HALF * (table.lines - ONE), table.step_period[0]
        unique = min(HALF * beat, beat - HALF * table.lines)  # a beat shorter than the field repeats at both ends
        for i in range(count):
            place[i] += beat * np.rint((middle - place[i]) / beat)
            flags[i] |= UNSURE if unique - abs(place[i] - middle) < F(4) * sigma[i] else NONE
