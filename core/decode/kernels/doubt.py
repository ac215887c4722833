"""The pixels whose bits and phase do not fit at once: which coordinate is the likeliest, and is it clearly so.

They are few, and are decided one by one.
"""

from __future__ import annotations

import numpy as np

from core.decode.kernels.compiled import HALF, INT, NONE, ONE, ZEROTH, F, part, pixel_sum, turn_of
from core.decode.kernels.words import blurred_of, cell_of, coarser, most_left_out, word_of
from core.decode.options import Flag

UNSURE, DISAGREEMENT = INT(Flag.UNSURE), INT(Flag.DISAGREEMENT)

LOOSE = F(0.75)  # part of half the contrast: a bit nearer to its threshold may be wrong
BLUNT = F(0.158)  # part of half the contrast by which the prediction of a bit may err without noise
RAMP = F(1.0)  # lines over which a code's edge is assumed to be blurred, each side
EVIDENCE = F(20)  # twice the logarithm of how much likelier than the second the best must be


@part
def settle(table, source, limits, turns, noise, seen, count, soft, place, flags):  # type: ignore[no-untyped-def]
    """Decide the doubtful pixels of a tile."""
    threshold, contrast, word, unsure, doubtful = seen
    anything = NONE
    for i in range(count):
        doubtful[i] = doubtful[i] if flags[i] == NONE else NONE
        anything |= doubtful[i]
    if anything == NONE:
        return
    gray, cell, lines, steps, fading = table.gray, table.cell, table.lines, table.steps, table.fading
    period = table.step_period[0] if len(steps) > 0 else F(0)
    most = most_left_out(blurred_of(fading))
    dark, shot, floor = limits.dark, limits.shot, limits.floor
    soft = soft[: len(fading)]
    for i in range(count):
        if doubtful[i] != NONE:
            turn, loose, per_contrast = F(0), ZEROTH, ONE / contrast[i]
            for j in range(steps.shape[1]):
                turn += steps[0, j] * turns[j, i]
            for b in range(len(soft)):
                x = pixel_sum(table.rows, 2 + b, source, i) + table.sign[b] * threshold[i]
                x *= per_contrast / fading[b]
                soft[b] = min(max(x, -ONE), ONE)
                loose = (loose << 1) | (1 if abs(x) < LOOSE else 0)
            blunt = max(max(dark + shot * threshold[i], floor) * per_contrast * per_contrast, BLUNT * BLUNT)
            sigma = period * np.sqrt(noise[i])
            place[i], certain = most_likely(gray, cell, lines, period, sigma, blunt, soft, word[i], loose, turn)
            if not certain and gray and period == F(0) and unsure[i] != NONE:
                middle, noise[i] = coarser(word[i], unsure[i], most, most)
                place[i], certain = middle * cell - HALF, noise[i] != F(0)
            if not certain:
                flags[i] |= UNSURE if unsure[i] != NONE else DISAGREEMENT


@part
def most_likely(gray, cell, lines, period, sigma, blunt, soft, word, loose, turn):  # type: ignore[no-untyped-def]
    """The coordinate whose predicted bits fit best, and whether it is clearly the best.

    Candidates are the places about the hard word's cell, and about whatever else the loose bits leave open, at which
    the phase is `turn`, give or take three of its standard deviations; a shift costs as much as bits (of variance
    `blunt`) of the same likelihood. With `period` 0 there is no phase: middles and edges of cells are tried, and a
    middle is the answer: of an edge's two the one that its bits rather show.
    """
    best, second, place, accepted = F(1e9), F(1e9), F(0), F(0)
    apart = HALF * period if period > F(0) else F(1.25) * cell
    stride = period if period > F(0) else HALF * cell
    for n in range(-1, len(soft)):
        if n >= 0 and (loose >> n) & 1 == 0:
            continue
        middle = _start(gray, word, n) * cell - HALF
        nearest = middle + (period * turn_of(turn - (middle + HALF) / period) if period > F(0) else F(0))
        for side in range(-1, 2):
            u = nearest + F(side) * stride
            if abs(u - middle) > cell or u < -ONE or u > lines:
                continue
            limit = best + EVIDENCE * blunt
            cost, changing = misfit(gray, cell, soft, word, loose, u, limit)
            for k in range(-2, 3):
                shift = F(1.5) * F(k)
                price = shift * shift * blunt
                if k != 0 and sigma > F(0.1) * RAMP and cost > price:
                    cost = min(cost, price + misfit(gray, cell, soft, word, loose, u + shift * sigma, limit)[0])
            distinct = abs(u - place) > apart
            if cost < best:
                second = best if distinct else second
                best, place, accepted = cost, u, ONE + F(0.25) * changing
            elif distinct:
                second = min(second, cost)
    if period == F(0):
        y = (place + HALF) / cell
        if abs(y - np.rint(y)) < F(0.25):
            within = F(0.25) * cell
            below = misfit(gray, cell, soft, word, loose, place - within, F(1e9))[0]
            above = misfit(gray, cell, soft, word, loose, place + within, F(1e9))[0]
            odd = INT(np.rint(y)) & 1 != NONE  # of bits exactly halfway: as off, which is every other side
            place += within if above < below or (above == below and not odd) else -within
        place = (np.floor((place + HALF) / cell) + HALF) * cell - HALF
    return place, best <= accepted and second - best >= EVIDENCE * blunt


@part
def _start(gray, word, n):  # type: ignore[no-untyped-def]
    """Where to look, in cells: at the middle of the word's cell (n = -1), or where bit n, the last being 0, leads.

    In Gray code that is the cell whose word differs in this bit. In binary code all lower bits may change at the same
    edge: that between the cells ending in 0111 and 1000.
    """
    if n < 0:
        return F(cell_of(gray, word)) + HALF
    bit = INT(1 << n)
    if gray:
        return F(cell_of(gray, INT(word ^ bit))) + HALF
    return F((word | bit) & -bit)


@part
def misfit(gray, cell, soft, word, loose, u, limit):  # type: ignore[no-untyped-def]
    """Sum of squares of a pixel's bits (off -1, on 1) against those a coordinate predicts, and how many change there.

    Bits that are `loose`, or change at the nearest edge, count as they are; the others only if they are plainly wrong.
    From `limit` on the sum need not be complete.
    """
    last = len(soft) - 1
    per_cell = ONE / cell
    y = (u + HALF) * per_cell
    edge, top = np.rint(y), F((2 << last) - 1)
    low = word_of(gray, INT(min(max(edge - ONE, F(0)), top)))
    high = word_of(gray, INT(min(max(edge, F(0)), top)))
    flips = INT(low ^ high)
    total, changing = F(0), F(0)
    wrong = INT((word ^ high) & ~(flips | loose))
    while wrong != NONE and total < limit:
        wrong &= wrong - 1
        total += F(4)
    if total < limit:
        across = (y - edge) * max(cell / RAMP, F(2))
        across = min(max(across, -ONE), ONE)
        at, rest = last, INT(flips | loose)
        while rest != NONE:
            if rest & 1:
                change = flips & 1
                d = soft[at] - (across if change else ONE) * (ONE if high & 1 else -ONE)
                total += d * d
                changing += F(change)
            at, rest, flips, high = at - 1, INT(rest >> 1), INT(flips >> 1), INT(high >> 1)
    return total, changing
