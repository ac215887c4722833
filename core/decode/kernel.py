"""The decoder's one pass over the pixels: every frame read once, every result written once.

Pixels are taken in tiles that stay in the cache. Within a tile each step runs over a row of pixels, which compiles to
vector instructions; `decode_pixels` shows the order. All arithmetic is in single precision.
"""

from __future__ import annotations

import numpy as np

from core.decode.compiled import HALF, INT, NONE, ONE, TILE, F, brightest, fast, fill, weighted_sum
from core.decode.doubt import settle
from core.decode.fringes import fit_phases, unwrap, weigh
from core.decode.options import Flag
from core.decode.tables import CODE, NOTHING, SWEEP
from core.decode.words import contrast_of, locate, read_bits

SATURATED, OUTSIDE, NO_U = INT(Flag.SATURATED), INT(Flag.OUTSIDE), INT(Flag.NO_U)


@fast
def _finish(table, axis, count, place, sigma, modulation, flags, u, s, least, every):  # type: ignore[no-untyped-def]
    """Write one axis of a tile: coordinate and sigma, NaN where a flag is raised; the smaller modulation."""
    missing, last = INT(NO_U << axis), table.lines - HALF
    for i in range(count):
        flag = flags[i]
        outside = (flag == 0) & ((place[i] < -HALF) | (place[i] > last))
        flag = OUTSIDE if outside else flag
        u[i] = place[i] if flag == 0 else F(np.nan)
        s[i] = sigma[i] if flag == 0 else F(np.nan)
        least[i] = min(least[i], modulation[i])
        every[i] |= flag | (missing if flag != 0 else NONE)


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
    periods = max(len(tables[0].period), len(tables[1].period))
    values, turns, variance = (
        np.empty((2 + 3 * periods, TILE), F),
        np.empty((periods, TILE), F),
        np.empty((periods, TILE), F),
    )
    u, s, m, one, two = np.empty(TILE, F), np.empty(TILE, F), np.empty(TILE, F), np.empty(TILE, F), np.empty(TILE, F)
    least, every, flag = np.empty(TILE, F), np.empty(TILE, INT), np.empty(TILE, INT)
    masks = np.empty(3 * TILE, INT)
    word, unsure, near = masks[:TILE], masks[TILE : 2 * TILE], masks[2 * TILE :]
    doubtful = np.empty(TILE, INT)
    for first in range(start, stop, TILE):
        count = min(TILE, stop - first)
        # views of what is written: an index that may be negative would not compile to vector instructions
        here, source = slice(first, first + count), (addresses, item_size, first)
        fill(every, 0, count, 0)
        fill(least, 0, count, F(np.inf))
        for axis in range(2):
            table, u_out, s_out = tables[axis], place[axis, here], sigma[axis, here]
            if table.start == NOTHING:
                fill(u_out, 0, count, F(np.nan))
                fill(s_out, 0, count, F(np.nan))
                for i in range(count):
                    every[i] |= NO_U << axis
            if table.start == NOTHING or table.start == SWEEP:
                continue
            rows = table.rows
            for r in range(2 + 3 * len(table.period)):
                weighted_sum(rows, r, source, count, values[r])
            brightest(table.phase_frames, source, count, one)
            for i in range(count):
                flag[i] = SATURATED if one[i] >= saturation else NONE
            fill(m, 0, count, F(0))
            fit_phases(table, values, limits, count, turns, variance, m, flag)
            fill(u, 0, count, HALF * (table.lines - ONE))
            if table.start == CODE:
                threshold, contrast = values[0], values[1]
                contrast_of(table, source, limits, count, threshold, contrast, m, one, two, s, flag)
                read_bits(table, source, limits, count, threshold, contrast, one, s, masks)
                locate(table, turns, variance, word, unsure, near, count, u, one, doubtful)
                settle(table, source, limits, turns, one, threshold, contrast, word, unsure, doubtful, count, u, flag)
            amplitude = m if len(table.period) > 0 else values[1]
            if len(table.period) > 0:
                unwrap(table, turns, variance, count, u, one, two, flag)
                weigh(table, turns, variance, count, u, one, two, s, flag)
            else:
                fill(s, 0, count, table.cell / np.sqrt(F(12)))
            _finish(table, axis, count, u, s, amplitude, flag, u_out, s_out, least, every)
        _even_image(image_rows, plain, source, count, image[here])
        m_out, f_out = modulation[here], flags[here]
        for i in range(count):
            m_out[i] = least[i]
            f_out[i] = every[i]


@fast
def _even_image(image_rows, plain, source, count, out):  # type: ignore[no-untyped-def]
    """The evenly lit image of a tile, or the brightest of the plain frames where none follows."""
    if len(image_rows.value) > 0:
        weighted_sum(image_rows, 0, source, count, out)
    else:
        brightest(plain, source, count, out)
