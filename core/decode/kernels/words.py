"""The code's part of the kernel: threshold and contrast, the bits of a tile of pixels, and the place they tell."""

from __future__ import annotations

import numpy as np

from core.decode.kernels.compiled import (
    HALF,
    INT,
    NONE,
    ONE,
    TILE,
    ZEROTH,
    F,
    fill,
    grey_at,
    narrow,
    part,
    turn_of,
    weighted_sum,
    wide,
)
from core.decode.kernels.fringes import SIGMAS, combine
from core.decode.options import Flag

LOW = INT(Flag.LOW_MODULATION)

OCTET, WHOLE = np.uint8, np.uint16
NOISE_BIT = F(3.5)  # a bit nearer to its threshold, in standard deviations, is unsure
EDGE = F(0.35)  # cells: how far from the edge of a cell code and phase may see it
CLOSE = F(0.2)  # lines: so near to an edge of binary code all bits that change there are unsure
TWO_PLACES = INT(1 << 30)  # no bit, but a reason for doubt
COARSEST = INT(3)  # lowest bits that code alone may do without, or one more than are blurred everywhere
BLURRED = F(4)  # stands for the contrast of a bit that is not resolved: it is always unsure
NEAR = F(0.6)  # part of half the contrast: a bit nearer to its threshold is at an edge


@part
def contrast_of(  # type: ignore[no-untyped-def]
    table, source, limits, count, threshold, contrast, modulation, low, high, bit, flags
):
    """Threshold and half the contrast between on and off, where they must come from the bits themselves.

    At an edge of binary code all bits may be halfway: then the phase's modulation tells the contrast; without phases
    the contrast must be a usual part of the brightness.
    """
    signs, rows = table.sign, table.rows
    if not table.has_threshold:
        fill(low, 0, count, F(np.inf))
        fill(high, 0, count, F(-np.inf))
        for b in range(len(signs)):
            weighted_sum(rows, 2 + b, source, count, bit)
            sign = -signs[b]
            for i in range(count):
                low[i], high[i] = min(low[i], sign * bit[i]), max(high[i], sign * bit[i])
        for i in range(count):
            threshold[i] = HALF * (low[i] + high[i])
    if not table.has_contrast:
        for i in range(count):
            contrast[i] = modulation[i]
        for b in range(len(signs)):
            weighted_sum(rows, 2 + b, source, count, bit)
            sign = signs[b]
            for i in range(count):
                contrast[i] = max(contrast[i], abs(bit[i] + sign * threshold[i]))
    dark, shot, floor, least = limits.dark, limits.shot, limits.floor, HALF * limits.snr * limits.snr
    share = table.least_contrast
    for i in range(count):
        noise = max(dark + shot * threshold[i], floor)
        weak = contrast[i] <= share * threshold[i] or contrast[i] * contrast[i] < least * noise
        flags[i] |= LOW if weak else NONE


@part
def read_bits(  # type: ignore[no-untyped-def]
    table, source, limits, count, threshold, contrast, bit, scratch, masks
):
    """The hard word, most significant bit first, and masks of the less sure bits: `masks` holds the three as rows.

    Unsure bits, the second row, may be either for the noise; near ones are between their levels, as at an edge.
    """
    widths, octets = scratch.widths, scratch.octets
    edges, deep_edges = scratch.edges, scratch.deep_edges
    rows, last = table.rows, len(table.sign) - 1
    planes = (last >> 3) + 1
    for plane in range(planes):
        fill(octets[plane], 0, 3 * TILE, OCTET(0))
    for b in range(last + 1):
        r, place = 2 + b, last - b
        if b == 0 or table.fading[b] != table.fading[b - 1] or table.spread[b] != table.spread[b - 1]:
            _widths(limits, table.fading[b], np.sqrt(table.spread[b]), threshold, contrast, count, widths)
            if source[1] == 1:
                _edges(threshold, widths, F(255), OCTET, count, edges)
            else:
                _edges(threshold, widths, F(65535), WHOLE, count, deep_edges)
        entry, shown, mask = rows.first[r], octets[place >> 3], OCTET(1 << (place & 7))
        grey = grey_at(source, rows.column[entry], count)
        if rows.first[r + 1] > entry + 1 or rows.value[entry] != ONE:
            weighted_sum(rows, r, source, count, bit)
            _read_sum(bit, table.sign[b], threshold, widths, mask, count, shown)
        elif source[1] == 1:
            _read_grey(narrow(grey, count), edges, mask, count, shown)
        else:
            _read_grey(wide(grey, count), deep_edges, mask, count, shown)
    fill(masks, 0, 3 * TILE, NONE)
    for plane in range(planes):
        _join(octets[plane], INT(1 << 8 * plane), count, masks)


@part
def _widths(limits, fading, spread, threshold, contrast, count, widths):  # type: ignore[no-untyped-def]
    """How near to its threshold, in grey values, a bit is unsure (first row), and at an edge (second row)."""
    dark, shot, floor, margin, blunt = limits.dark, limits.shot, limits.floor, limits.bit_margin * fading, NEAR * fading
    factor = NOISE_BIT * spread
    for i in range(count):
        noise = factor * np.sqrt(max(dark + shot * threshold[i], floor))
        widths[i] = max(margin * contrast[i], noise)
        widths[TILE + i] = max(blunt * contrast[i], noise)


@part
def _edges(threshold, widths, top, whole, count, edges):  # type: ignore[no-untyped-def]
    """The same as whole grey values: the last that is off; the first and last that are unsure, and at an edge."""
    for i in range(count):
        middle, unsure, near = threshold[i], widths[i], widths[TILE + i]
        edges[i] = whole(INT(min(middle, top)))
        edges[TILE + i] = whole(INT(max(np.ceil(middle - unsure), F(0))))
        edges[2 * TILE + i] = whole(INT(min(middle + unsure, top)))
        edges[3 * TILE + i] = whole(INT(max(np.ceil(middle - near), F(0))))
        edges[4 * TILE + i] = whole(INT(min(middle + near, top)))


@part
def _read_grey(grey, edges, mask, count, octets):  # type: ignore[no-untyped-def]
    """Read a bit that one frame shows."""
    for i in range(count):
        g = grey[i]
        octets[i] |= mask if g > edges[i] else OCTET(0)
        octets[TILE + i] |= mask if (g >= edges[TILE + i]) & (g <= edges[2 * TILE + i]) else OCTET(0)
        octets[2 * TILE + i] |= mask if (g >= edges[3 * TILE + i]) & (g <= edges[4 * TILE + i]) else OCTET(0)


@part
def _read_sum(bit, sign, threshold, widths, mask, count, octets):  # type: ignore[no-untyped-def]
    """Read a bit that several frames show."""
    for i in range(count):
        x = bit[i] + sign * threshold[i]
        octets[i] |= mask if x > F(0) else OCTET(0)
        octets[TILE + i] |= mask if abs(x) <= widths[i] else OCTET(0)
        octets[2 * TILE + i] |= mask if abs(x) <= widths[TILE + i] else OCTET(0)


@part
def _join(octets, unit, count, masks):  # type: ignore[no-untyped-def]
    """Add octets to words of 32 bits."""
    for i in range(count):
        masks[i] += unit * INT(octets[i])
        masks[TILE + i] += unit * INT(octets[TILE + i])
        masks[2 * TILE + i] += unit * INT(octets[2 * TILE + i])


@part
def cell_of(gray, word):  # type: ignore[no-untyped-def]
    """Number of the cell that carries a word."""
    if gray:
        word = INT(word ^ (word >> 1))
        word = INT(word ^ (word >> 2))
        word = INT(word ^ (word >> 4))
        word = INT(word ^ (word >> 8))
        word = INT(word ^ (word >> 16))
    return word


@part
def blurred_of(fading):  # type: ignore[no-untyped-def]
    """How many bits are not resolved anywhere."""
    blurred = ZEROTH
    for b in range(len(fading)):
        blurred += 1 if fading[b] == BLURRED else 0
    return blurred


@part
def most_left_out(blurred):  # type: ignore[no-untyped-def]
    """How many of its lowest bits Gray code alone may do without."""
    return max(COARSEST, INT(blurred + 1))


@part
def coarser(word, unsure, more, most):  # type: ignore[no-untyped-def]
    """Place (cells) and width (cells; 0: none) that Gray code tells without its lowest bits.

    Those that are unsure are left out, and `more` if need be, `most` in all, until none of the others is unsure or one
    that changes at the edge of two cells of that width: there the place is the edge.
    """
    least = ZEROTH
    while (unsure >> least) & 1 != NONE:
        least += 1
    for k in range(least, min(least + more, most) + 1):
        rest, kept, width = INT(unsure >> k), INT(word >> k), F(INT(1) << k)
        here = cell_of(True, kept)
        if rest == NONE:
            return (F(here) + HALF) * width, width
        there = cell_of(True, INT(kept ^ rest))
        if INT(rest & (rest - 1)) == NONE and abs(INT(there - here)) == 1:
            return F(max(here, there)) * width, width
    return F(0), F(0)


@part
def word_of(gray, cell):  # type: ignore[no-untyped-def]
    """Word that a cell carries."""
    return INT(cell ^ (cell >> 1)) if gray else cell


@part
def _shared(unsure, near):  # type: ignore[no-untyped-def]
    """The lowest bits of binary code, which share an edge, where just they are near their threshold and all unsure."""
    return near if near == unsure and INT(near & (near + 1)) == NONE else NONE


@part
def _side_of(word, unsure, near):  # type: ignore[no-untyped-def]
    """The lowest bits of binary code near their threshold, if they read 0111 or 1000; no other may be unsure."""
    run = INT(near & ~(near + 1))
    odd = INT((word & run) ^ ((run + 1) >> 1))
    mixed = odd != NONE and odd != run
    return NONE if mixed or INT(unsure & ~run) != NONE else run


@part
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
            noise[i], doubtful[i] = ONE, unsure[i] & ~_side_of(word[i], unsure[i], near[i])
        _locate_edges(table, word, unsure, count, place, noise, doubtful)
        return
    combine(table.steps[0], table.step_error[0], turns, variance, count, place, noise)
    _locate_cells(table, word, unsure, near, count, place, noise, doubtful)


@part
def _locate_edges(table, word, unsure, count, place, cells, doubtful):  # type: ignore[no-untyped-def]
    """A code alone where bits are unsure: the edge where one changes, or a wider cell without the fine ones."""
    gray, cell, blurred = table.gray, table.cell, blurred_of(table.fading)
    most = most_left_out(blurred)
    if not gray and blurred == ZEROTH:
        return
    for i in range(count):
        if unsure[i] != NONE:
            if gray:
                middle, width = coarser(word[i], unsure[i], 0, most)
            else:
                middle, width = _upper(word[i], unsure[i], blurred)
            found = width != F(0)
            place[i] = middle * cell - HALF if found else place[i]
            cells[i] = width if found else ONE
            doubtful[i] = NONE if found else unsure[i]


@part
def _upper(word, unsure, blurred):  # type: ignore[no-untyped-def]
    """Place and width (cells; 0: none) that the upper bits of binary code tell, the lowest `blurred` being lost.

    Where others are unsure as well, down from one to the lost ones, all of them change: there the place is that edge.
    """
    changing, bits = INT(unsure >> blurred), blurred
    if INT(changing & (changing + 1)) != NONE:
        return F(0), F(0)
    while changing != NONE:
        changing, bits = INT(changing >> 1), bits + 1
    return (F(INT(word >> bits)) + HALF) * F(INT(1) << bits), F(INT(1) << blurred)


@part
def _locate_cells(table, word, unsure, near, count, place, noise, doubtful):  # type: ignore[no-untyped-def]
    """Combine the code with the phase in `place` (turns)."""
    gray, cell, period, top = table.gray, table.cell, table.step_period[0], F((1 << len(table.sign)) - 1)
    per_cell, cell_turns, room = ONE / cell, cell / period, ONE - HALF * cell / period
    cells, close = period * per_cell, CLOSE * per_cell
    for i in range(count):
        seen, open_bits = word[i], unsure[i]
        shared = NONE if gray else _shared(open_bits, near[i])
        if gray:
            k = cell_of(True, seen)
            apart = INT(cell_of(True, INT(seen ^ open_bits)) - k)
            start = F(k) + HALF + (HALF * F(apart) if abs(apart) <= 1 else F(0))
        else:
            middle = F(INT((seen & ~shared) + ((shared + 1) >> 1)))
            start = middle if shared != NONE else F(seen) + HALF
        d = turn_of(place[i] - cell_turns * start)
        y = start + cells * d
        place[i] = cell * y - HALF
        edge = np.rint(y)
        away = abs(y - edge)
        low, high = _words_beside(gray, edge, top)
        flips = INT(low ^ high)
        wrong = INT(seen ^ (high if y > edge else low))
        if gray:
            odd = INT(open_bits & ~flips)
        else:
            changing = shared if shared != NONE and away <= close else _side_of(seen, open_bits, near[i])
            odd = INT((open_bits & ~changing) | (changing ^ flips))
        doubtful[i] = _doubt(wrong, odd, open_bits, near[i], flips, away, room - abs(d), noise[i])


@part
def _doubt(wrong, odd, unsure, near, flips, away, room, noise):  # type: ignore[no-untyped-def]
    """The bits that speak against a coordinate, `away` cells from an edge where the bits `flips` change.

    Those not as its cell says; all unsure ones if any is `odd`; and one more where the next place is too near: within
    `room` of turns.
    """
    doubt = INT(wrong & ~(flips if away <= EDGE else NONE))
    doubt = INT(doubt | (unsure if odd != NONE else NONE))
    gap = max(room, F(0))
    elsewhere = TWO_PLACES if gap * gap < SIGMAS * SIGMAS * noise else NONE
    return INT(doubt | (NONE if flips != NONE and near == flips else elsewhere))


@part
def _words_beside(gray, edge, top):  # type: ignore[no-untyped-def]
    """Words of the cells below and above an edge."""
    low = word_of(gray, INT(min(max(edge - ONE, F(0)), top)))
    return low, word_of(gray, INT(min(max(edge, F(0)), top)))
