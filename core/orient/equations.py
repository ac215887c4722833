"""Estimates from epipolar residuals and what is known of a scene, with their covariances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array
from core.numerics import sigma_by_median
from core.orient.freedom import Freedom
from core.orient.known import Observed

HUBER = 2.0  # standard deviations beyond which a residual counts less
CLEAR = 2.0  # of Politis' rule for how far neighbours agree, doi:10.1081/ETR-120021582
FOOTPRINT_PX2 = 0.2  # about what lenses and pixels have


@dataclass(frozen=True)
class Estimate:
    """An estimate x (f,), its covariance by noise (f, f), and what it makes of errors of all parameters (f, k)."""

    x: Array
    noise: Array
    carried: Array
    rest: Array  # (n,), what remains of the residuals


@dataclass(frozen=True)
class Places:
    """How places lie in the image: their rows and columns (n, 2) in a grid, of whose steps a tile has so many."""

    at: NDArray[np.int64]
    tile: float

    def together(self, residuals: Array, used: float) -> tuple[float, int]:
        """By how much the sum of residuals (n,) varies more than if they were independent, and its degrees of freedom.

        From their autocovariance by Bartlett's kernel over two tiles, but with a flat top as far as neighbours clearly
        agree (Politis and Romano, doi:10.1111/j.1467-9892.1995.tb00223.x): it would take too little of what they share.
        A fit has used up so many of what these sums show.
        """
        n, reach = len(residuals), int(np.ceil(2 * self.tile))
        at = self.at - self.at.min(axis=0)
        grid = np.zeros(at.max(axis=0) + 1)
        grid[at[:, 0], at[:, 1]] = residuals
        padded = [max(size, reach + 1) + reach for size in grid.shape]
        products = np.fft.irfft2(np.abs(np.fft.rfft2(grid, padded)) ** 2, padded)
        lag = np.arange(-reach, reach + 1)
        agreement = products[np.ix_(lag, lag)] / products[0, 0]
        fall = np.maximum(1 - np.abs(lag) / (2 * self.tile), 0.0)
        ring = np.rint(np.hypot(lag, lag[:, None])).astype(int)
        members = np.bincount(ring.ravel())[:reach]
        clear = np.bincount(ring.ravel(), agreement.ravel())[:reach] > CLEAR * np.sqrt(2 * members * np.log10(n) / n)
        flat = int(np.argmin(clear)) if not clear.all() else reach
        kernel = np.where(ring < flat, 1.0, fall * fall[:, None])
        left = max(1 - used * float(kernel.sum()) / n, 0.1)
        return max(float(np.sum(kernel * agreement)), 0.1) / left, int(n / np.sum(kernel**2))


@dataclass(frozen=True)
class Equations:
    """Residuals as they were before any change of the parameters, with all that they change with."""

    e: Array
    A: Array  # (n, k)
    pulled: Array
    places: Places
    known: Sequence[Observed]

    def solved(self, free: Freedom, prior: Array, weight: Array, noise: Array) -> Estimate:
        """Estimate along free directions, with observations of zero of weights `prior` (f, f) on them.

        The covariance by `noise` (n,) is the sandwich form of White, doi:10.2307/1912934.
        """
        f = free.directions.shape[1]
        B = np.column_stack([self.A @ free.directions, self.pulled])
        whole = np.zeros((f + 1, f + 1))
        whole[:f, :f], whole[f, f] = prior, FOOTPRINT_PX2**-2.0
        weighted = B * weight[:, None]
        N, H, score, scatter = weighted.T @ B, weighted.T @ self.A, weighted.T @ self.e, np.zeros((f + 1, f + 1))
        for known in self.known:
            own = np.column_stack([known.A @ free.directions, np.zeros(len(known.A))])
            N, H, score = N + own.T @ own, H + own.T @ known.A, score + own.T @ known.rest
            scatter += own.T @ own
        inverse = np.linalg.inv(N + whole)
        x = inverse @ score
        rest = self.e - B @ x
        scores = weighted * noise[:, None]
        scatter += scores.T @ scores
        scatter[f, f] += whole[f, f]
        return Estimate(x[:f], (inverse @ scatter @ inverse)[:f, :f], inverse[:f] @ H, rest)

    def noise(self, changes: Array, weight: Array) -> tuple[Array, int]:
        """Noise (n,) and its degrees of freedom: what remains where all parameters may change, (k, m) by a sigma each.

        Errors of the calibration leave patterns that no movement explains; they are the same in every capture, and
        accounted for as such. It is larger by what hangs together among neighbours.
        """
        Z = np.column_stack([self.A @ changes, FOOTPRINT_PX2 * self.pulled])
        weighted = Z * weight[:, None]
        N = weighted.T @ Z
        inverse = np.linalg.inv(N + np.eye(len(N)))
        used = float(np.trace(inverse @ N))
        rest = self.e - Z @ (inverse @ (weighted.T @ self.e))
        factor, freedom = self.places.together(weight * rest, used)
        return rest * np.sqrt(factor), freedom


def robust_estimate(equations: Equations, free: Freedom, prior: Array) -> tuple[Estimate, Array]:
    """Estimate by Huber's weights, iterated to rest; give the weights, too."""
    weight, last = np.ones(len(equations.e)), np.full(free.directions.shape[1], np.inf)
    for _ in range(8):
        estimate = equations.solved(free, prior, weight, np.zeros(len(weight)))
        if np.abs(estimate.x - last).max() < 1e-9:
            break
        limit, last = HUBER * max(sigma_by_median(estimate.rest), 1.0), estimate.x
        weight = np.minimum(1.0, limit / np.maximum(np.abs(estimate.rest), 1e-12))
    return estimate, weight
