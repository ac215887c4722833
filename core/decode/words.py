"""The code's part of the kernel: threshold and contrast, the bits of a tile of pixels, and the place they tell."""

from __future__ import annotations

import numpy as np

from core.decode.compiled import (
    HALF,
    INT,
    NONE,
    ONE,
    TILE,
    F,
    fast,
    fill,
    narrow,
    turn_of,
    weighted_sum,
    wide,
)
from core.decode.fringes import SIGMAS, combine
from core.decode.options import Flag

LOW = INT(Flag.LOW_MODULATION)

NOISE_BIT = F(3.5)  # a bit nearer to its threshold, in standard deviations, is unsure
EDGE = F(0.35)  # cells: how far from the edge of a cell code and phase may see it
CLOSE = F(0.2)  # lines: so near to an edge of binary code all bits that change there are unsure
NEAR = F(0.6)  # part of half the contrast: a bit nearer to its threshold is at an edge


@fast
def contrast_of(  # type: ignore[no-untyped-def]
    table, source, limits, count, threshold, contrast, modulation, low, high, bit, flags
):
    """Threshold and half the contrast between on and off, where they must come from the bits themselves.

    At an edge of binary code all bits may be halfway: then the phase's modulation tells the contrast; without phases
    the contrast must be a usual part of the brightness.
    """
    signs, rows, first = table.sign, table.rows, 2 + 3 * len(table.period)
    if not table.has_threshold:
        fill(low, 0, count, F(np.inf))
        fill(high, 0, count, F(-np.inf))
        for b in range(len(signs)):
            weighted_sum(rows, first + b, source, count, bit)
            sign = -signs[b]
            for i in range(count):
                low[i], high[i] = min(low[i], sign * bit[i]), max(high[i], sign * bit[i])
        for i in range(count):
            threshold[i] = HALF * (low[i] + high[i])
    if not table.has_contrast:
        for i in range(count):
            contrast[i] = modulation[i]
        for b in range(len(signs)):
            weighted_sum(rows, first + b, source, count, bit)
            sign = signs[b]
            for i in range(count):
                contrast[i] = max(contrast[i], abs(bit[i] + sign * threshold[i]))
    dark, shot, floor, least = limits.dark, limits.shot, limits.floor, HALF * limits.snr * limits.snr
    share = table.least_contrast
    for i in range(count):
        noise = max(dark + shot * threshold[i], floor)
        weak = contrast[i] <= share * threshold[i] or contrast[i] * contrast[i] < least * noise
        flags[i] |= LOW if weak else NONE


@fast
def read_bits(  # type: ignore[no-untyped-def]
    table, source, limits, count, threshold, contrast, blur, bit, masks
):
    """The hard word, most significant bit first, and masks of the less sure bits: `masks` holds the three as rows.

    Unsure bits, the second row, may be either for the noise; near ones are between their levels, as at an edge.
    """
    for part in range(3):
        fill(masks, part * TILE, part * TILE + count, NONE)
    dark, shot, floor = limits.dark, limits.shot, limits.floor
    for i in range(count):
        blur[i] = NOISE_BIT * np.sqrt(max(dark + shot * threshold[i], floor))
    addresses, item_size, start = source
    rows, last = table.rows, len(table.sign) - 1
    for b in range(last + 1):
        r, mask = 2 + 3 * len(table.period) + b, INT(1 << (last - b))
        spread, fading = np.sqrt(table.spread[b]), table.fading[b]
        how = (table.sign[b], limits.bit_margin * fading, NEAR * fading, spread, mask)
        entry = rows.first[r]
        if rows.first[r + 1] > entry + 1:
            weighted_sum(rows, r, source, count, bit)
            _read_bit(bit, ONE, how, count, threshold, contrast, blur, masks)
        else:
            address, factor = addresses[rows.column[entry]], rows.value[entry]
            if item_size == 1:
                grey = narrow(address, start, count)
                _read_bit(grey, factor, how, count, threshold, contrast, blur, masks)
            else:
                deep = wide(address, start, count)
                _read_bit(deep, factor, how, count, threshold, contrast, blur, masks)


@fast
def _read_bit(bit, factor, how, count, threshold, contrast, blur, masks):  # type: ignore[no-untyped-def]
    sign, margin, wide, spread, mask = how
    for i in range(count):
        x = factor * F(bit[i]) + sign * threshold[i]
        away, noise = abs(x), spread * blur[i]
        # one array, so that one check tells that nothing overlaps: with more the compiler shuns vector instructions
        masks[i] |= mask if x > F(0) else NONE
        masks[TILE + i] |= mask if away < max(margin * contrast[i], noise) else NONE
        masks[2 * TILE + i] |= mask if away < max(wide * contrast[i], noise) else NONE


@fast
def cell_of(gray, word):  # type: ignore[no-untyped-def]
    """Number of the cell that carries a word."""
    if gray:
        word = INT(word ^ (word >> 1))
        word = INT(word ^ (word >> 2))
        word = INT(word ^ (word >> 4))
        word = INT(word ^ (word >> 8))
        word = INT(word ^ (word >> 16))
    return word


@fast
def word_of(gray, cell):  # type: ignore[no-untyped-def]
    """Word that a cell carries."""
    return INT(cell ^ (cell >> 1)) if gray else cell


@fast
def _shared(unsure, near):  # type: ignore[no-untyped-def]
    """The lowest bits of binary code, which share an edge, where just they are near their threshold and all unsure."""
    return near if near == unsure and INT(near & (near + 1)) == NONE else NONE


@fast
def _side_of(word, unsure, near):  # type: ignore[no-untyped-def]
    """The lowest bits of binary code that are near their threshold, if they read as on one side of the edge they share.

    There they are 0111 or 1000. No other bit may be unsure; 0 where that is not so.
    """
    run = INT(near & ~(near + 1))
    odd = INT((word & run) ^ ((run + 1) >> 1))
    mixed = odd != NONE and odd != run
    return NONE if mixed or INT(unsure & ~run) != NONE else run


@fast
def locate(table, turns, variance, word, unsure, near, count, place, noise, doubtful):  # type: ignore[no-untyped-def]
    """Coordinate from the cell and the first combination of phases; not zero in `doubtful` where that is not certain.

    The coordinate is sought about the middle of the cell, or about its edge where the unsure bits put it. Certain is
    one of which every bit is as its cell says, but for those that change at the edge beside it; and whose neighbour one
    period on is clearly elsewhere.
    """
    gray, cell = table.gray, table.cell
    if len(table.steps) == 0:
        for i in range(count):
            place[i] = (F(cell_of(gray, word[i])) + HALF) * cell - HALF
            either = INT(unsure[i] & -unsure[i]) if gray else _side_of(word[i], unsure[i], near[i])
            doubtful[i] = unsure[i] & ~either
        return
    top, two_places = F((1 << len(table.sign)) - 1), INT(1 << 30)
    combine(table.steps[0], table.step_error[0], turns, variance, count, place, noise)
    period = table.step_period[0]
    per_period, per_cell, room = ONE / period, ONE / cell, ONE - HALF * cell / period
    close = CLOSE * per_cell
    for i in range(count):
        seen, open_bits = word[i], unsure[i]
        k = F(cell_of(gray, seen))
        beside = F(cell_of(gray, INT(seen ^ (open_bits if gray else NONE))))
        shared = NONE if gray else _shared(open_bits, near[i])
        start = HALF * (k + beside + ONE) if abs(beside - k) <= ONE else k + HALF
        start = F(INT((seen & ~shared) + ((shared + 1) >> 1))) if shared != NONE else start
        d = turn_of(place[i] - cell * start * per_period)
        y = start + period * d * per_cell
        place[i] = cell * start + period * d - HALF
        edge = np.rint(y)
        low = word_of(gray, INT(min(max(edge - ONE, F(0)), top)))
        high = word_of(gray, INT(min(max(edge, F(0)), top)))
        flips = INT(low ^ high)
        side = flips if gray else _side_of(seen, open_bits, near[i])
        changing = shared if shared != NONE and abs(y - edge) <= close else side
        odd = INT((open_bits & ~changing) | (changing ^ flips))
        wrong = INT(seen ^ (high if y > edge else low))
        doubt = INT(wrong & ~(flips if abs(y - edge) <= EDGE else NONE))
        doubt |= open_bits if odd != NONE else NONE
        gap = max(room - abs(d), F(0))
        elsewhere = two_places if gap * gap < SIGMAS * SIGMAS * noise[i] else NONE
        doubtful[i] = doubt | (NONE if flips != NONE and near[i] == flips else elsewhere)
