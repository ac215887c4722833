"""What chance explains: an estimate this far from zero, and drifts of the size that is allowed for."""

from __future__ import annotations

import numpy as np

from core.model import Array
from core.numerics import chi_square_limit, fisher_above

UNLIKELY = 0.05  # share of rigs that drifted as expected for which more is allowed for nevertheless
STRETCHES = np.geomspace(1.0, 100.0, 201)  # of drifts, that are tried


def significance_of(x: Array, covariance: Array, scatter: int) -> float:
    """Probability of an estimate this far from zero by chance: Hotelling's test, `scatter` degrees of freedom."""
    t2 = float(x @ np.linalg.solve(covariance, x))
    rank, freedom = len(x), max(scatter, 2 * len(x))
    return fisher_above(rank, freedom - rank + 1, t2 * (freedom - rank + 1) / (freedom * rank))


def stretch_of(x: Array, covariance: Array, by_drift: Array, unit: Array) -> float:
    """By how much the drifts allowed for may fall short of an estimate x (f,); 1 if they explain it.

    What residuals do not show is known by those drifts alone: `by_drift` (f, 12) is what one sigma of each makes of
    the estimate, `covariance` (f, f) is by all else. Where the estimate contradicts them, a multiple of those of shifts
    and interior orientations takes their place: the largest within one sigma of the likeliest. A multiple is never
    below 1, so twice the gain in logarithmic likelihood is that of chi-square in half of all cases, and 0 in the
    others. `unit` (f,) makes numbers of one size.
    """
    x, covariance, by_drift = x / unit, covariance / np.outer(unit, unit), by_drift / unit[:, None]
    rotations, others = by_drift[:, :3], by_drift[:, 3:]
    whiten = np.linalg.inv(np.linalg.cholesky(covariance + rotations @ rotations.T + 1e-6 * np.eye(len(x))))
    size, axes = np.linalg.eigh(whiten @ others @ others.T @ whiten.T)
    variance = 1 + STRETCHES[:, None] ** 2 * np.maximum(size, 0.0)
    misfit = np.sum(np.log(variance) + (axes.T @ whiten @ x) ** 2 / variance, axis=1)
    if misfit[0] - misfit.min() <= chi_square_limit(1, 2 * UNLIKELY):
        return 1.0
    return float(STRETCHES[misfit <= misfit.min() + 1].max())
