"""The dense system that remains: Cholesky with the diagonal scaled to 1."""

from __future__ import annotations

import numpy as np

from core.calibrate.normals import Factor, SingularNormalsError
from core.model import Array
from core.numerics import factor_of, inverse_by, solution_by


def factorise(M: Array) -> Factor:
    """Factorise a symmetric positive definite matrix, (U, U), which is overwritten.

    A SingularNormalsError has the direction the matrix does not determine.
    """
    diagonal = np.diagonal(M).copy()
    if not np.all(diagonal > 0):
        raise SingularNormalsError(direction=(~(diagonal > 0)).astype(float))
    scale = 1.0 / np.sqrt(diagonal)
    M *= scale
    M *= scale[:, None]
    lower = factor_of(M)
    if lower is None:
        raise SingularNormalsError(direction=np.linalg.eigh(M)[1][:, 0] * scale)
    return Factor(lower, scale)


def solve_factor(factor: Factor, b: Array) -> Array:
    """Solve the factorised system for b, shape (U,)."""
    return factor.scale * solution_by(factor.lower, factor.scale * b)


def inverse_of_factor(factor: Factor) -> Array:
    """Inverse of the factorised matrix, shape (U, U)."""
    Q = inverse_by(factor.lower)
    Q *= factor.scale
    Q *= factor.scale[:, None]
    return Q
