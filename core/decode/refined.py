"""The refinement's kernels: ambient light, gain and both coordinates of a pixel from all of its frames.

A grey value is ``b + s T(u)``, T the light of the frame's pattern after the blur. The coordinate's neighbourhood of a
table's place makes that linear, ``b + s T + (s du) T'``; a frame knows one axis alone, so `du` and `dv` are eliminated
each for itself, and all products of the patterns with themselves stand in the table. A second look starts where the
first one led.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.compiling import njit
from core.decode.kernels.compiled import HALF, INT, ONE, TINY, F, grey_at, narrow, part, single, wide
from core.decode.tables import Shorts, Singles

PER_LINE = 16  # places of a line in the tables
PAD = 8  # lines beyond the projector's, where blurred light still is
TILE = 32  # px, width and height of what has one blur
SPAN = 8 * TILE  # pixels taken together
LOOKS = 3
NEAR = F(0.06)  # lines: within so much of the table's place the pattern is as good as straight
FARTHEST = F(0.6)  # lines that the estimate may lie from where it started

SUMS = 6

Addresses = NDArray[np.uint64]
_HOW: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "nsz", "arcp", "reassoc"}, "_nrt": False}
_fast: Any = njit(cache=True, nogil=True, **_HOW)
_part: Any = njit(forceinline=True, **_HOW)


class AxisModel(NamedTuple):
    """Blurred light of the frames of one axis; their numbers are `frames`.

    Addresses, one for each width of the blur, of two arrays: `light` (places, 2, size) holds T and T' (per line),
    filled up with frames that show nothing; `sums` (places, SUMS) the sums over the frames of T, T², T', T T', T'²
    and T T'².
    """

    light: Addresses
    sums: Addresses
    places: int
    size: int
    frames: Shorts


class Light(NamedTuple):
    """What all pixels share: evenly lit and dark frames, `Limits`, and factors of all frames to a steady lamp."""

    white: Shorts
    black: Shorts
    dark: np.float32
    shot: np.float32
    floor: np.float32
    saturation: np.float32
    steady: Singles


@_part
def _place(u, places):  # type: ignore[no-untyped-def]
    return min(max(INT((u + HALF + F(PAD)) * F(PER_LINE)), 0), places - 1)


@_part
def _middle(at):  # type: ignore[no-untyped-def]
    return (F(at) + HALF) * F(1 / PER_LINE) - F(PAD) - HALF


@_part
def _total(grey):  # type: ignore[no-untyped-def]
    """Sum of grey values, and of their squares."""
    total, square = F(0), F(0)
    for k in range(len(grey)):
        total += grey[k]
        square += grey[k] * grey[k]
    return total, square


@_part
def _dots(grey, light, slope):  # type: ignore[no-untyped-def]
    """Sums of grey value times light and times its slope over the frames of an axis."""
    with_light, with_slope = F(0), F(0)
    for k in range(len(light)):
        with_light += grey[k] * light[k]
        with_slope += grey[k] * slope[k]
    return with_light, with_slope


@_part
def _at(model, width, place):  # type: ignore[no-untyped-def]
    """Light, slope and sums of an axis at a place."""
    size = model.size
    row = model.light[width] + np.uint64(8 * size * place)
    sums = single(model.sums[width] + np.uint64(4 * SUMS * place), SUMS)
    return single(row, size), single(row + np.uint64(4 * size), size), sums


@_part
def _fit(grey_x, grey_y, even, x, y, light, wx, wy, u, v, has_x, has_y, looks):  # type: ignore[no-untyped-def]
    """Estimate one pixel: coordinates, their variances, gain, mean squared residual by its expectation."""
    nx, ny = F(len(x.frames)) if has_x else F(0), F(len(y.frames)) if has_y else F(0)
    whites = F(len(light.white))
    count = nx + ny + whites + F(len(light.black))
    total, square = _total(even)
    bright = F(0)
    for k in range(len(light.white)):
        bright += even[k]
    if has_x:
        t, q = _total(grey_x)
        total, square = total + t, square + q
    if has_y:
        t, q = _total(grey_y)
        total, square = total + t, square + q
    b, s, var_u, var_v, left = F(0), F(0), F(0), F(0), F(0)
    for look in range(looks):
        ax, ay = _place(u, x.places), _place(v, y.places)
        a11, a12, a22, r1, r2 = count, whites, whites, total, bright
        d0, d1, per_x, rx = F(0), F(0), F(0), F(0)
        e0, e1, per_y, ry = F(0), F(0), F(0), F(0)
        tilt_x, tilt_y = F(0), F(0)
        if has_x:
            shown, slope, sums = _at(x, wx, ax)
            t, rx = _dots(grey_x, shown, slope)
            a12, a22, r2 = a12 + sums[0], a22 + sums[1], r2 + t
            d0, d1, per_x, tilt_x = sums[2], sums[3], ONE / (sums[4] + TINY), sums[5]
        if has_y:
            shown, slope, sums = _at(y, wy, ay)
            t, ry = _dots(grey_y, shown, slope)
            a12, a22, r2 = a12 + sums[0], a22 + sums[1], r2 + t
            e0, e1, per_y, tilt_y = sums[2], sums[3], ONE / (sums[4] + TINY), sums[5]
        m11 = a11 - d0 * d0 * per_x - e0 * e0 * per_y
        m12 = a12 - d0 * d1 * per_x - e0 * e1 * per_y
        m22 = a22 - d1 * d1 * per_x - e1 * e1 * per_y
        q1 = r1 - d0 * rx * per_x - e0 * ry * per_y
        q2 = r2 - d1 * rx * per_x - e1 * ry * per_y
        per = ONE / (m11 * m22 - m12 * m12 + TINY)
        b, s = (m22 * q1 - m12 * q2) * per, (m11 * q2 - m12 * q1) * per
        p, q = (rx - b * d0 - s * d1) * per_x, (ry - b * e0 - s * e1) * per_y
        left = square - b * r1 - s * r2 - p * rx - q * ry
        per_s = ONE / max(s, TINY)
        du, dv = min(max(p * per_s, -HALF), HALF), min(max(q * per_s, -HALF), HALF)
        u, v = _middle(ax) + du if has_x else u, _middle(ay) + dv if has_y else v
        if (abs(du) <= NEAR and abs(dv) <= NEAR) or look == looks - 1:
            var_u = per_x + per_x * per_x * per * (d0 * d0 * m22 - F(2) * d0 * d1 * m12 + d1 * d1 * m11)
            var_v = per_y + per_y * per_y * per * (e0 * e0 * m22 - F(2) * e0 * e1 * m12 + e1 * e1 * m11)
            level_u = b + s * tilt_x * per_x
            level_v = b + s * tilt_y * per_y
            var_u *= max(light.dark + light.shot * level_u, light.floor) * per_s * per_s
            var_v *= max(light.dark + light.shot * level_v, light.floor) * per_s * per_s
            break
    noise = max(light.dark + light.shot * (b + HALF * s), light.floor)
    freedom = count - F(2) - (ONE if has_x else F(0)) - (ONE if has_y else F(0))
    return u, v, var_u, var_v, s, left / (noise * max(freedom, ONE))


@part
def _copy_in(frames, steady, source, count, column, grey):  # type: ignore[no-untyped-def]
    """Put frames beside each other, a row a pixel."""
    for n in range(len(frames)):
        if source[1] == 1:
            _put(narrow(grey_at(source, frames[n], count), count), steady[frames[n]], count, grey[:, column + n])
        else:
            _put(wide(grey_at(source, frames[n], count), count), steady[frames[n]], count, grey[:, column + n])


@part
def _put(a, factor, count, column):  # type: ignore[no-untyped-def]
    for i in range(count):
        column[i] = factor * F(a[i])


def rows_for(x: AxisModel, y: AxisModel, light: Light, count: int = SPAN) -> Singles:
    """Scratch memory: a row a pixel, the frames of x, those of y, evenly lit and dark ones."""
    return np.zeros((count, x.size + y.size + len(light.white) + len(light.black)), F)


@part
def _gather(x, y, light, source, count, grey):  # type: ignore[no-untyped-def]
    even = x.size + y.size
    _copy_in(x.frames, light.steady, source, count, 0, grey)
    _copy_in(y.frames, light.steady, source, count, x.size, grey)
    _copy_in(light.white, light.steady, source, count, even, grey)
    _copy_in(light.black, light.steady, source, count, even + len(light.white), grey)


@_part
def _brightest(grey):  # type: ignore[no-untyped-def]
    top = F(0)
    for k in range(len(grey)):
        top = max(top, grey[k])
    return top


@_fast
def refine_pixels(  # type: ignore[no-untyped-def]
    start, stop, columns, addresses, item_size, x, y, light, blur, grey, out
):
    """Estimate the pixels of the rows ``start <= row < stop`` that have a coordinate, from where they are.

    Frames are as in `decode_pixels`. `blur`, uint8 (2, rows of tiles, columns of tiles), says which width the blur of
    each axis has; `grey`, float32 (SPAN, ...) of `rows_for`, is memory of this thread alone. Of `out`, coordinates and
    sigmas in lines, float32 (2, pixels), are changed; the mean squared residual over its expectation, float32
    (pixels,), NaN where the pixel is left as it is, is written.
    """
    place, sigma, misfit = out
    for row in range(start, stop):
        for first in range(0, columns, SPAN):
            count = min(SPAN, columns - first)
            _gather(x, y, light, (addresses, item_size, row * columns + first), count, grey)
            for i in range(count):
                n = row * columns + first + i
                u, v = place[0, n], place[1, n]
                has_x, has_y = u == u and len(x.frames) > 0, v == v and len(y.frames) > 0
                misfit[n] = F(np.nan)
                if not (has_x or has_y) or _brightest(grey[i]) >= light.saturation:
                    continue
                here, there = u if has_x else F(0), v if has_y else F(0)
                wx, wy = blur[0, row // TILE, (first + i) // TILE], blur[1, row // TILE, (first + i) // TILE]
                seen = grey[i, : x.size], grey[i, x.size : x.size + y.size], grey[i, x.size + y.size :]
                new_u, new_v, var_u, var_v, s, left = _fit(*seen, x, y, light, wx, wy, here, there, has_x, has_y, LOOKS)
                if not (s > F(0) and abs(new_u - here) < FARTHEST and abs(new_v - there) < FARTHEST):
                    continue
                misfit[n] = left
                if has_x:
                    place[0, n], sigma[0, n] = new_u, np.sqrt(var_u)
                if has_y:
                    place[1, n], sigma[1, n] = new_v, np.sqrt(var_v)


@_fast
def blur_costs(  # type: ignore[no-untyped-def]
    pixels, addresses, item_size, x, y, light, place, axis, other, grey, costs
):
    """Sum the misfit of pixels of every tile for every width of one axis' blur, as logarithm: some are no plane.

    `pixels`, (tiles, n), are numbers of pixels, below 0 none; `axis` has its widths tried, the other one has the width
    `other`; `costs`, (tiles, widths), are written.
    """
    has_x, has_y = len(x.frames) > 0, len(y.frames) > 0
    for t in range(len(pixels)):
        costs[t] = 0.0
        for m in range(pixels.shape[1]):
            if pixels[t, m] < 0:
                continue
            u, v = place[0, pixels[t, m]], place[1, pixels[t, m]]
            _gather(x, y, light, (addresses, item_size, pixels[t, m]), 1, grey)
            for w in range(costs.shape[1]):
                wx, wy = (w, other) if axis == 0 else (other, w)
                seen = grey[0, : x.size], grey[0, x.size : x.size + y.size], grey[0, x.size + y.size :]
                left = _fit(*seen, x, y, light, wx, wy, u, v, has_x, has_y, 1)[5]
                costs[t, w] += np.log(ONE + left)
