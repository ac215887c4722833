"""Nonlinear least squares of few unknowns; SciPy's takes longer to import than most of them to solve."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
MOST_STEPS = 400
ENOUGH = 1e-12  # share of the squared sum that a last step may still have taken away
STEEPEST = 1e12  # damping at which no step, however short, makes the sum smaller


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
