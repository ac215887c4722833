"""Spreads and medians that gross errors do not move, and small fits to many places at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

MEDIAN_OF_NORMAL = 0.6745  # of the size of a normal deviate


def sigma_by_median(residuals: ArrayLike) -> float:
    """Give the standard deviation of normal residuals about zero by the median of their sizes; NaN is left out.

    Examples
    --------
    >>> round(sigma_by_median([-1.0, 0.5, 0.7, -0.3, 100.0, np.nan]), 2)
    1.04
    """
    return float(np.nanmedian(np.abs(residuals))) / MEDIAN_OF_NORMAL


def sigma_about_median(values: ArrayLike) -> float:
    """Give the standard deviation of normal values by their median distance from the median; NaN is left out."""
    given = np.asarray(values, np.float64)
    return sigma_by_median(given - np.nanmedian(given))


def quantiles(values: Array | Floats, *shares: float) -> list[Array]:
    """Quantiles (n,) of each column of finite values (k, n), as `numpy.quantile` interpolates; sorted once for all.

    Examples
    --------
    >>> quantiles(np.array([[4.0, 0.0], [0.0, 10.0], [1.0, 5.0]]), 0.5, 0.75)
    [array([1., 5.]), array([2.5, 7.5])]
    """
    ordered = np.sort(values, axis=0)
    last = len(ordered) - 1
    places = [share * last for share in shares]
    return [(1 - at % 1) * ordered[int(at)] + at % 1 * ordered[min(int(at) + 1, last)] for at in places]


def median_of(values: Array | Floats) -> float:
    """Median of the values that are finite; NaN where none is.

    Examples
    --------
    >>> median_of(np.array([[3.0, np.nan], [1.0, 2.5]]))
    2.5
    """
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else np.nan


def row_median(values: Array | Floats) -> Array:
    """Medians (m,) along the last axis of (m, k) that ignore NaN; NaN where a row has nothing else.

    Examples
    --------
    >>> row_median(np.array([[3.0, 1.0, np.nan], [np.nan, np.nan, np.nan]]))
    array([ 2., nan])
    """
    ordered = np.sort(values, axis=1)  # NaN last
    count = np.isfinite(ordered).sum(axis=1)
    rows = np.arange(len(values))
    low, high = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, values.shape[1] - 1)
    middle = (ordered[rows, low] + ordered[rows, high]) / 2
    return np.where(count > 0, middle, np.nan)


def normal_equations(A: Array, weight: Array, b: Array | Floats) -> tuple[Array, Array]:
    """``A' W A`` (m, p, p) and ``A' W b`` (m, p, q) of designs (m, k, p), weights (m, k), observations (m, k, q)."""
    weighted = np.swapaxes(A * weight[..., None], 1, 2)
    return weighted @ A, weighted @ b


def inverse_2x2(matrix: Array) -> Array:
    """Inverses of matrices (..., 2, 2); not finite where there is none."""
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    with np.errstate(all="ignore"):
        return np.asarray(
            np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
            / (a * d - b * c)[..., None, None]
        )
