"""Reading the blurred pattern at a place, and forming pixels from subsamples: the kernels that run for every frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import inner, njit

Floats = NDArray[np.float32]
PER_LINE = 16  # table entries per projector line, interpolated linearly
PAD = 12  # lines tabulated beyond either end of the raster


@inner
def look_up(table: Floats, width: int, line: float) -> np.float32:
    """Value of a table of `core.bench.optics` at a projector coordinate, linearly interpolated; 0 beyond its ends."""
    place = (line + PAD) * PER_LINE
    if not 0 <= place < table.shape[1] - 1:
        return np.float32(0.0)
    i = int(place)
    f = np.float32(place - i)
    return table[width, i] + f * (table[width, i + 1] - table[width, i])


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def expose_rows(
    first: int, last: int, u: Floats, v: Floats, gain: Floats, width: NDArray[np.uint8],
    columns: Floats, rows: Floats, dark: float, weights: Floats, per_pixel: int, out: Floats,
) -> None:  # fmt: skip
    """Light of subsample rows `first` to `last` - 1, gathered into pixels along the row: out (H s, W).

    Light passes where exactly one of column and row is switched: ``T = d + (1 - d) (c + r - 2 c r)``. A table with no
    columns of its own (shape (k, 0)) stands for lines that are all off.
    """
    margin = (weights.size - per_pixel) // 2
    n = u.shape[1]
    light = np.empty(n + 2 * margin, np.float32)
    bright = np.float32(1 - dark)
    for i in range(first, last):
        for j in range(n):
            g = gain[i, j]
            if g > 0:
                c = look_up(columns, width[i, j], u[i, j]) if columns.shape[1] > 0 else np.float32(0)
                r = look_up(rows, width[i, j], v[i, j]) if rows.shape[1] > 0 else np.float32(0)
                g *= np.float32(dark) + bright * (c + r - 2 * c * r)
            light[margin + j] = g
        light[:margin] = light[margin]
        light[margin + n :] = light[margin + n - 1]
        gather_row(light, weights, per_pixel, out[i])


@inner
def gather_row(light: Floats, weights: Floats, per_pixel: int, out: Floats) -> None:
    """Weighted sums of a padded row of subsamples, one per pixel."""
    out[:] = 0
    for k in range(weights.size):
        w = weights[k]
        for j in range(out.size):
            out[j] += w * light[j * per_pixel + k]


@njit(cache=True, nogil=True)
def gather_columns(first: int, last: int, light: Floats, weights: Floats, per_pixel: int, out: Floats) -> None:
    """Weighted sums down the columns for pixel rows `first` to `last` - 1: light (H s, W), out (H, W)."""
    margin = (weights.size - per_pixel) // 2
    for i in range(first, last):
        out[i] = 0
        for k in range(weights.size):
            source = min(max(i * per_pixel + k - margin, 0), light.shape[0] - 1)
            w = weights[k]
            for j in range(out.shape[1]):
                out[i, j] += w * light[source, j]
