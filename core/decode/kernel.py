"""The decoder's one pass over the pixels: every frame read once, every result written once.

Pixels are taken in tiles that stay in the cache. Within a tile each step runs over a row of pixels, which compiles to
vector instructions; `decode_pixels` shows the order. All arithmetic is in single precision.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.compiled import HALF, INT, NONE, ONE, TILE, F, brightest, fast, fill, weighted_sum
from core.decode.doubt import settle
from core.decode.fringes import fit_phases, unwrap, weigh
from core.decode.options import Flag
from core.decode.tables import CODE, NOTHING, SWEEP, AxisTable, Shorts, Singles
from core.decode.words import contrast_of, locate, read_bits

SATURATED, OUTSIDE, NO_U = INT(Flag.SATURATED), INT(Flag.OUTSIDE), INT(Flag.NO_U)


class Scratch(NamedTuple):
    """Memory for one tile: rows of `TILE` pixels, and `soft` for the bits of one."""

    values: Singles
    turns: Singles
    variance: Singles
    u: Singles
    s: Singles
    m: Singles
    one: Singles
    two: Singles
    least: Singles
    every: Shorts
    flag: Shorts
    doubtful: Shorts
    masks: Shorts
    widths: Singles
    edges: NDArray[np.uint8]
    deep_edges: NDArray[np.uint16]
    octets: NDArray[np.uint8]
    soft: Singles


def scratch_for(tables: tuple[AxisTable, AxisTable]) -> Scratch:
    """Make the scratch memory for decoding with these tables."""
    periods = max(len(table.period) for table in tables)
    bits = max(len(table.sign) for table in tables)
    return Scratch(
        *(np.empty((rows, TILE), F) for rows in (2 + 3 * periods, periods, periods)),
        *(np.empty(TILE, F) for _ in range(6)),
        *(np.empty(TILE, INT) for _ in range(3)),
        masks=np.empty(3 * TILE, INT),
        widths=np.empty(2 * TILE, F),
        edges=np.empty(5 * TILE, np.uint8),
        deep_edges=np.empty(5 * TILE, np.uint16),
        octets=np.empty((max(1, (bits + 7) // 8), 3 * TILE), np.uint8),
        soft=np.empty(bits, F),
    )


@fast
def _finish(table, axis, count, place, sigma, modulation, flags, u, s, least, every):  # type: ignore[no-untyped-def]
    """Write one axis of a tile: coordinate and sigma, NaN where a flag is raised; the smaller modulation."""
    missing, last = INT(NO_U << axis), table.lines - HALF
    for i in range(count):
        flag = flags[i]
        outside = (flag == NONE) & ((place[i] < -HALF) | (place[i] > last))
        flag = OUTSIDE if outside else flag
        u[i] = place[i] if flag == NONE else F(np.nan)
        s[i] = sigma[i] if flag == NONE else F(np.nan)
        least[i] = min(least[i], modulation[i])
        every[i] |= INT(flag | missing) if flag != NONE else NONE


@fast
def decode_pixels(  # type: ignore[no-untyped-def]
    start, stop, addresses, item_size, limits, image_rows, plain, tables, scratch, place, sigma, modulation, image, flags
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
    scratch : Scratch
        Memory of this thread alone.
    place, sigma : float32 (2, pixels)
        Coordinates and their standard deviations in lines, written.
    modulation, image : float32 (pixels,)
        Grey values, written.
    flags : uint8 (pixels,)
        Written.
    """
    saturation = limits.saturation
    values, turns, variance, masks = scratch.values, scratch.turns, scratch.variance, scratch.masks
    u, s, m, one, two, least = scratch.u, scratch.s, scratch.m, scratch.one, scratch.two, scratch.least
    every, flag, doubtful = scratch.every, scratch.flag, scratch.doubtful
    word, unsure, near = masks[:TILE], masks[TILE : 2 * TILE], masks[2 * TILE :]
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
                read_bits(table, source, limits, count, threshold, contrast, one, scratch, masks)
                locate(table, turns, variance, word, unsure, near, count, u, one, doubtful)
                settle(table, source, limits, turns, one, threshold, contrast, word, unsure, doubtful, count, scratch.soft, u, flag)
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
