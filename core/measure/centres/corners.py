"""Corners where two straight edges cross (chessboards) or end (a tag's): the fitted centre, with its covariance.

Notes
-----
Edges at distances d1, d2 are blurred by a Gaussian of sigma s: ``I = (B + C Q(d1 / s, d2 / s)) (1 + g x / B)``, for
light falls off over bright and dark alike. Where they cross, Q is the mean product of the signs of two normal variables
with means d / s, which correlate by the cosine r between the edges:
``Q = erf erf + 4 phi phi sum(r^n He He / n!)``, the tetrachoric series. Where one quadrant alone is dark,
``(Q + erf + erf - 1) / 2``. Adjusted are the centre, both directions, s, C, B and g. What a pixel averages widens s: it
is even about the edges and does not move the centre.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array

ITERATIONS = 12
SETTLED_PX = 1e-4
LEAST_BLUR, MOST_BLUR = 0.4, 4.0
FLOOR_PX = 0.002  # what the pixels' squares leave on noise-free renderings
UNKNOWNS = 9
OBLIQUE = 0.9  # cosine between the edges up to which the series is taken


@dataclass(frozen=True)
class Corners:
    """Fitted corners, one row of every array each; NaN where no corner fits."""

    uv: Array  # (n, 2) px
    cov: Array  # (n, 2, 2) px²
    contrast: Array  # (n,) grey values from the middle to the bright squares; negative where X times Y is dark
    blur: Array  # (n,) px
    rest: Array  # (n,) r.m.s. residual in grey values


def fit_corners(image: NDArray[np.float32], uv: Array, area: Array, single: bool = False) -> Corners:
    """Fit corners from starts (n, 2) that are good to a pixel.

    `area`, (n, 2, 2), lies along the two edges, in columns: the ellipse whose half axes on the board these are holds
    the pixels that count. With `single` one quadrant alone differs: that between the two.
    """
    n, height, width = len(uv), *image.shape
    reach = int(np.ceil(np.linalg.norm(area, axis=2).max(initial=1.0))) + 1
    window = np.arange(-reach, reach + 1)
    base = np.rint(np.nan_to_num(uv)).astype(int)
    cols, rows = base[:, 0, None] + np.tile(window, len(window)), base[:, 1, None] + np.repeat(window, len(window))
    inside = (cols >= 0) & (cols < width) & (rows >= 0) & (rows < height)
    grey = image[np.clip(rows, 0, height - 1), np.clip(cols, 0, width - 1)].astype(np.float64)
    du0, dv0 = cols - uv[:, :1], rows - uv[:, 1:]
    within = np.sum((np.linalg.inv(area) @ np.stack([du0, dv0], axis=1)) ** 2, axis=1) <= 1
    weight = (inside & within).astype(np.float64)
    if single:  # so that both distances are positive there
        area = area * np.where(np.linalg.det(area)[:, None] > 0, [1.0, -1.0], [-1.0, 1.0])[:, None]
    angle = np.arctan2(area[:, 1], area[:, 0])  # (n, 2)
    count = np.maximum(weight.sum(axis=1), 1.0)
    middle = (weight * grey).sum(axis=1) / count
    contrast, blur = np.sqrt((weight * (grey - middle[:, None]) ** 2).sum(axis=1) / count), np.full(n, 0.8)
    start = _pattern(np.stack([_distance(du0, dv0, angle[:, k]) for k in (0, 1)]) / 0.8, 0.0 * contrast, single)[0]
    contrast *= np.where((weight * (grey - middle[:, None]) * start).sum(axis=1) < 0, -1.0, 1.0)
    p = np.column_stack([np.zeros((n, 2)), angle, blur, middle, contrast, np.zeros((n, 2))])
    N = np.tile(np.eye(UNKNOWNS), (n, 1, 1))
    rest = np.zeros_like(grey)
    for _ in range(ITERATIONS):
        x, y = du0 - p[:, :1], dv0 - p[:, 1:2]
        s, C = p[:, 4:5], p[:, 6:7]
        sin, cos = np.sin(p[:, 2:4]), np.cos(p[:, 2:4])
        t = np.stack([_distance(x, y, p[:, k]) for k in (2, 3)]) / s
        shape, slopes, by_cosine = _pattern(t, np.cos(p[:, 2] - p[:, 3]), single)
        board, base = p[:, 5:6] + C * shape, np.maximum(p[:, 5:6], np.abs(C))
        lit = 1 + (p[:, 7:8] * du0 + p[:, 8:9] * dv0) / base
        by1, by2 = C * lit * slopes / s  # by the distances
        turned = C * lit * by_cosine * np.sin(p[:, 2:3] - p[:, 3:4])
        along = [x * cos[:, k : k + 1] + y * sin[:, k : k + 1] for k in (0, 1)]
        J = np.stack(
            [
                by1 * sin[:, :1] + by2 * sin[:, 1:],
                -by1 * cos[:, :1] - by2 * cos[:, 1:],
                -by1 * along[0] - turned,
                -by2 * along[1] + turned,
                -(by1 * t[0] + by2 * t[1]),
                lit,
                shape * lit,
                board * du0 / base,
                board * dv0 / base,
            ],
            axis=-1,
        )
        rest = weight * (grey - board * lit)
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
    usual = float(np.median(own)) if n else 0.0  # few pixels tell their own noise poorly
    variance = np.where(own > usual * (1 + 4 * np.sqrt(2 / np.maximum(count - UNKNOWNS, 1.0))), own, usual)
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", N), 1e-12))
    inverse = np.linalg.inv(N / scale[:, :, None] / scale[:, None, :] + 1e-9 * np.eye(UNKNOWNS))
    cov = (inverse / scale[:, :, None] / scale[:, None, :])[:, :2, :2] * variance[:, None, None]
    good = (np.hypot(p[:, 0], p[:, 1]) < 1.5) & (count > 1.5 * UNKNOWNS)
    found = np.where(good[:, None], uv + p[:, :2], np.nan)
    return Corners(found, cov + FLOOR_PX**2 * np.eye(2), p[:, 6], p[:, 4], np.sqrt(own))


def _distance(x: Array, y: Array, angle: Array) -> Array:
    """Signed distances (n, k) of offsets from the lines through the origin at angles (n,)."""
    return np.asarray(y * np.cos(angle)[:, None] - x * np.sin(angle)[:, None])


def _pattern(t: Array, cosine: Array, single: bool) -> tuple[Array, Array, Array]:
    """Q (n, k) at distances t (2, n, k) from the edges, in sigmas, and what it grows by with those and the cosine."""
    from scipy.special import erf

    r = np.clip(cosine, -OBLIQUE, OBLIQUE)[:, None]
    root = np.sqrt(1 - r * r)
    sides, bell = erf(t / np.sqrt(2)), np.exp(-0.5 * t * t) / np.sqrt(2 * np.pi)
    hermite, term, series = [np.ones_like(t), t], np.ones_like(r), np.zeros_like(t[0])
    for n in range(1, 7):
        term = term * r / n
        series += term * hermite[0][0] * hermite[0][1]
        hermite = [hermite[1], t * hermite[1] - n * hermite[0]]
    Q = sides[0] * sides[1] + 4 * bell[0] * bell[1] * series
    slopes = 2 * bell * erf((t[::-1] - r * t) / (root * np.sqrt(2)))
    square = (t[0] ** 2 - 2 * r * t[0] * t[1] + t[1] ** 2) / (2 * root * root)
    by_cosine = 2 * np.exp(-square) / (np.pi * root)
    if not single:
        return Q, slopes, by_cosine
    return (Q + sides[0] + sides[1] - 1) / 2, slopes / 2 + bell, by_cosine / 2
