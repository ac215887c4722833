"""Small fits and medians over many targets at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


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
