"""Some of many numbers: spread evenly, or as if by lot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

IRRATIONAL = 0.618034, 0.7548776662  # by which whole numbers along two axes have nothing to do with each other


def spaced(count: int, most: int) -> NDArray[np.intp]:
    """Give `most` of so many numbers at the most, evenly from 0 to the last."""
    return np.linspace(0, count - 1, min(count, most)).astype(np.intp)


def by_lot(count: int, which: int = 0) -> NDArray[np.float64]:
    """Give so many numbers from 0 to 1, the first or the second of a place, as if at random.

    They are fractions of squares times an irrational number: multiples would be in step with something. numpy's
    generators take longer to import than most checks to work.
    """
    return np.asarray(np.arange(count) ** 2 * IRRATIONAL[which] % 1)


def scattered(size: int, count: int, which: int = 0) -> NDArray[np.int64]:
    """Give so many whole numbers below a size by `by_lot`."""
    return (by_lot(count, which) * size).astype(np.int64)
