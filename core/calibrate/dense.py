"""The dense system that remains: Cholesky with the diagonal scaled to 1."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from core.calibrate.normals import Factor, SingularNormalsError

Array = NDArray[np.float64]


def factorise(M: Array) -> Factor:
    """Factorise a symmetric positive definite matrix, shape (U, U), which is overwritten.

    Raises
    ------
    SingularNormalsError
        With the direction the matrix does not determine.
    """
    diagonal = np.diagonal(M).copy()
    if not np.all(diagonal > 0):
        raise SingularNormalsError(direction=(~(diagonal > 0)).astype(float))
    scale = 1.0 / np.sqrt(diagonal)
    M *= scale
    M *= scale[:, None]
    # the transpose of a symmetric matrix in C order is the same matrix in the order LAPACK wants: no copy
    lower, info = sla.lapack.dpotrf(M.T, lower=1, clean=1, overwrite_a=0)
    if info != 0:
        raise SingularNormalsError(direction=np.linalg.eigh(M)[1][:, 0] * scale)
    return Factor(lower, scale)


def solve_factor(factor: Factor, b: Array) -> Array:
    """Solve the factorised system for b, shape (U,)."""
    return factor.scale * sla.cho_solve((factor.lower, True), factor.scale * b, check_finite=False)


def inverse_of_factor(factor: Factor) -> Array:
    """Inverse of the factorised matrix, shape (U, U)."""
    half, info = sla.lapack.dpotri(factor.lower, lower=1)
    assert info == 0, "the factor has no zero on its diagonal"
    Q = half + half.T  # above the diagonal the factor is zero
    Q[np.diag_indices(len(Q))] *= 0.5
    Q *= factor.scale
    Q *= factor.scale[:, None]
    return Q
