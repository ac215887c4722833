"""The nearest of some places, by looking at all of them: up to a few thousand that is quicker than importing a tree."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_TREE = 4000  # places from which on a tree is quicker


def kd_tree(places: ArrayLike) -> Any:
    """Make SciPy's tree of places; importing it takes 0.3 s, and most commands measure nothing."""
    from scipy.spatial import cKDTree

    return cKDTree(places)


def nearest(places: ArrayLike, k: int = 1, of: ArrayLike | None = None) -> NDArray[np.int64]:
    """Indices of the k nearest places, the nearest first.

    Parameters
    ----------
    places : array-like, shape (n, d)
    k : int
        At most n.
    of : array-like, shape (m, d), optional
        Whose neighbours; by default those of the places, each of which is its own first one.

    Returns
    -------
    index : array, shape (m, k)

    Examples
    --------
    >>> nearest([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0]], 2).tolist()
    [[0, 1], [1, 0], [2, 1]]
    """
    known = np.asarray(places, np.float64)
    asked = known if of is None else np.asarray(of, np.float64)
    if len(known) > _TREE:
        return np.asarray(kd_tree(known).query(asked, k=k)[1], np.int64).reshape(len(asked), k)
    index = np.empty((len(asked), k), np.int64)
    for start in range(0, len(asked), 256):
        part = asked[start : start + 256]
        square = np.sum((part[:, None, :] - known) ** 2, axis=-1)
        few = np.argpartition(square, k - 1, axis=1)[:, :k] if k < len(known) else np.argsort(square, axis=1)
        order = np.argsort(np.take_along_axis(square, few, axis=1), axis=1, kind="stable")
        index[start : start + 256] = np.take_along_axis(few, order, axis=1)
    return index
