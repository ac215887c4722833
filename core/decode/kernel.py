"""The decoder's one pass over the pixels: every frame read once, every result written once.

Pixels are taken in tiles that stay in the cache. Within a tile each step runs over a row of pixels, which compiles to
vector instructions; `decode_pixels` at the end shows the order. What it calls lives in this file as far as it may
change: compiled kernels are cached by the file of the outermost function alone. All arithmetic is in single precision.
"""

from __future__ import annotations

import numpy as np

from core.decode.compiled import angle, brightest, fast, fill, weighted_sum
from core.decode.options import Flag
from core.decode.tables import CODE, NOTHING, SWEEP

LOW, SATURATED, UNSURE = int(Flag.LOW_MODULATION), int(Flag.SATURATED), int(Flag.UNSURE)
DISAGREEMENT, OUTSIDE, NO_U = int(Flag.DISAGREEMENT), int(Flag.OUTSIDE), int(Flag.NO_U)

F = np.float32
HALF, ONE, TWO_PI = F(0.5), F(1), F(2 * np.pi)
TINY = F(1e-20)
SIGMAS = F(4.5)  # a step that rounds is trusted when this many of its standard deviations stay below half a cycle
NOISE_BIT = F(3.5)  # a bit nearer to its threshold, in standard deviations, is unsure
GATE = F(0.4)  # cycles: phases that differ by more contradict each other
SAME = F(0.02)  # cycles²: less does not tell the two ends of the longest beat apart
EDGE = F(0.35)  # cells: how far from the edge of a cell code and phase may see it
LOOSE = F(0.75)  # part of half the contrast: a bit nearer to its threshold may be wrong
BLUNT = F(0.158)  # part of half the contrast by which the prediction of a bit may err without noise
RAMP = F(1.0)  # lines over which a code's edge is assumed to be blurred, each side
EVIDENCE = F(20)  # twice the logarithm of how much likelier than the second the best must be
TILE = 2048  # pixels taken together: long enough to read every frame in runs, short enough for the cache


@fast
def _phases(table, values, limits, count, turns, variance, modulation, flags):  # type: ignore[no-untyped-def]
    """Phase (turns), its variance (turns²) and modulation of every period; the finest period's modulation is kept."""
    covariance, dark, shot, floor = table.covariance, limits.dark, limits.shot, limits.floor
    dimmest, least = limits.modulation, limits.snr * limits.snr * TWO_PI * TWO_PI
    for j in range(len(covariance)):
        mean, cosine, sine = values[2 + 3 * j], values[3 + 3 * j], values[4 + 3 * j]
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
            flags[i] |= LOW if weak else 0


@fast
def _contrast(table, bits, limits, count, threshold, contrast, modulation, low, high, flags):  # type: ignore[no-untyped-def]
    """Threshold and half the contrast between on and off, where they must come from the bits themselves.

    At an edge of binary code all bits may be halfway: then the phase's modulation tells the contrast; without phases
    the contrast must be a usual part of the brightness.
    """
    signs = table.sign
    if not table.has_threshold:
        fill(low, 0, count, F(np.inf))
        fill(high, 0, count, F(-np.inf))
        for b in range(len(signs)):
            row, sign = bits[b], -signs[b]
            for i in range(count):
                low[i], high[i] = min(low[i], sign * row[i]), max(high[i], sign * row[i])
        for i in range(count):
            threshold[i] = HALF * (low[i] + high[i])
    if not table.has_contrast:
        for i in range(count):
            contrast[i] = modulation[i]
        for b in range(len(signs)):
            row, sign = bits[b], signs[b]
            for i in range(count):
                contrast[i] = max(contrast[i], abs(row[i] + sign * threshold[i]))
    dark, shot, floor, least = limits.dark, limits.shot, limits.floor, HALF * limits.snr * limits.snr
    share = table.least_contrast
    for i in range(count):
        noise = max(dark + shot * threshold[i], floor)
        weak = contrast[i] <= share * threshold[i] or contrast[i] * contrast[i] < least * noise
        flags[i] |= LOW if weak else 0


@fast
def _read_bits(table, bits, limits, count, threshold, contrast, word, unsure):  # type: ignore[no-untyped-def]
    """Bits about their threshold (in place), their hard word, most significant first, and a mask of the unsure ones."""
    fill(word, 0, count, 0)
    fill(unsure, 0, count, 0)
    signs, fading, spread = table.sign, table.fading, table.spread
    dark, shot, floor = limits.dark, limits.shot, limits.floor
    last = len(signs) - 1
    for b in range(last + 1):
        row, sign, margin = bits[b], signs[b], limits.bit_margin * fading[b]
        noisy, mask = NOISE_BIT * NOISE_BIT * spread[b], np.int32(1 << (last - b))
        for i in range(count):
            x, near = row[i] + sign * threshold[i], margin * contrast[i]
            row[i] = x
            doubt = x * x < max(near * near, noisy * max(dark + shot * threshold[i], floor))
            word[i] |= mask if x > F(0) else np.int32(0)
            unsure[i] |= mask if doubt else np.int32(0)


@fast
def _cell_of(gray, word):  # type: ignore[no-untyped-def]
    """Number of the cell that carries a word."""
    if gray:
        word ^= word >> 1
        word ^= word >> 2
        word ^= word >> 4
        word ^= word >> 8
        word ^= word >> 16
    return word


@fast
def _word_of(gray, cell):  # type: ignore[no-untyped-def]
    return cell ^ (cell >> 1) if gray else cell


@fast
def _locate(table, turns, variance, word, unsure, count, place, noise, doubtful):  # type: ignore[no-untyped-def]
    """Coordinate from the cell and the first combination of phases; not zero in `doubtful` where that is not certain.

    Certain is a coordinate of which every bit is as its cell says, or, at the edge nearest to it, exactly the bits that
    change there are unsure; and whose neighbour one period on is clearly outside the cell. Where code stands alone, one
    bit of a Gray word may be unsure: at the edge of a cell either side will do.
    """
    gray, cell, steps, errors, phased = table.gray, table.cell, table.steps, table.step_error, len(table.steps) > 0
    period = table.step_period[0] if phased else ONE
    top, two_places = np.int32((1 << len(table.sign)) - 1), np.int32(1 << 30)
    fill(place, 0, count, F(0))
    fill(noise, 0, count, F(0))
    for j in range(steps.shape[1]):
        factor, error, turn, var = steps[0, j], errors[0, j], turns[j], variance[j]
        for i in range(count):
            place[i] += factor * turn[i]
            noise[i] += error * var[i]
    for i in range(count):
        centre = (F(_cell_of(gray, word[i])) + HALF) * cell - HALF
        if phased:
            d = place[i] - (centre + HALF) / period
            d -= np.rint(d)
            place[i] = centre + period * d
            gap = max(ONE - abs(d) - HALF * cell / period, F(0))
            y = (place[i] + HALF) / cell
            edge = np.rint(y)
            low = min(max(np.int32(edge) - np.int32(1), np.int32(0)), top)
            high = min(max(np.int32(edge), np.int32(0)), top)
            word_low, word_high = _word_of(gray, low), _word_of(gray, high)
            flips = word_low ^ word_high
            inside = word_high if y > edge else word_low
            tolerated = flips if abs(y - edge) <= EDGE else np.int32(0)
            doubt = (word[i] ^ inside) & ~tolerated
            doubt |= unsure[i] if unsure[i] != flips else np.int32(0)
            doubtful[i] = doubt | (two_places if gap * gap < SIGMAS * SIGMAS * noise[i] else np.int32(0))
        else:
            place[i] = centre
            doubtful[i] = unsure[i] & (unsure[i] - np.int32(1)) if gray else unsure[i]


@fast
def _misfit(gray, cell, soft, word, loose, u):  # type: ignore[no-untyped-def]
    """Sum of squares of a pixel's bits (off -1, on 1) against those a coordinate predicts, and how many change there.

    Bits that are `loose`, or change at the nearest edge, count as they are; the others only if they are plainly wrong.
    """
    last = len(soft) - 1
    y = (u + HALF) / cell
    edge, top = np.rint(y), (2 << last) - 1
    word_low = _word_of(gray, min(max(int(edge) - 1, 0), top))
    word_high = _word_of(gray, min(max(int(edge), 0), top))
    flips = word_low ^ word_high
    across = (y - edge) * cell / min(RAMP, HALF * cell)
    across = min(max(across, -ONE), ONE)
    total, changing = F(0), F(0)
    for b in range(last + 1):
        mask = 1 << (last - b)
        after = ONE if word_high & mask else -ONE
        if (flips | loose) & mask:
            d = soft[b] - (after * across if flips & mask else after)
            total += d * d
            changing += ONE if flips & mask else F(0)
        elif (word ^ word_high) & mask:
            total += F(4)
    return total, changing


@fast
def _alternative(gray, bit_count, word, unsure, n):  # type: ignore[no-untyped-def]
    """The n-th word that the unsure bits leave open besides the hard one, or -1.

    In Gray code each unsure bit may be wrong by itself. In binary code all bits below an unsure one may change at the
    same edge: the cells on its two sides end in 0111 and 1000.
    """
    bit = n % bit_count
    if not (unsure >> bit) & 1 or (gray and n >= bit_count):
        return -1
    if gray:
        return word ^ (1 << bit)
    prefix = word & ~((2 << bit) - 1)
    return prefix | ((1 << bit) - 1) if n < bit_count else prefix | (1 << bit)


@fast
def _most_likely(gray, cell, lines, period, sigma, blunt, soft, word, loose, turn):  # type: ignore[no-untyped-def]
    """The coordinate whose predicted bits fit best, and whether it is clearly the best.

    Candidates are the places in the cells of all open words at which the phase is `turn`, give or take three of its
    standard deviations; a shift costs as much as bits (of standard deviation `blunt`) of the same likelihood. With
    `period` 0 there is no phase: centres and edges of the cells are tried, and the centre is the answer.
    """
    best, second, place, accepted, answer = F(1e9), F(1e9), F(0), F(0), F(0)
    apart = HALF * period if period > F(0) else F(1.25) * cell
    for n in range(-1, 2 * len(soft)):
        candidate = word if n < 0 else _alternative(gray, len(soft), word, loose, n)
        if candidate < 0:
            continue
        centre = (F(_cell_of(gray, candidate)) + HALF) * cell - HALF
        for side in range(-1, 2):
            u = centre + F(side) * HALF * cell
            if period > F(0):
                d = turn - (centre + HALF) / period
                u = centre + period * (d - np.rint(d) + F(side))
            if abs(u - centre) > cell or u < -ONE or u > lines:
                continue
            cost, changing = _misfit(gray, cell, soft, word, loose, u)
            for k in range(-2, 3):
                if k != 0 and sigma > F(0.1) * RAMP and cost > blunt * blunt:
                    shift = F(1.5) * F(k)
                    other = _misfit(gray, cell, soft, word, loose, u + shift * sigma)[0]
                    cost = min(cost, other + shift * shift * blunt * blunt)
            distinct = abs(u - place) > apart
            if cost < best:
                second = best if distinct else second
                best, place, accepted, answer = cost, u, ONE + F(0.25) * changing, centre
            elif distinct:
                second = min(second, cost)
    certain = best <= accepted and second - best >= EVIDENCE * blunt * blunt
    return (place if period > F(0) else answer), certain


@fast
def _settle(table, limits, bits, turns, noise, threshold, contrast, word, unsure, doubtful, count, place, flags):  # type: ignore[no-untyped-def]
    """Decide the doubtful pixels one by one."""
    anything = 0
    for i in range(count):
        doubtful[i] = doubtful[i] if flags[i] == 0 else np.int32(0)
        anything |= doubtful[i]
    if anything == 0:
        return
    gray, cell, fading, lines, steps = table.gray, table.cell, table.fading, table.lines, table.steps
    period = table.step_period[0] if len(steps) > 0 else F(0)
    dark, shot, floor = limits.dark, limits.shot, limits.floor
    soft = np.empty(len(fading), F)
    for i in range(count):
        if doubtful[i] != 0:
            turn, loose = F(0), 0
            for j in range(steps.shape[1]):
                turn += steps[0, j] * turns[j, i]
            for b in range(len(soft)):
                x = bits[b, i] / (contrast[i] * fading[b])
                soft[b] = min(max(x, -ONE), ONE)
                loose |= (1 if abs(x) < LOOSE else 0) << (len(soft) - 1 - b)
            noisy = max(dark + shot * threshold[i], floor) / (contrast[i] * contrast[i])
            blunt = np.sqrt(max(noisy, BLUNT * BLUNT))
            sigma = period * np.sqrt(noise[i])
            place[i], certain = _most_likely(gray, cell, lines, period, sigma, blunt, soft, word[i], loose, turn)
            if not certain:
                flags[i] |= UNSURE if unsure[i] != 0 else DISAGREEMENT


@fast
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
        d = psi - (place + HALF) / period
        d -= np.rint(d)
        misfit += d * d
        place += period * d if s < len(steps) else F(0)
    return place, misfit


@fast
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
            flags[i] |= UNSURE if abs(misfit - other_misfit) < SAME else 0
            place[i] = other if other_misfit < misfit else place[i]


@fast
def _unwrap(table, turns, variance, count, place, psi, noise, flags):  # type: ignore[no-untyped-def]
    """Sharpen the coordinate by one combination of phases after the other."""
    steps, errors, periods = table.steps, table.step_error, table.step_period
    for s in range(1 if table.start == CODE else 0, len(steps)):
        fill(psi, 0, count, F(0))
        fill(noise, 0, count, F(0))
        for j in range(steps.shape[1]):
            factor, error, turn, var = steps[s, j], errors[s, j], turns[j], variance[j]
            for i in range(count):
                psi[i] += factor * turn[i]
                noise[i] += error * var[i]
        period, most = periods[s], F(0.25) / (SIGMAS * SIGMAS)
        for i in range(count):
            d = psi[i] - (place[i] + HALF) / period
            d -= np.rint(d)
            place[i] += period * d
            if s > 0:
                flags[i] |= UNSURE if noise[i] > most else 0
                flags[i] |= DISAGREEMENT if abs(d) > GATE else 0
        if s == 0 and len(steps) > 1:
            _choose_end(table, turns, noise, count, place, flags)


@fast
def _weigh(table, turns, variance, count, place, shift, weight, sigma, flags):  # type: ignore[no-untyped-def]
    """Mean of the coordinates by all periods, weighted by their variances."""
    periods = table.period
    if len(periods) == 1:
        var, period = variance[0], periods[0]
        for i in range(count):
            sigma[i] = period * np.sqrt(var[i])
    else:
        fill(shift, 0, count, F(0))
        fill(weight, 0, count, F(0))
        for j in range(len(periods)):
            period, turn, var = periods[j], turns[j], variance[j]
            for i in range(count):
                d = turn[i] - (place[i] + HALF) / period
                d -= np.rint(d)
                w = ONE / (period * period * var[i] + TINY)
                shift[i] += w * period * d
                weight[i] += w
                flags[i] |= DISAGREEMENT if abs(d) > GATE else 0
        for i in range(count):
            place[i] += shift[i] / weight[i]
            sigma[i] = np.sqrt(ONE / weight[i])
    if table.start != CODE:
        # what lies beyond the projector is a whole number of the longest beat away from where it belongs
        middle, beat = HALF * (table.lines - ONE), table.step_period[0]
        for i in range(count):
            place[i] += beat * np.rint((middle - place[i]) / beat)
            flags[i] |= UNSURE if HALF * beat - abs(place[i] - middle) < F(4) * sigma[i] else 0


@fast
def _finish(table, axis, first, count, place, sigma, modulation, flags, u, s, m, every):  # type: ignore[no-untyped-def]
    """Write one axis of a tile: coordinate and sigma, NaN where a flag is raised; the smaller modulation."""
    missing, last = np.int32(NO_U << axis), table.lines - HALF
    for i in range(count):
        flag = flags[i]
        outside = (flag == 0) & ((place[i] < -HALF) | (place[i] > last))
        flag = np.int32(OUTSIDE) if outside else flag
        u[first + i] = place[i] if flag == 0 else F(np.nan)
        s[first + i] = sigma[i] if flag == 0 else F(np.nan)
        m[first + i] = min(m[first + i], modulation[i])
        every[i] |= flag | (missing if flag != 0 else np.int32(0))


@fast
def decode_pixels(  # type: ignore[no-untyped-def]
    start, stop, addresses, item_size, limits, image_rows, plain, tables, place, sigma, modulation, image, flags
):
    """Decode pixels start to stop - 1.

    Parameters
    ----------
    start, stop : int
        Range of flat pixel numbers.
    addresses : uint64 (n,)
        Of the first grey value of every frame, each contiguous; `item_size` 1 or 2 bytes.
    limits : Limits
    image_rows : Rows
        The evenly lit image; without entries the brightest of the frames `plain`, int32 (k,), is taken.
    tables : (AxisTable, AxisTable)
        Of axis x and y.
    place, sigma : float32 (2, pixels)
        Coordinates and their standard deviations in lines, written.
    modulation, image : float32 (pixels,)
        Grey values, written.
    flags : uint8 (pixels,)
        Written.
    """
    saturation = limits.saturation
    most = max(len(tables[0].rows.first), len(tables[1].rows.first))
    periods = max(len(tables[0].period), len(tables[1].period))
    values, turns, variance = np.empty((most, TILE), F), np.empty((periods, TILE), F), np.empty((periods, TILE), F)
    u, s, m, one, two = np.empty(TILE, F), np.empty(TILE, F), np.empty(TILE, F), np.empty(TILE, F), np.empty(TILE, F)
    word, unsure, doubtful = np.empty(TILE, np.int32), np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    flag, every = np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    for first in range(start, stop, TILE):
        count = min(TILE, stop - first)
        fill(every, 0, count, 0)
        fill(modulation, first, first + count, F(np.inf))
        for axis in range(2):
            table = tables[axis]
            if table.start == NOTHING:
                fill(place[axis], first, first + count, F(np.nan))
                fill(sigma[axis], first, first + count, F(np.nan))
                for i in range(count):
                    every[i] |= NO_U << axis
            if table.start == NOTHING or table.start == SWEEP:
                continue
            rows = table.rows
            for r in range(len(rows.first) - 1):
                weighted_sum(rows, r, addresses, item_size, first, count, values[r])
            brightest(table.phase_frames, addresses, item_size, first, count, one)
            for i in range(count):
                flag[i] = SATURATED if one[i] >= saturation else 0
            fill(m, 0, count, F(0))
            _phases(table, values, limits, count, turns, variance, m, flag)
            fill(u, 0, count, HALF * (table.lines - ONE))
            if table.start == CODE:
                bits = values[2 + 3 * len(table.period) :]
                _contrast(table, bits, limits, count, values[0], values[1], m, one, two, flag)
                _read_bits(table, bits, limits, count, values[0], values[1], word, unsure)
                _locate(table, turns, variance, word, unsure, count, u, one, doubtful)
                _settle(table, limits, bits, turns, one, values[0], values[1], word, unsure, doubtful, count, u, flag)
            amplitude = m if len(table.period) > 0 else values[1]
            if len(table.period) > 0:
                _unwrap(table, turns, variance, count, u, one, two, flag)
                _weigh(table, turns, variance, count, u, one, two, s, flag)
            else:
                fill(s, 0, count, table.cell / np.sqrt(F(12)))
            _finish(table, axis, first, count, u, s, amplitude, flag, place[axis], sigma[axis], modulation, every)
        if len(image_rows.value) > 0:
            weighted_sum(image_rows, 0, addresses, item_size, first, count, one)
        else:
            brightest(plain, addresses, item_size, first, count, one)
        for i in range(count):
            image[first + i] = one[i]
            flags[first + i] = every[i]
