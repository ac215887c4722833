"""What may have changed since a pair was calibrated, along which directions, by how much rigs drift, and by chance."""

from __future__ import annotations

import numpy as np

from core.geometry import Pose, cross_matrix
from core.lazy import dataclass
from core.model import Array, Pair
from core.numerics import chi_square_limit, fisher_above

UNLIKELY = 0.05  # share of rigs that drifted as expected for which more is allowed for nevertheless
STRETCHES = np.geomspace(1.0, 100.0, 201)  # of drifts, that are tried


@dataclass(frozen=True)
class OrientOptions:
    """How the rig is watched."""

    significance: float = 1e-3  #: share of captures of an unmoved rig that may be called moved
    #: rotation_prior_rad, shift_prior_mm, interior_prior: standard deviation of what rigs drift by, as observations of
    #: zero; that of c, x0 and y0 as a share of c
    rotation_prior_rad: float = 2e-3
    shift_prior_mm: float = 0.5
    interior_prior: float = 5e-4
    stretch: float = 1.0  #: times as much of shift and interior; a capture that contradicts it stretches it further
    most_places: int = 4_000  #: pixels are averaged over blocks down to about so many
    rounds: int = 4  #: of the linearised estimate, at the most


DEFAULT = OrientOptions()


@dataclass(frozen=True)
class Freedom:
    """What is estimated, along f directions."""

    directions: Array  # (k, f) in the space of the pair's parameters
    moves: Array  # (6, f), rotation and shift of the projector in the camera's frame
    drift: Array  # (f,), standard deviation of what is expected

    @property
    def of_pose(self) -> Freedom:
        """Rotations and shifts alone."""
        pose = slice(min(6, len(self.drift)))
        return Freedom(self.directions[:, pose], self.moves[:, pose], self.drift[pose])

    @property
    def covariance(self) -> Array:
        """Of the pair's parameters (k, k) by what is expected."""
        return np.asarray(self.directions @ np.diag(self.drift**2) @ self.directions.T)


def turns_and_shifts(pose: Pose) -> Array:
    """From changes of a device's pose to its rotation and shift in the frame that the pose is from, (6, 6)."""
    # R' = R exp(-w) = exp(-R w) R, and t' = -R' (p + s)
    R = pose.rotation
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:], J[3:, :3] = -R.T, -R.T, -R.T @ cross_matrix(pose.translation_mm)
    return J


def motion_of(pair: Pair) -> Array:
    """From changes of the pair's parameters to rotation and shift of the projector in the camera's frame, (6, k)."""
    J = np.zeros((6, len(pair.covariance)))
    J[:, -6:] = turns_and_shifts(pair.projector_from_camera)
    return J


def orientation_freedom(pair: Pair, options: OrientOptions) -> Freedom:
    """What the residuals alone show: all rotations, and two shifts across the base."""
    base = pair.projector_from_camera.origin_mm
    across = np.linalg.svd(base[None])[2][1:]
    moves = np.zeros((6, 5))
    moves[:3, :3], moves[3:, 3:] = np.eye(3), across.T
    drift = np.repeat([options.rotation_prior_rad, options.stretch * options.shift_prior_mm], [3, 2])
    return Freedom(_moves(pair) @ moves, moves, drift)


def whole_freedom(pair: Pair, options: OrientOptions) -> Freedom:
    """What something known shows as well: the whole orientation, and c, x0, y0 of both devices."""
    i, k = len(pair.camera.interior.vector), len(pair.covariance)
    inner = np.zeros((k, 6))
    inner[[0, 1, 2, i, i + 1, i + 2], range(6)] = 1.0
    c = np.repeat([pair.camera.interior.c_mm, pair.projector.interior.c_mm], 3)
    drift = np.repeat([options.rotation_prior_rad, options.stretch * options.shift_prior_mm], 3)
    directions = np.column_stack([_moves(pair), inner])
    return Freedom(directions, np.eye(6, 12), np.concatenate([drift, options.stretch * options.interior_prior * c]))


def _moves(pair: Pair) -> Array:
    """From rotation and shift of the projector in the camera's frame to the pair's parameters, (k, 6)."""
    moves = np.zeros((len(pair.covariance), 6))
    moves[-6:] = np.linalg.inv(motion_of(pair)[:, -6:])
    return moves


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
