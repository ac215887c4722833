"""How far single rows of an image are shifted: the line jitter of video, told by the dots that share a row.

The middles of a dot's rows lie on a smooth curve, whatever its tilt, blur and light. What is left of them in a row is
noise of its own in every dot, but the same in all dots of that row where the row as a whole was shifted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.model import Array, Ints

CURVE = 3  # terms of the curve: place, lean, and the bow that uneven light and perspective give
LEAST_ROWS = CURVE + 2
LEAST_SHARE = 0.2  # of the widest row's weight: the middles of shorter ones are mostly noise
LEVEL = 0.05  # of the contrast, where weights begin
BIN_PX = 0.25
SURE = 3.0  # sigmas above which a shift is taken for one


def row_shift(
    image: NDArray[np.float32], uv: Array, ellipse: Array, window: Array, plane: Array, contrast: Array
) -> float:
    """Estimate the standard deviation, px, of the rows' shifts along u; 0 where it is not significant.

    From centroids (m, 2) of bright dots: `ellipse` maps the unit disc to the dot, `window` is the radius in that disc
    of what is weighted, `plane`, (m, 3), the background at the centroid and its slopes. With z the residuals of the
    rows' middles, weighted by the rows' shares in the dot, and A the matrices that make them of the rows' shifts,
    products of different dots are free of noise: ``E(z_i z_k) = shift² tr(A_i A_kᵀ)``.
    """
    height, width = image.shape
    half = window[:, None] * np.linalg.norm(ellipse, axis=2)
    whole = np.all((np.ceil(uv - half) >= 0) & (np.floor(uv + half) < (width, height)), axis=1)
    if not np.any(whole):
        return 0.0
    uv, half = uv[whole], half[whole]
    u, v = _box(uv[:, 0], half[:, 0]), _box(uv[:, 1], half[:, 1])
    away_u, away_v = u - uv[:, :1], v - uv[:, 1:]
    u, v = np.minimum(u, width - 1), np.minimum(v, height - 1)  # beyond the window
    w = _weights(image, (u, v), (away_u, away_v), ellipse[whole], window[whole], plane[whole], contrast[whole])
    row = w.sum(axis=2)
    use = row > LEAST_SHARE * row.max(axis=1, keepdims=True)
    use &= np.count_nonzero(use, axis=1)[:, None] >= LEAST_ROWS
    good = np.any(use, axis=1)
    if not np.any(good):
        return 0.0
    w, row, use, v = w[good], row[good], use[good], v[good]
    away_u, away_v, half = away_u[good], away_v[good], half[good]
    share: Array = np.where(use, row, 0.0) / np.sum(row, axis=1, where=use, keepdims=True)
    middle = np.einsum("mvu,mu->mv", w, away_u) / np.where(use, row, np.inf)
    X = (away_v / half[:, 1:])[..., None] ** np.arange(CURVE)
    weighted = np.swapaxes(X * share[..., None], 1, 2)
    A = share[..., None] * (np.eye(len(X[0])) - X @ np.linalg.solve(weighted @ X, weighted))
    rows, residual = v[use], (A @ middle[..., None])[use, 0]
    # what squares of pixels leave is alike in all dots: the mean of each place is taken away
    place = np.rint(away_v / BIN_PX).astype(int)
    place = np.where(use, place - place[use].min(), 0)
    places = place[use]
    count = np.bincount(places)
    residual -= (np.bincount(places, residual) / np.maximum(count, 1))[places]

    def added(at: Ints, length: int) -> Array:
        cells = at[:, :, None] * height + v[:, None, :]
        return np.asarray(np.bincount(cells.ravel(), A.ravel(), length * height).reshape(length, height), np.float64)

    answers, means = added(v, height), added(place, len(count)) / np.maximum(count, 1)[:, None]
    shared = np.bincount(rows * len(count) + places, minlength=height * len(count)).reshape(height, -1)
    answers -= shared @ means
    own = float(np.sum(A**2)) - float(count @ np.sum(means**2, axis=1))
    scale = float(np.sum(answers**2)) - own
    products = float(np.sum(np.bincount(rows, residual) ** 2) - np.sum(residual**2))
    squares, fourth = (np.bincount(rows, residual**power, height) for power in (2, 4))
    spread = np.sqrt(2 * max(float(np.sum(squares**2 - fourth)), 0.0))
    return float(np.sqrt(products / scale)) if scale > 0 and products > SURE * spread else 0.0


def _box(centre: Array, half: Array) -> Ints:
    """Pixels (m, k) along one axis from where each dot's window begins, as many as the largest has."""
    first = np.ceil(centre - half).astype(np.int64)
    return np.asarray(first[:, None] + np.arange(np.max(np.floor(centre + half) - first) + 1), np.int64)


def _weights(
    image: NDArray[np.float32],
    at: tuple[Ints, Ints],
    away: tuple[Array, Array],
    ellipse: Array,
    window: Array,
    plane: Array,
    contrast: Array,
) -> Array:
    """Light (m, rows, columns) above the background, within each dot's window; 0 beyond."""
    (u, v), du, dv = at, away[0][:, None, :], away[1][:, :, None]
    to_disc = np.linalg.inv(ellipse)[..., None, None]
    disc = to_disc[:, :, 0] * du[:, None] + to_disc[:, :, 1] * dv[:, None]
    (ground, slope_u, slope_v), dark = plane.T[..., None, None], LEVEL * contrast[:, None, None]
    w = image[v[:, :, None], u[:, None, :]] - ground - slope_u * du - slope_v * dv - dark
    return np.where(np.hypot(disc[:, 0], disc[:, 1]) <= window[:, None, None], np.maximum(w, 0.0), 0.0)
