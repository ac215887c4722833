"""Corners where four squares of a chessboard meet: the centre of a fitted saddle, with its covariance.

Notes
-----
Two edges of blur s cross in the centre: ``I = B + g x + C G(d1 / s) G(d2 / s)`` with the distances d from the edges and
``G(t) = erf(t / sqrt 2)``. Adjusted are the centre, both directions, s, C, B and g. What a pixel averages widens s: it
is even about the edges and does not move the centre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ITERATIONS = 12
SETTLED_PX = 1e-4
LEAST_BLUR, MOST_BLUR = 0.3, 4.0
FLOOR_PX = 0.002  # what the pixels' squares leave on noise-free renderings
UNKNOWNS = 9


@dataclass(frozen=True)
class Saddles:
    """Fitted corners, one row of every array each; NaN where no saddle fits."""

    uv: Array  # (n, 2) px
    cov: Array  # (n, 2, 2) px²
    contrast: Array  # (n,) grey values from the middle to the bright squares; negative where X times Y is dark
    blur: Array  # (n,) px
    rest: Array  # (n,) r.m.s. residual in grey values


def fit_saddles(image: NDArray[np.float32], uv: Array, axes: Array, radius_px: Array) -> Saddles:
    """Fit saddles from starts that are good to a pixel.

    Parameters
    ----------
    image : float32, shape (H, W)
    uv : array, shape (n, 2)
        Starts, px.
    axes : array, shape (n, 2, 2)
        Directions of the edges in the image, in columns, of any length.
    radius_px : array, shape (n,)
        Of the discs whose pixels count.
    """
    from scipy.special import erf

    n, height, width = len(uv), *image.shape
    reach = int(np.ceil(radius_px.max(initial=1.0))) + 1
    window = np.arange(-reach, reach + 1)
    base = np.rint(np.nan_to_num(uv)).astype(int)
    cols, rows = base[:, 0, None] + np.tile(window, len(window)), base[:, 1, None] + np.repeat(window, len(window))
    inside = (cols >= 0) & (cols < width) & (rows >= 0) & (rows < height)
    grey = image[np.clip(rows, 0, height - 1), np.clip(cols, 0, width - 1)].astype(np.float64)
    du0, dv0 = cols - uv[:, :1], rows - uv[:, 1:]
    weight = (inside & (du0**2 + dv0**2 <= radius_px[:, None] ** 2)).astype(np.float64)
    angle = np.arctan2(axes[:, 1], axes[:, 0])  # (n, 2)
    count = np.maximum(weight.sum(axis=1), 1.0)
    middle = (weight * grey).sum(axis=1) / count
    contrast, blur = np.sqrt((weight * (grey - middle[:, None]) ** 2).sum(axis=1) / count), np.full(n, 0.8)
    d1, d2 = (_distance(du0, dv0, angle[:, k]) for k in (0, 1))
    contrast *= np.where((weight * (grey - middle[:, None]) * np.sign(d1 * d2)).sum(axis=1) < 0, -1.0, 1.0)
    p = np.column_stack([np.zeros((n, 2)), angle, blur, middle, contrast, np.zeros((n, 2))])
    N = np.tile(np.eye(UNKNOWNS), (n, 1, 1))
    rest = np.zeros_like(grey)
    for _ in range(ITERATIONS):
        x, y = du0 - p[:, :1], dv0 - p[:, 1:2]
        s, C = p[:, 4:5], p[:, 6:7]
        sides, slopes, along = [], [], []
        for k in (2, 3):
            t = _distance(x, y, p[:, k]) / s
            sides.append(erf(t / np.sqrt(2)))
            slopes.append(np.sqrt(2 / np.pi) * np.exp(-0.5 * t**2) / s)
            along.append((t * s, x * np.cos(p[:, k : k + 1]) + y * np.sin(p[:, k : k + 1])))
        by1, by2 = C * slopes[0] * sides[1], C * slopes[1] * sides[0]  # by the distances
        sin, cos = np.sin(p[:, 2:4]), np.cos(p[:, 2:4])
        J = np.stack(
            [
                by1 * sin[:, :1] + by2 * sin[:, 1:],
                -by1 * cos[:, :1] - by2 * cos[:, 1:],
                -by1 * along[0][1],
                -by2 * along[1][1],
                -(by1 * along[0][0] + by2 * along[1][0]) / s,
                np.ones_like(x),
                sides[0] * sides[1],
                du0,
                dv0,
            ],
            axis=-1,
        )
        model = p[:, 5:6] + C * sides[0] * sides[1] + p[:, 7:8] * du0 + p[:, 8:9] * dv0
        rest = weight * (grey - model)
        weighted = J * weight[..., None]
        N = np.swapaxes(weighted, 1, 2) @ J
        scale = np.sqrt(np.maximum(np.einsum("nii->ni", N), 1e-12))
        unit = N / scale[:, :, None] / scale[:, None, :] + 1e-9 * np.eye(UNKNOWNS)
        step = np.linalg.solve(unit, ((np.swapaxes(weighted, 1, 2) @ rest[..., None])[..., 0] / scale)[..., None])
        step = step[..., 0] / scale
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step[:, :2]).max(axis=1), 1e-9))[:, None]
        p += step
        p[:, 4] = np.clip(p[:, 4], LEAST_BLUR, MOST_BLUR)
        if np.nanmax(np.abs(step[:, :2]), initial=0.0) < SETTLED_PX:
            break
    squares = (rest**2).sum(axis=1)
    own = squares / np.maximum(count - UNKNOWNS, 1.0)
    variance = np.maximum(own, np.median(own)) if n else own  # few pixels tell their own noise poorly
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", N), 1e-12))
    inverse = np.linalg.inv(N / scale[:, :, None] / scale[:, None, :] + 1e-9 * np.eye(UNKNOWNS))
    cov = (inverse / scale[:, :, None] / scale[:, None, :])[:, :2, :2] * variance[:, None, None]
    good = (np.hypot(p[:, 0], p[:, 1]) < 1.5) & (count > 1.5 * UNKNOWNS)
    found = np.where(good[:, None], uv + p[:, :2], np.nan)
    return Saddles(found, cov + FLOOR_PX**2 * np.eye(2), p[:, 6], p[:, 4], np.sqrt(own))


def _distance(x: Array, y: Array, angle: Array) -> Array:
    """Signed distances (n, k) of offsets from the lines through the origin at angles (n,)."""
    return np.asarray(y * np.cos(angle)[:, None] - x * np.sin(angle)[:, None])
