"""The decoder's one pass over the pixels: every frame read once, every result written once.

Pixels are taken in tiles that stay in the cache. Within a tile each step runs over a row of pixels, which compiles to
vector instructions; `decode_pixels` shows the order. All arithmetic is in single precision.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.kernels.compiled import (
    FIRST,
    HALF,
    INT,
    NONE,
    ONE,
    TILE,
    ZEROTH,
    F,
    brightest,
    fast,
    fill,
    part,
    weighted_sum,
)
from core.decode.kernels.doubt import settle
from core.decode.kernels.fringes import fit_phases, unwrap, weigh
from core.decode.kernels.joint import join
from core.decode.kernels.words import contrast_of, locate, read_bits
from core.decode.options import Flag
from core.decode.tables import CODE, NOTHING, SWEEP, AxisTable, Shorts, Singles

SATURATED, OUTSIDE, NO_U = INT(Flag.SATURATED), INT(Flag.OUTSIDE), INT(Flag.NO_U)
AXIS = INT(1)  # the bit of axis x


class Scratch(NamedTuple):
    """Memory of one thread for a tile of pixels; arrays of several quantities a pixel hold them one after the other.

    `rows` (8, TILE) and `integers` (3, TILE) are for any use; `phases` (4, periods, TILE) are turns, variance, mean and
    amplitude, `parts` the mean, cosine and sine part of one period; `widths`, `edges`, `octets` and `masks` serve
    `read_bits`, `soft` holds the bits of one pixel, `holes` and `missing` the saturated steps of one.
    """

    rows: Singles
    integers: Shorts
    phases: Singles
    parts: Singles
    widths: Singles
    edges: NDArray[np.uint8]
    deep_edges: NDArray[np.uint16]
    octets: NDArray[np.uint8]
    masks: Shorts
    soft: Singles
    holes: Singles
    missing: Shorts


def scratch_for(tables: tuple[AxisTable, AxisTable]) -> Scratch:
    """Make the scratch memory for decoding with these tables."""
    periods, bits = max(len(t.period) for t in tables), max(len(t.sign) for t in tables)
    steps = max(t.hat.shape[1] for t in tables)
    return Scratch(
        rows=np.empty((8, TILE), F),
        integers=np.empty((3, TILE), INT),
        phases=np.empty((4, periods, TILE), F),
        parts=np.empty(3 * TILE, F),
        widths=np.empty(2 * TILE, F),
        edges=np.empty(5 * TILE, np.uint8),
        deep_edges=np.empty(5 * TILE, np.uint16),
        octets=np.empty((bits // 8 + 1, 3 * TILE), np.uint8),
        masks=np.empty(3 * TILE, INT),
        soft=np.empty(bits, F),
        holes=np.empty((steps + 2, steps + 3), F),
        missing=np.empty(steps, INT),
    )


@part
def _finish(table, axis, count, place, sigma, modulation, flags, u, s, least, every):  # type: ignore[no-untyped-def]
    """Write one axis of a tile, NaN where a flag is raised; the smaller modulation. Tells if a pixel is at the rim."""
    missing, last, rim, any_rim = INT(NO_U << axis), table.lines - HALF, table.rim, NONE
    for i in range(count):
        flag = flags[i]
        outside = (flag == NONE) & ((place[i] < -HALF) | (place[i] > last))
        flag = OUTSIDE if outside else flag
        u[i] = place[i] if flag == NONE else F(np.nan)
        s[i] = sigma[i] if flag == NONE else F(np.nan)
        cut = (flag == NONE) & ((place[i] < rim - HALF) | (place[i] > last - rim))
        any_rim = INT(any_rim | (AXIS if cut else NONE))
        least[i] = min(least[i], modulation[i])
        every[i] |= INT(flag | missing) if flag != NONE else NONE
    return any_rim


@fast
def decode_pixels(  # type: ignore[no-untyped-def]
    start, stop, addresses, item_size, limits, image_rows, plain, tables, scratch, out
):
    """Decode pixels start to stop - 1; give 1 if any lies at the rim of the projected field along x, plus 2 if along y.

    `addresses` are those of the first grey value of every frame, each contiguous, of 1 or 2 bytes. Where `image_rows`
    is without entries the brightest of the frames `plain` is the evenly lit image. Written: coordinates and their
    sigmas in lines, float32 (2, pixels); modulation and image in grey values, float32 (pixels,); flags, uint8
    (pixels,).
    """
    place, sigma, modulation, image, flags = out
    saturation = limits.saturation
    rows, integers, masks = scratch.rows, scratch.integers, scratch.masks
    threshold, contrast, u, s = rows[0], rows[1], rows[2], rows[3]
    m, least, one, two = rows[4], rows[5], rows[6], rows[7]
    every, flag, doubtful = integers[0], integers[1], integers[2]
    turns, variance, means, amplitudes = scratch.phases[0], scratch.phases[1], scratch.phases[2], scratch.phases[3]
    word, unsure, near = masks[:TILE], masks[TILE : 2 * TILE], masks[2 * TILE :]
    at_rim = 0
    for first in range(start, stop, TILE):
        count = min(TILE, stop - first)
        # views of what is written: an index that may be negative would not compile to vector instructions
        here, source = slice(first, first + count), (addresses, item_size, first)
        fill(every, 0, count, NONE)
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
            brightest(table.phase_frames, source, count, one)
            for i in range(count):
                flag[i] = SATURATED if one[i] >= saturation else NONE
            fill(m, 0, count, F(0))
            fitted = (turns, variance, means, amplitudes, m, flag, doubtful)
            any_mended = fit_phases(table, source, limits, count, scratch, *fitted)
            known = table.start == CODE and table.has_contrast and table.lift == F(0)
            if table.start != CODE:
                join(table, limits, count, turns, variance, means, amplitudes, one, two, known)
            fill(u, 0, count, HALF * (table.lines - ONE))
            if table.start == CODE:
                weighted_sum(table.rows, ZEROTH, source, count, threshold)
                weighted_sum(table.rows, FIRST, source, count, contrast)
                if any_mended != NONE:
                    _reset_middle(means, m, doubtful, count, threshold, contrast)
                if table.lift != F(0):
                    _lift(table.lift, table.contrast_lift, m, count, threshold, contrast)
                join(table, limits, count, turns, variance, means, amplitudes, threshold, contrast, known)
                contrast_of(table, source, limits, count, threshold, contrast, m, one, two, s, flag)
                read_bits(table, source, limits, count, threshold, contrast, one, scratch, masks)
                locate(table, turns, variance, word, unsure, near, count, u, one, doubtful)
                seen = (threshold, contrast, word, unsure, doubtful)
                settle(table, source, limits, turns, one, seen, count, scratch.soft, u, flag)
            amplitude = m if len(table.period) > 0 else contrast
            if len(table.period) > 0:
                unwrap(table, turns, variance, count, u, one, two, flag)
                weigh(table, limits, turns, variance, count, u, one, two, s, flag)
            else:
                for i in range(count):
                    s[i] = table.cell * one[i] / np.sqrt(F(12))
            at_rim |= _finish(table, axis, count, u, s, amplitude, flag, u_out, s_out, least, every) << axis
        _even_image(image_rows, plain, source, count, image[here])
        m_out, f_out = modulation[here], flags[here]
        for i in range(count):
            m_out[i] = least[i]
            f_out[i] = every[i]
    return at_rim


@part
def _lift(lift, contrast_lift, modulation, count, threshold, contrast):  # type: ignore[no-untyped-def]
    """Bring a threshold that is the mean of bent waves to the middle between off and on."""
    for i in range(count):
        threshold[i] += lift * modulation[i]
        contrast[i] += contrast_lift * modulation[i]


@part
def _reset_middle(means, modulation, mended, count, threshold, contrast):  # type: ignore[no-untyped-def]
    """Where steps are saturated, so is white: the phase's mean is the middle between off and on."""
    for i in range(count):
        if mended[i] != NONE:
            low = threshold[i] - contrast[i]
            threshold[i] = means[0, i]
            contrast[i] = max(threshold[i] - low, modulation[i])


@part
def _even_image(image_rows, plain, source, count, out):  # type: ignore[no-untyped-def]
    """The evenly lit image of a tile, or the brightest of the plain frames where none follows."""
    if len(image_rows.value) > 0:
        weighted_sum(image_rows, ZEROTH, source, count, out)
    else:
        brightest(plain, source, count, out)
