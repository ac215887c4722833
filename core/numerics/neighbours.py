"""The nearest of some places, by looking at all of them: of a few hundred that is quicker than importing a tree."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_TREE = 300_000  # distances from which on a tree is quicker


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
    few = np.argpartition(square, k - 1, axis=1)[:, :k] if k < len(known) else np.argsort(square, axis=1)
    order = np.argsort(np.take_along_axis(square, few, axis=1), axis=1, kind="stable")
    return np.asarray(np.take_along_axis(few, order, axis=1), np.int64)
