"""Projector coordinates of a target: the phase maps read at the image of its centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.measure.rays import Rays
from core.model import Array, Floats
from core.numerics import four_pixels, row_median

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
    result, spread = np.full(len(uv), np.nan), np.full(len(uv), np.nan)
    height, width = values.shape
    for k in np.flatnonzero(np.all(np.isfinite(uv), axis=1)).tolist():
        half = outer[k] * np.linalg.norm(ellipse[k], axis=1) + 1
        (u0, v0), (u1, v1) = np.floor(uv[k] - half).astype(int), np.ceil(uv[k] + half).astype(int)
        box = slice(max(v0, 0), min(v1, height - 1) + 1), slice(max(u0, 0), min(u1, width - 1) + 1)
        if not np.isfinite(values[box]).any():
            continue
        v, u = np.mgrid[box]
        d = np.stack([u.ravel(), v.ravel()], axis=1) - uv[k]
        disc = np.linalg.solve(ellipse[k], d.T)
        y, s = values[v, u].ravel().astype(np.float64), sigma[v, u].ravel().astype(np.float64)
        radius = np.hypot(*disc)
        use = (radius >= inner[k]) & (radius <= outer[k]) & np.isfinite(y) & (s > 0)
        x, z = disc  # in the unit disc the terms are of one size
        A = np.stack([np.ones(len(d)), x, z, x * x, x * z, z * z], axis=1)[:, :terms]
        for _ in range(3):
            quadrants = np.bincount((2 * (x[use] > 0) + (z[use] > 0)).astype(int), minlength=4)
            if quadrants.min() < terms - 1:  # never a value that only one side vouches for
                result[k], spread[k] = np.nan, np.nan
                break
            cofactor = np.linalg.inv((A[use] / s[use, None] ** 2).T @ A[use])
            surface = cofactor @ (A[use].T @ (y[use] / s[use] ** 2))
            off = np.abs(y - A @ surface)
            misfit = np.sum((off[use] / s[use]) ** 2) / (np.count_nonzero(use) - terms)  # of blur beside other prints
            result[k], spread[k] = surface[0], np.sqrt(cofactor[0, 0] * max(misfit, 1.0))
            keep = use & (off < 5 * s + max(3.0 * float(np.median(off[use])), 0.05))
            if np.array_equal(keep, use):
                break
            use = keep
    return result, spread


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
