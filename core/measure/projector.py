"""Projector coordinates of a target: the phase maps read at the image of its centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import njit
from core.measure.kernels import inverted
from core.measure.rays import Rays
from core.model import Array, Floats
from core.numerics import four_pixels, row_median
from core.parallel import run_in_bands

JUMP_LINES = 0.5  # a value this far (and six sigma) off the rest of the dot is a decoding error, not a measurement


def bilinear(values: Floats, sigma: Floats, uv: Array) -> tuple[Array, Array]:
    """Interpolate a map at points (n, 2) px between its four pixels: values and sigmas (n,), NaN unless all are valid.

    The four errors are independent, so that ``sigma² = sum(weight² sigma_i²)``: smaller than a pixel's own. In a smooth
    map both diagonals have the same sum; where they differ by more than noise, one of the four is a decoding error.
    """
    rows, columns, weight = four_pixels(values.shape, uv)
    value, error = values[rows, columns].astype(np.float64), sigma[rows, columns].astype(np.float64)
    total, variance = (weight * value).sum(axis=0), ((weight * error) ** 2).sum(axis=0)
    twist, spread = value[0] - value[1] - value[2] + value[3], (error**2).sum(axis=0)
    with np.errstate(invalid="ignore"):
        total[np.abs(twist) > JUMP_LINES + 6 * np.sqrt(spread)] = np.nan
    return total, np.sqrt(variance)


def inside_dot(values: Floats, sigma: Floats, uv: Array, ellipse: Array, window: Array) -> tuple[Array, Array]:
    """Value and sigma (n,) at the middle of a weighted plane through the valid pixels of each dot's interior."""
    return _surface(values, sigma, uv, ellipse, np.zeros(len(uv)), np.minimum(window, 0.85), 3)


def around_dot(values: Floats, sigma: Floats, uv: Array, ellipse: Array, window: Array) -> tuple[Array, Array]:
    """Value and sigma (n,) at the middle of a quadratic surface through the valid pixels round each dot.

    For dots too dark, or too bright, to be decoded themselves: the board around them lies in the same surface. The
    quadratic terms carry the perspective across the ring.
    """
    return _surface(values, sigma, uv, ellipse, window, window + 0.8, 6)


def _surface(
    values: Floats, sigma: Floats, uv: Array, ellipse: Array, inner: Array, outer: Array, terms: int
) -> tuple[Array, Array]:
    """Weighted robust fit of 3 (plane) or 6 (quadratic) terms to the pixels between two radii in the unit disc."""
    out = np.full((len(uv), 2), np.nan)

    def band(a: int, b: int) -> None:
        _fit_surfaces(values, sigma, uv[a:b], ellipse[a:b], inner[a:b], outer[a:b], terms, out[a:b])

    run_in_bands(band, len(uv), least=32)
    return out[:, 0], out[:, 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_surfaces(
    values: Floats, sigma: Floats, uv: Array, ellipse: Array, inner: Array, outer: Array, terms: int, out: Array
) -> None:  # pragma: no cover  compiled
    N, b, surface = np.empty((terms, terms)), np.empty(terms), np.empty(terms)
    for k in range(len(uv)):
        p, q, r, s = ellipse[k, 0, 0], ellipse[k, 0, 1], ellipse[k, 1, 0], ellipse[k, 1, 1]
        du, dv = outer[k] * np.hypot(p, q) + 1, outer[k] * np.hypot(r, s) + 1
        if not (np.isfinite(uv[k, 0] + du) and np.isfinite(uv[k, 1] + dv)):
            continue
        left, right = max(int(uv[k, 0] - du), 0), min(int(uv[k, 0] + du) + 1, values.shape[1] - 1)
        top, bottom = max(int(uv[k, 1] - dv), 0), min(int(uv[k, 1] + dv) + 1, values.shape[0] - 1)
        room, n = max(right - left + 1, 0) * max(bottom - top + 1, 0), 0
        A, y, weight, off = np.empty((room, 6)), np.empty(room), np.empty(room), np.empty(room)
        for v in range(top, bottom + 1):
            for u in range(left, right + 1):
                du, dv = u - uv[k, 0], v - uv[k, 1]
                x, z = (s * du - q * dv) / (p * s - q * r), (p * dv - r * du) / (p * s - q * r)
                radius = np.hypot(x, z)  # in the unit disc the terms are of one size
                if inner[k] <= radius <= outer[k] and np.isfinite(values[v, u]) and sigma[v, u] > 0:
                    A[n, 0], A[n, 1], A[n, 2], A[n, 3], A[n, 4], A[n, 5] = 1.0, x, z, x * x, x * z, z * z
                    y[n], weight[n] = values[v, u], 1 / np.float64(sigma[v, u]) ** 2
                    n += 1
        for _ in range(3):
            N[:], b[:], quadrants = 0.0, 0.0, np.zeros(4)
            for i in range(n):
                quadrants[2 * (A[i, 1] > 0) + (A[i, 2] > 0)] += 1
                for j in range(terms):
                    b[j] += A[i, j] * weight[i] * y[i]
                    for m in range(terms):
                        N[j, m] += A[i, j] * weight[i] * A[i, m]
            # never a value that only one side vouches for
            if quadrants.min() < terms - 1 or not inverted(N):
                out[k] = np.nan
                break
            surface[:], misfit = 0.0, 0.0
            for j in range(terms):
                for m in range(terms):
                    surface[j] += N[j, m] * b[m]
            for i in range(n):
                rest = y[i]
                for j in range(terms):
                    rest -= A[i, j] * surface[j]
                off[i] = abs(rest)
                misfit += off[i] ** 2 * weight[i] / (n - terms)  # of blur beside other prints
            out[k, 0], out[k, 1] = surface[0], np.sqrt(N[0, 0] * max(misfit, 1.0))
            limit, kept = max(3.0 * np.median(off[:n]), 0.05), 0
            for i in range(n):
                if off[i] < 5 / np.sqrt(weight[i]) + limit:
                    A[kept], y[kept], weight[kept] = A[i], y[i], weight[i]
                    kept += 1
            if kept == n:
                break
            n = kept


def refuse_jumps(values: Floats, uv: Array, ellipse: Array, found: Array, sigma: Array) -> NDArray[np.bool_]:
    """Which values (n,) disagree with the rest of their dot by a decoding error.

    Pairs of points opposite each other average to the value in the middle, whatever the slope; their median is immune
    to a few wrong pixels. Where fewer than three pairs are valid nothing is refused.
    """
    around = Rays(uv, ellipse).sample(values, np.array([0.3, 0.55]))
    half = around.shape[1] // 2
    pairs = ((around[:, :half] + around[:, half:]) / 2).reshape(len(uv), half * around.shape[2])
    enough = np.isfinite(pairs).sum(axis=1) >= 3
    with np.errstate(invalid="ignore"):
        return np.asarray(enough & (np.abs(found - row_median(pairs)) > JUMP_LINES + 6 * sigma))


def decoded_inside(values: Floats, uv: Array, ellipse: Array) -> NDArray[np.bool_]:
    """Whether most of a dot's interior (n,) is decoded: an invalid pixel in its middle is then an exception."""
    inside = Rays(uv, ellipse).sample(values, np.array([0.0, 0.3, 0.6]))
    return np.asarray(np.mean(np.isfinite(inside), axis=(1, 2)) > 0.5)
