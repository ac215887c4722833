"""How far single rows of an image are shifted: the line jitter of video, told by the dots that share a row.

The middles of a dot's rows lie on a smooth curve, whatever its tilt, blur and light. What is left of them in a row is
noise of its own in every dot, but the same in all dots of that row where the row as a whole was shifted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

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

    Parameters
    ----------
    image : float32, shape (H, W)
        Dots bright.
    uv : array, shape (m, 2)
        Centroids.
    ellipse, window : arrays, shape (m, 2, 2) and (m,)
        Map of the unit disc to the dot, and the radius in that disc of what is weighted.
    plane : array, shape (m, 3)
        Background at the centroid and its slopes.
    contrast : array, shape (m,)

    Notes
    -----
    With z the residuals of the rows' middles, weighted by the rows' shares in the dot, and A the matrices that make
    them of the rows' shifts, products of different dots are free of noise: ``E(z_i z_k) = shift² tr(A_i A_kᵀ)``.
    """
    height, width = image.shape
    dots: list[tuple[Ints, Ints, Array, Array]] = []
    for k in range(len(uv)):
        half = window[k] * np.linalg.norm(ellipse[k], axis=1)
        (u0, v0), (u1, v1) = np.ceil(uv[k] - half).astype(int), np.floor(uv[k] + half).astype(int)
        if min(u0, v0) < 0 or u1 >= width or v1 >= height:
            continue
        v, u = np.mgrid[v0 : v1 + 1, u0 : u1 + 1]
        d = np.stack([u - uv[k, 0], v - uv[k, 1]])
        inside = np.hypot(*np.einsum("ij,jvu->ivu", np.linalg.inv(ellipse[k]), d)) <= window[k]
        w = image[v, u] - plane[k, 0] - plane[k, 1] * d[0] - plane[k, 2] * d[1] - LEVEL * contrast[k]
        w = np.where(inside, np.maximum(w, 0.0), 0.0)
        share = w.sum(axis=1)
        use = share > LEAST_SHARE * share.max(initial=0.0)
        if np.count_nonzero(use) < LEAST_ROWS:
            continue
        share, away = share[use] / share[use].sum(), d[1, use, 0]
        middle = (w * d[0]).sum(axis=1)[use] / w.sum(axis=1)[use]
        X = (away[:, None] / half[1]) ** np.arange(CURVE)
        A = share[:, None] * (np.eye(len(away)) - X @ np.linalg.solve((X.T * share) @ X, X.T * share))
        dots.append((np.arange(v0, v1 + 1)[use], np.rint(away / BIN_PX).astype(int), A @ middle, A))
    if not dots:
        return 0.0
    rows, places, residual = (np.concatenate(part) for part in list(zip(*dots, strict=True))[:3])
    # what squares of pixels leave is alike in all dots: the mean of each place is taken away
    places -= places.min()
    count = np.bincount(places)
    residual -= (np.bincount(places, residual) / np.maximum(count, 1))[places]
    answers, means, at = np.zeros((height, height)), np.zeros((len(count), height)), 0
    for mine, _, _, A in dots:
        columns = slice(mine[0], mine[0] + len(mine))
        answers[columns, columns] += A
        np.add.at(means[:, columns], places[at : at + len(mine)], A)
        at += len(mine)
    means /= np.maximum(count, 1)[:, None]
    shared = np.bincount(rows * len(count) + places, minlength=height * len(count)).reshape(height, -1)
    answers -= shared @ means
    own = sum(float(np.sum(A**2)) for *_, A in dots) - float(count @ np.sum(means**2, axis=1))
    scale = float(np.sum(answers**2)) - own
    products = float(np.sum(np.bincount(rows, residual) ** 2) - np.sum(residual**2))
    squares, fourth = (np.bincount(rows, residual**power, height) for power in (2, 4))
    spread = np.sqrt(2 * max(float(np.sum(squares**2 - fourth)), 0.0))
    return float(np.sqrt(products / scale)) if scale > 0 and products > SURE * spread else 0.0
