"""Symmetric positive definite systems, and nonlinear least squares of few unknowns.

NumPy does those of usual size, LAPACK through SciPy large ones: importing `scipy.linalg` takes 0.2 s, longer than any
adjustment of usual size, and SciPy's least squares longer than most of them take to solve.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

LARGE = 1000  # unknowns from which on LAPACK's own routines are worth their import
_SOLVED, _INVERTED = 32, 160  # sizes of the blocks that numpy works on
MOST_STEPS = 400
ENOUGH = 1e-12  # share of the squared sum that a last step may still have taken away
STEEPEST = 1e12  # damping at which no step, however short, makes the sum smaller


def factor_of(M: Array) -> Array | None:
    """Lower triangular L with M = L Lᵀ, of a symmetric matrix, shape (n, n); None if it is not positive definite."""
    if len(M) > LARGE:
        from scipy.linalg.lapack import dpotrf

        # the transpose of a symmetric matrix in C order is the same matrix in the order LAPACK wants: no copy
        lower, info = dpotrf(M.T, lower=1, clean=1, overwrite_a=0)
        return None if info else np.asarray(lower)
    try:
        return np.asarray(np.linalg.cholesky(M))
    except np.linalg.LinAlgError:
        return None


def solution_by(L: Array, b: Array) -> Array:
    """x of L Lᵀ x = b, shape (n,)."""
    n = len(L)
    if n > LARGE:
        from scipy.linalg import cho_solve

        return np.asarray(cho_solve((L, True), b, check_finite=False))
    x = np.array(b, np.float64)
    blocks = [slice(start, start + _SOLVED) for start in range(0, n, _SOLVED)]
    for s in blocks:
        x[s] = np.linalg.solve(L[s, s], x[s] - L[s, : s.start] @ x[: s.start])
    for s in reversed(blocks):
        x[s] = np.linalg.solve(L[s, s].T, x[s] - L[s.stop :, s].T @ x[s.stop :])
    return x


def inverse_by(L: Array) -> Array:
    """(L Lᵀ)⁻¹, shape (n, n)."""
    n = len(L)
    if n > LARGE:
        from scipy.linalg.lapack import dpotri

        half, info = dpotri(L, lower=1)
        assert info == 0, "the factor has no zero on its diagonal"
        Q = np.asarray(half + half.T)  # above the diagonal the factor is zero
        Q[np.diag_indices(n)] *= 0.5
        return Q
    X, Q = np.zeros((n, n)), np.empty((n, n))
    _invert(L, X)
    _square(X, Q)
    return Q


def _invert(L: Array, X: Array) -> None:
    """X = L⁻¹, by halves."""
    h = len(L) // 2
    if len(L) <= _INVERTED:
        X[:] = np.linalg.inv(L)
        return
    _invert(L[:h, :h], X[:h, :h])
    _invert(L[h:, h:], X[h:, h:])
    np.matmul(X[h:, h:], -(L[h:, :h] @ X[:h, :h]), out=X[h:, :h])


def _square(X: Array, Q: Array) -> None:
    """Q = XᵀX of a lower triangular X, by halves."""
    h = len(X) // 2
    if len(X) <= _INVERTED:
        Q[:] = X.T @ X
        return
    _square(X[h:, h:], Q[h:, h:])
    np.matmul(X[h:, h:].T, X[h:, :h], out=Q[h:, :h])
    Q[:h, h:] = Q[h:, :h].T
    _square(X[:h, :h], Q[:h, :h])
    Q[:h, :h] += X[h:, :h].T @ X[h:, :h]


def least_squares(
    misfit: Callable[[Array], Array], jacobian: Callable[[Array], Array], start: ArrayLike, most_steps: int = MOST_STEPS
) -> tuple[Array, Array]:
    """Minimise the squared sum of ``misfit(x)``, (m,), by damped steps; give x, (n,), and the derivatives (m, n) there.

    Marquardt, *An algorithm for least-squares estimation of nonlinear parameters*, J. SIAM 11 (1963).

    Examples
    --------
    >>> t = np.arange(5.0)
    >>> x, _ = least_squares(lambda x: x[0] * np.exp(-x[1] * t) - 3 * np.exp(-0.5 * t),
    ...                      lambda x: np.stack([np.exp(-x[1] * t), -x[0] * t * np.exp(-x[1] * t)], axis=1), [1, 1])
    >>> np.round(x, 9)
    array([3. , 0.5])
    """
    x = np.array(start, np.float64)
    rest, J, damping = misfit(x), jacobian(x), 1e-3
    cost = float(rest @ rest)
    for _ in range(most_steps):
        N = J.T @ J
        N[np.diag_indices(len(x))] *= 1 + damping
        try:
            trial = x - np.linalg.solve(N, J.T @ rest)
        except np.linalg.LinAlgError:
            trial = np.full_like(x, np.nan)
        new = misfit(trial) if np.all(np.isfinite(trial)) else np.full(1, np.inf)
        if float(new @ new) < cost:
            done = cost - float(new @ new) <= ENOUGH * cost
            x, rest, cost, J, damping = trial, new, float(new @ new), jacobian(trial), damping / 10
        else:
            done, damping = damping > STEEPEST, damping * 10
        if done:
            break
    return x, J
