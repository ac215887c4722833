"""Spreads and medians that gross errors do not move, and small fits to many places at once."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

MEDIAN_OF_NORMAL = 0.6745  # of the size of a normal deviate
NEAR, TINY = 3.0, 1e-12  # times the median distance from a line: points that make it
MANY, SOME, AROUND = 5000, 1000, 50  # values of which some tell between which the wanted one is; ranks of these


def sigma_by_median(residuals: ArrayLike) -> float:
    """Give the standard deviation of normal residuals about zero by the median of their sizes; NaN is left out.

    Examples
    --------
    >>> round(sigma_by_median([-1.0, 0.5, 0.7, -0.3, 100.0, np.nan]), 2)
    1.04
    """
    size = np.abs(np.ravel(residuals))
    return float(_between(_those(size, ~np.isnan(size)), 0.5)) / MEDIAN_OF_NORMAL


def sigma_about_median(values: ArrayLike) -> float:
    """Give the standard deviation of normal values by their median distance from the median; NaN is left out."""
    given = np.ravel(values).astype(np.float64)
    given = _those(given, ~np.isnan(given))
    return sigma_by_median(given - _between(given, 0.5))


def quantiles(values: Array | Floats, *shares: float) -> list[Array]:
    """Quantiles (n,) of each column of finite values (k, n), as `numpy.quantile` interpolates; sorted once for all.

    Examples
    --------
    >>> quantiles(np.array([[4.0, 0.0], [0.0, 10.0], [1.0, 5.0]]), 0.5, 0.75)
    [array([1., 5.]), array([2.5, 7.5])]
    """
    ordered: Array = np.sort(values, axis=0)
    return quantiles_in(ordered, *shares)


def quantiles_in(ordered: Array | Floats, *shares: float) -> list[Array]:
    """The same of columns that are in ascending order."""
    last = len(ordered) - 1
    places = [share * last for share in shares]
    return [(1 - at % 1) * ordered[int(at)] + at % 1 * ordered[min(int(at) + 1, last)] for at in places]


def distinct(values: ArrayLike) -> NDArray[Any]:
    """Distinct values of an array in ascending order. `numpy.unique` first imports masked arrays, which takes 15 ms.

    Examples
    --------
    >>> distinct([3, 1, 3, 2]).tolist()
    [1, 2, 3]
    """
    ordered = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]]


def quantile_of(values: ArrayLike, share: float) -> float:
    """Quantile of all values that are finite, as `numpy.quantile` interpolates, in a tenth of its time; NaN of none.

    Examples
    --------
    >>> quantile_of([[4.0, 0.0], [1.0, 2.0]], 0.5)
    1.5
    """
    given = np.ravel(values)
    return float(_between(_those(given, np.isfinite(given)), share))


def median_of(values: ArrayLike) -> float:
    """Median of the values that are finite; NaN where none is.

    Examples
    --------
    >>> median_of(np.array([[3.0, np.nan], [1.0, 2.5]]))
    2.5
    """
    return quantile_of(values, 0.5)


def ranked(values: Array | Floats, share: float) -> Any:
    """The value that such a share lies below, along the last axis; as fast as `quantile_of`, of many rows as well.

    Examples
    --------
    >>> ranked(np.array([[4.0, 0.0, 2.0], [1.0, 5.0, 3.0]]), 0.5)
    array([2., 3.])
    """
    rank = int(share * values.shape[-1])
    return np.partition(values, rank)[..., rank]


def _between(known: NDArray[Any], share: float) -> Any:
    """Quantile of values (n,) without NaN. numpy ranks for one place ten times as fast as for the two it asks for."""
    if not len(known):
        return np.nan
    at = share * (len(known) - 1)
    part = at % 1
    near, below = _around(known, int(at))
    ranked = np.partition(near, below)
    return (1 - part) * ranked[below] + part * ranked[below + 1 :].min() if part else ranked[below]


def _around(known: NDArray[Any], rank: int) -> tuple[NDArray[Any], int]:
    """Those of values (n,) among which the one of a rank is, and the next one, and its rank there.

    Of many values, two that some of them tell are nearly always below and above: a third of the time of ranking all.
    """
    if len(known) < MANY:
        return known, rank
    some = np.sort(known[:: len(known) // SOME])
    at = rank * len(some) // len(known)
    low, high = some[max(at - AROUND, 0)], some[min(at + AROUND, len(some) - 1)]
    below, near = int(np.count_nonzero(known < low)), known[(known >= low) & (known <= high)]
    return (near, rank - below) if below <= rank < below + len(near) - 1 else (known, rank)


def _those(values: NDArray[Any], use: NDArray[np.bool_]) -> NDArray[Any]:
    """Those of values (n,) that are in use; not copied where all are."""
    return values if use.all() else values[use]


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


def exponents(degree: int) -> list[tuple[int, int]]:
    """Exponents of x and y in the terms of a polynomial: 1, x, y, x², xy, y², x³, ..."""
    return [(n - k, k) for n in range(degree + 1) for k in range(n + 1)]


def polynomial(x: Array, y: Array, degree: int) -> Array:
    """Terms of a polynomial at places (...) each, in the order of `exponents`, shape (..., terms)."""
    by_x, by_y = _powers(x, degree), _powers(y, degree)
    terms = exponents(degree)
    found = np.empty((*np.broadcast(x, y).shape, len(terms)), np.result_type(x, y))
    for k, (i, j) in enumerate(terms):  # a stack of arrays takes twice as long
        np.multiply(by_x[i], by_y[j], out=found[..., k])
    return found


def polynomial_slopes(x: Array, y: Array, degree: int) -> Array:
    """Derivatives of these terms by x and by y, shape (2, ..., terms)."""
    by_x, by_y = _powers(x, degree), _powers(y, degree)
    along = [i * by_x[max(i - 1, 0)] * by_y[j] for i, j in exponents(degree)]
    across = [j * by_x[i] * by_y[max(j - 1, 0)] for i, j in exponents(degree)]
    return np.stack([np.stack(each, axis=-1) for each in (along, across)])


def _powers(x: Array, most: int) -> list[Array]:
    """1, x, x² ... up to a power, by products: higher powers of arrays take several times as long."""
    found = [np.ones_like(x)]
    for _ in range(most):
        found.append(found[-1] * x)
    return found


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


def straight_line(points: Array) -> tuple[Array, Array]:
    """Point and direction (d,) of the line that most of some points (n, d) lie along; of three and fewer, all.

    Of the lines through two of them it is the one with the least median distance, fitted to the points near it.

    Examples
    --------
    >>> middle, direction = straight_line(np.array([[0.0, 0], [1, 0], [2, 7], [3, 0], [4, 0]]))
    >>> float(middle[1]), float(abs(direction[0]))
    (0.0, 1.0)
    """
    near = points
    if len(points) > 3:
        first, second = np.array([*combinations(range(len(points)), 2)]).T
        direction = points[second] - points[first]
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), TINY)
        away = points - points[first][:, None]
        along = np.einsum("knd,kd->kn", away, direction)
        beside = np.linalg.norm(away - along[..., None] * direction[:, None], axis=2)
        usual = np.array([median_of(each) for each in beside])
        best = int(np.argmin(usual))
        near = points[beside[best] <= max(NEAR * usual[best], TINY)]
    middle = near.mean(axis=0)
    return middle, np.linalg.svd(near - middle)[2][0]
