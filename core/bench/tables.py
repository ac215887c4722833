"""Reading the blurred pattern at a place, and forming pixels from subsamples: the kernels that run for every frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import inner, njit
from core.model import Floats

PER_LINE = 16  # table entries per projector line, interpolated linearly
PAD = 12  # lines tabulated beyond either end of the raster


@inner(forceinline=True)
def look_up(table: Floats, width: int, line: float) -> np.float32:
    """Value of a table of `core.bench.optics` at a projector coordinate, linearly interpolated; 0 beyond its ends."""
    place = (line + PAD) * PER_LINE
    if not 0 <= place < table.shape[1] - 1:
        return np.float32(0.0)
    i = int(place)
    f = np.float32(place - i)
    return table[width, i] + f * (table[width, i + 1] - table[width, i])


@njit(cache=True, nogil=True, error_model="numpy")
def fade_rows(
    first: int, last: int, u: Floats, v: Floats, gain: Floats, width: NDArray[np.uint8],
    window_u: Floats, window_v: Floats,
) -> None:  # fmt: skip
    """Let the light end at the blurred edge of the projector's raster, in subsample rows `first` to `last` - 1."""
    for i in range(first, last):
        for j in range(gain.shape[1]):
            if gain[i, j] > 0:
                w = width[i, j] = min(width[i, j], window_u.shape[0] - 1)
                edge = look_up(window_u, w, u[i, j]) * look_up(window_v, w, v[i, j])
                gain[i, j] = gain[i, j] * edge if edge > 1e-6 else 0.0


@inner(forceinline=True)
def add_lines(tables: Floats, width: int, line: float, out: Floats) -> None:
    """Turn `out`, (P,), on or off by what P patterns show at a projector coordinate: c + r - 2 c r."""
    place = (line + PAD) * PER_LINE
    if not 0 <= place < tables.shape[1] - 1:
        return
    i = int(place)
    f = np.float32(place - i)
    first, second = tables[width, i], tables[width, i + 1]
    for p in range(out.size):
        shown = first[p] + f * (second[p] - first[p])
        out[p] += shown - 2 * out[p] * shown


@njit(cache=True, nogil=True, error_model="numpy")
def expose_pixels(
    first: int, last: int, u: Floats, v: Floats, gain: Floats, width: NDArray[np.uint8],
    columns: Floats, rows: Floats, dark: float, weights: Floats, per_pixel: int, out: Floats,
) -> None:  # fmt: skip
    """Light of pixel rows `first` to `last` - 1 under P patterns at once, out (P, H, W): one way through the rays.

    Light passes where exactly one of column and row is switched: ``T = d + (1 - d) (c + r - 2 c r)``. The tables
    (k, n, P) have the patterns side by side; none (k, 0, P) stand for lines that are all off. A pixel is the weighted
    sum of its subsamples, along the row first; these lie apart by their place in the pixel, so that the sums run on.
    """
    count, pixels, taps = out.shape[0], out.shape[2], weights.size
    margin = (taps - per_pixel) // 2
    lead = (margin + per_pixel - 1) // per_pixel  # pixels before the first and after the last
    lit = np.zeros((per_pixel, pixels + 2 * lead, count), np.float32)
    light = lit.reshape(per_pixel, (pixels + 2 * lead) * count)
    half = np.empty(pixels * count, np.float32)
    turns = (taps + per_pixel - 1) // per_pixel  # pixel rows under way
    sums = np.zeros((turns, half.size), np.float32)
    off, bright, done = np.float32(dark), np.float32(1 - dark), -1
    for q in range(first * per_pixel - margin, (last - 1) * per_pixel - margin + taps):
        i = min(max(q, 0), u.shape[0] - 1)
        if i != done:
            done = i
            for n in range(pixels + 2 * lead):
                for k in range(per_pixel):
                    j = min(max((n - lead) * per_pixel + k, 0), u.shape[1] - 1)
                    ray, g = lit[k, n], gain[i, j]
                    ray[:] = 0
                    if g > 0:
                        add_lines(columns, width[i, j], u[i, j], ray)
                        add_lines(rows, width[i, j], v[i, j], ray)
                        for p in range(count):
                            ray[p] = g * (off + bright * ray[p])
            for start in range(0, half.size, 1024):  # what the processor keeps at hand
                part = half[start : start + 1024]
                part[:] = 0
                for k in range(taps):
                    place = k - margin + lead * per_pixel
                    at = place // per_pixel * count + start
                    taken = light[place % per_pixel, at : at + part.size]
                    w = weights[k]
                    for m in range(part.size):
                        part[m] += w * taken[m]
        newest = (q + margin) // per_pixel
        for r in range(max(first, newest - turns + 1), min(last - 1, newest) + 1):
            k = q + margin - r * per_pixel
            if k >= taps:
                continue
            total = sums[r % turns]
            w = weights[k]
            for m in range(half.size):
                total[m] += w * half[m]
            if k == taps - 1:
                for j in range(pixels):
                    for p in range(count):
                        out[p, r, j] = total[j * count + p]
                total[:] = 0
