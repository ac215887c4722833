"""The nearest of some places; values between the pixels of an image, and beyond a few known places.

Looking at all of a few hundred places is quicker than importing a tree.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
_TREE = 300_000  # distances from which on a tree is quicker
_FEW = 3  # places up to which one after the other is


def four_pixels(shape: tuple[int, ...], uv: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Give the four pixels around places (n, 2) of an image, and their weights in a bilinear interpolation.

    Rows, columns and weights, (4, n): upper left, upper right, lower left, lower right. The weights' sum is 1; NaN
    outside the image.

    Examples
    --------
    >>> rows, columns, weights = four_pixels((2, 2), [[0.5, 0.5], [1.0, 0.0], [1.1, 0.0]])
    >>> (np.array([[0.0, 1.0], [2.0, 3.0]])[rows, columns] * weights).sum(axis=0)
    array([1.5, 1. , nan])
    """
    p = np.asarray(uv, np.float64).reshape(-1, 2)
    last = np.array([shape[1] - 1, shape[0] - 1])
    inside = np.all((p >= 0) & (p <= last), axis=1)
    corner = np.minimum(np.where(inside[:, None], p, 0.0).astype(np.intp), np.maximum(last - 1, 0))
    right, down = np.where(inside, (p - corner).T, np.nan)
    column, row = corner.T
    beside, below = np.minimum(column + 1, last[0]), np.minimum(row + 1, last[1])
    weights = np.stack([(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down])
    return np.stack([row, row, below, below]), np.stack([column, beside, column, beside]), weights


def from_neighbours(places: Array, values: Array, of: Array, most: int, stiff: float = 0.1) -> tuple[Array, Array]:
    """Fit a plane to the `most` nearest places around each other one; give values (m, k) and slopes (m, 2, k).

    Places, (n, 2) and (m, 2), are in units of their spacing; those further away weigh less with the square of the
    distance. `stiff` is how much slopes are kept small: as by one place a step away that is good to about the root of
    it.

    Examples
    --------
    >>> known = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    >>> value, slope = from_neighbours(known, known @ [[1.0], [2.0]], np.array([[2.0, 2.0]]), 4, stiff=1e-9)
    >>> np.round(value, 3).tolist(), np.round(slope[0].T, 3).tolist()
    ([[6.0]], [[1.0, 2.0]])
    """
    near = nearest(places, min(most, len(places)), of=of)
    step = places[near] - of[:, None, :]
    A = np.concatenate([np.ones_like(step[..., :1]), step], axis=2)
    weighted = np.swapaxes(A, 1, 2) / (0.1 + np.sum(step**2, axis=2))[:, None]
    found = np.linalg.solve(weighted @ A + np.diag([1e-9, *2 * [stiff]]), weighted @ values[near])
    return found[:, 0], found[:, 1:]


def kd_tree(places: ArrayLike) -> Any:
    """Make SciPy's tree of places; importing it takes 0.3 s, and most commands measure nothing."""
    from scipy.spatial import cKDTree

    return cKDTree(places)


def nearest(places: ArrayLike, k: int = 1, of: ArrayLike | None = None) -> NDArray[np.int64]:
    """Indices (m, k) of the k nearest of places (n, d), the nearest first; k is at most n.

    Of each place in `of`, (m, d), by default of the places themselves, each of which is its own first one.

    Examples
    --------
    >>> nearest([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0]], 2).tolist()
    [[0, 1], [1, 0], [2, 1]]
    """
    known = np.asarray(places, np.float64)
    asked = known if of is None else np.asarray(of, np.float64)
    if len(known) * len(asked) > _TREE:
        return np.asarray(kd_tree(known).query(asked, k=k)[1], np.int64).reshape(len(asked), k)
    square = sum((np.subtract.outer(a, b) ** 2 for a, b in zip(asked.T, known.T, strict=True)), np.zeros(1))
    if of is None:
        np.fill_diagonal(square, -1.0)  # where two coincide
    if k <= _FEW and not np.isnan(square.sum()):  # the least, the next one ...: a tenth of the time
        found = np.empty((len(asked), k), np.int64)
        for rank in range(k):
            found[:, rank] = square.argmin(axis=1)
            square[np.arange(len(asked)), found[:, rank]] = np.inf
        return found
    few = np.argpartition(square, k - 1, axis=1)[:, :k] if k < len(known) else np.argsort(square, axis=1)
    order = np.argsort(np.take_along_axis(square, few, axis=1), axis=1, kind="stable")
    return np.asarray(np.take_along_axis(few, order, axis=1), np.int64)
