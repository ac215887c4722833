"""Whether a rig was rigid, and the one relative orientation that a free adjustment implies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.calibrate.approximate.columns import alone
from core.calibrate.diagnosis.weakness import singular_error, unsolved_error
from core.calibrate.selection import Warnings
from core.calibrate.solution.covariance import pose_cofactors
from core.calibrate.solution.iterate import NotConvergedError, Solution, iterate
from core.calibrate.solution.normals import SingularNormalsError
from core.calibrate.solution.problem import Problem, never_observed, problem_of, weighted_problem
from core.calibrate.solution.solve import Solved
from core.calibrate.solution.state import State
from core.errors import AdjustmentError, InputError
from core.geometry import Pose, rotation_vector_from_matrix
from core.geometry.pairs import relative_derivatives
from core.lazy import dataclass
from core.model import Array, Concern, Network
from core.numerics import fisher_limit
from core.progress import SILENT, Progress

ERROR_LEVEL = 0.001  # chance that a rigid rig is called loose
UNKNOWNS = 6  # of a free station
WHOLE = "A1..A6"  # the lens model that has a shear, which turns with the board's roll
ROUNDING = 1e-6  # mm and mrad: observations were computed
NEGLIGIBLE = 0.3  # of sigma: uneven light moves all targets of an image alike by 0.1 to 0.2 sigma, no rig has to


@dataclass(frozen=True)
class RigidityTest:
    """Comparison of one relative orientation for all poses with a free one for each."""

    #: increase of vᵀPv by the constraint, per constraint, over the variance of unit weight without it; F distributed
    statistic: float
    critical: float  #: what the statistic of a rigid rig exceeds once in a thousand experiments
    #: r.m.s. shift of the image points that the constraint brings about, noise taken off, in units of their sigma. A
    #: significant one below 0.3 is put down to the targets' own systematic errors.
    drift_sigmas: float
    #: shift_rms_mm, turn_rms_mrad: deviations of the poses' own relative orientations from their mean, noise included
    shift_rms_mm: float
    turn_rms_mrad: float
    poses: int  #: number of poses compared

    @property
    def rigid(self) -> bool:
        """Whether nothing speaks against a rigid rig."""
        moved = max(self.shift_rms_mm, self.turn_rms_mrad) > ROUNDING
        return not moved or self.statistic <= self.critical or self.drift_sigmas <= NEGLIGIBLE

    def __str__(self) -> str:
        verdict = "the rig was rigid" if self.rigid else "the rig was not rigid"
        return (
            f"{verdict}: F = {self.statistic:.2f}, critical value {self.critical:.2f}; one orientation for all poses "
            f"moves the image points by {self.drift_sigmas:.2g} sigma r.m.s.; over {self.poses} poses the relative "
            f"orientation scatters by {self.shift_rms_mm:.3g} mm and {self.turn_rms_mrad:.3g} mrad r.m.s."
        )


def rigidity_warnings(solved: Solved, groups: Sequence[int], remedy: str = "", progress: Progress = SILENT) -> Warnings:
    """Warn of a rig that was not rigid, or of which that cannot be told; of a free one there is nothing to remedy."""
    try:
        test = rigidity_of(solved, groups, progress)
    except (InputError, AdjustmentError) as error:  # the other assumption leaves too much open: no fault of this one
        return [f"whether the rig was rigid cannot be tested: {error.where}: {error.seen}"]
    if test.rigid:
        return []
    if remedy and never_observed(solved.network):  # whose stations cannot stand alone
        remedy = "mount the devices firmly"
    found: Warnings = [Concern("doubtful", f"{test}; {remedy}" if remedy else str(test), about="rigid")]
    if poorer := [name for name, device in solved.network.devices.items() if device.spec.model != WHOLE]:
        found.append(f"{', '.join(poorer)}: what a lens model lacks can look like a loose rig, too: try {WHOLE}")
    return found


def rigidity_of(solved: Solved, groups: Sequence[int], progress: Progress = SILENT) -> RigidityTest:
    """Compare a solution, rigid or free, with the other assumption; `groups` gives the pose of every station.

    Of devices with a coordinate never observed, what free stations do not tell stays as it is.
    """
    network = alone(solved.network)
    rigid = weighted_problem(replace(network, station_pose=tuple(groups)), solved.factors)
    free = weighted_problem(replace(network, station_pose=tuple(range(len(groups)))), solved.factors)
    constraints = rigid.redundancy - free.redundancy
    if constraints <= 0:
        raise InputError("the network", "no two devices share several poses", "test rigs of at least two devices")
    values = np.bincount(free.pose, np.count_nonzero(free.root_weight, axis=1), free.poses)
    if values.min() < UNKNOWNS:
        name = f"station {solved.network.station_names[int(np.argmin(values))]}"
        raise AdjustmentError(name, "its orientation is not determined by its points", "add points to it")
    given_rigid = solved.problem.poses == rigid.poses
    free_start = _freed(rigid, solved.state) if given_rigid else solved.state
    free_solution = _solution(network, free, free_start, progress)
    rigid_start = solved.state if given_rigid else _bound(rigid, solved.state)
    rigid_cost = _solution(network, rigid, rigid_start, progress).cost
    variance = free_solution.cost / free.redundancy
    excess = max(rigid_cost - free_solution.cost - constraints * variance, 0.0)
    deviations = np.concatenate([_deviations(rigid, free_solution.state, d) for d in range(len(rigid.base))])
    return RigidityTest(
        statistic=(rigid_cost - free_solution.cost) / constraints / variance,
        critical=fisher_limit(constraints, free.redundancy, ERROR_LEVEL),
        drift_sigmas=float(np.sqrt(excess / variance / (2 * len(rigid.point)))),
        shift_rms_mm=float(np.sqrt(np.mean(np.sum(deviations[:, 3:] ** 2, axis=1)))),
        turn_rms_mrad=1e3 * float(np.sqrt(np.mean(np.sum(deviations[:, :3] ** 2, axis=1)))),
        poses=len(deviations),
    )


def _solution(network: Network, problem: Problem, state: State, progress: Progress) -> Solution:
    try:
        return iterate(problem, state, progress=progress)
    except SingularNormalsError as error:
        raise singular_error(network, problem, state, error) from None
    except NotConvergedError as error:
        raise unsolved_error(network, problem, error) from None


def mean_relative_poses(solved: Solved, groups: Sequence[int], devices: Sequence[int]) -> tuple[list[Pose], Array]:
    """Weighted means of a free adjustment's orientations of devices, each relative to its base device.

    `groups` has the pose of every station, were the rig rigid. The covariance is posterior, of all interior
    orientations and each mean's rotation vector (rad, left perturbation) and translation (mm), in this order. Each pose
    is weighted by the inverse of its own covariance; the means' covariance is propagated from those of all stations and
    interior orientations together, correlations included.
    """
    rigid = problem_of(replace(solved.network, station_pose=tuple(groups)))
    Q = pose_cofactors(solved.problem, solved.inverse)
    # all interior parameters (those held have no row) and the means, as functions of globals and poses
    columns = np.concatenate(solved.problem.interior_columns)
    L = np.zeros((len(columns) + 6 * len(devices), len(Q)))
    L[np.flatnonzero(columns >= 0), columns[columns >= 0]] = 1.0
    means = []
    for k, device in enumerate(devices):
        mean, derivative = _weighted_mean(solved, rigid, device, Q)
        L[len(columns) + 6 * k :][:6] = derivative
        means.append(mean)
    return means, solved.variance * (L @ Q @ L.T)


def _weighted_mean(solved: Solved, rigid: Problem, device: int, Q: Array) -> tuple[Pose, Array]:
    """Weighted mean of one device's relative orientations, and its derivatives by globals and poses."""
    state, G = solved.state, solved.problem.globals
    pairs = _pairs(rigid, device)
    samples = [_relative(state, a, b) for a, b in pairs]
    derivatives = np.zeros((len(pairs), 6, len(Q)))
    for M, (a, b), sample in zip(derivatives, pairs, samples, strict=True):
        M[:, G + 6 * a :][:, :6], M[:, G + 6 * b :][:, :6] = relative_derivatives(state.pose_shift[a], sample)
    weights = np.linalg.inv(derivatives @ Q @ derivatives.transpose(0, 2, 1))
    shares = np.linalg.inv(weights.sum(axis=0)) @ weights
    mean = _plain_mean(samples)
    for _ in range(3):
        step = np.sum([share @ _difference(s, mean) for share, s in zip(shares, samples, strict=True)], axis=0)
        mean = mean.changed(step)
    return mean, np.sum(shares @ derivatives, axis=0)


def _pairs(rigid: Problem, device: int) -> list[tuple[int, int]]:
    """Stations (of the base device, of this device) that share a pose."""
    if rigid.base[device] == device:
        return []
    base = {
        int(p): s
        for s, (p, d) in enumerate(zip(rigid.station_pose, rigid.station_device, strict=True))
        if d == rigid.base[device]
    }
    own = [s for s, d in enumerate(rigid.station_device) if d == device]
    return [(base[int(rigid.station_pose[s])], s) for s in own if int(rigid.station_pose[s]) in base]


def _relative(state: State, base: int, other: int) -> Pose:
    R = state.pose_rotation[other] @ state.pose_rotation[base].T
    return Pose(R, state.pose_shift[other] - R @ state.pose_shift[base])


def _plain_mean(samples: Sequence[Pose]) -> Pose:
    """Unweighted mean; the rotation's is the proper rotation nearest to the mean matrix."""
    U, _, Vt = np.linalg.svd(np.mean([s.rotation for s in samples], axis=0))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return Pose(R, np.mean([s.translation_mm for s in samples], axis=0))


def _difference(pose: Pose, mean: Pose) -> Array:
    turn = rotation_vector_from_matrix(pose.rotation @ mean.rotation.T)
    return np.concatenate([turn, pose.translation_mm - mean.translation_mm])


def _deviations(rigid: Problem, state: State, device: int) -> Array:
    """Differences of a device's relative orientations from their mean, shape (k, 6)."""
    samples = [_relative(state, a, b) for a, b in _pairs(rigid, device)]
    return np.array([_difference(s, _plain_mean(samples)) for s in samples]).reshape(-1, 6)


def _freed(rigid: Problem, state: State) -> State:
    """Every station's own pose from those of a rigid solution."""
    S, T = state.relative_rotation[rigid.station_device], state.relative_shift[rigid.station_device]
    R, t = state.pose_rotation[rigid.station_pose], state.pose_shift[rigid.station_pose]
    one, zero = np.broadcast_to(np.eye(3), state.relative_rotation.shape), np.zeros_like(state.relative_shift)
    return replace(
        state,
        relative_rotation=one.copy(),
        relative_shift=zero,
        pose_rotation=S @ R,
        pose_shift=np.einsum("sij,sj->si", S, t) + T,
    )


def _bound(rigid: Problem, state: State) -> State:
    """Mean relative orientations, and the base devices' poses, from those of a free solution."""
    relative = [Pose() for _ in rigid.base]
    for d in range(len(rigid.base)):
        samples = [_relative(state, a, b) for a, b in _pairs(rigid, d)]
        if samples:
            relative[d] = _plain_mean(samples)
    pose_rotation, pose_shift = np.empty((rigid.poses, 3, 3)), np.empty((rigid.poses, 3))
    is_base = rigid.station_device == rigid.base[rigid.station_device]
    for s in np.argsort(is_base, kind="stable"):  # a base device's own pose is written last
        base = relative[rigid.station_device[s]].inverse() @ Pose(state.pose_rotation[s], state.pose_shift[s])
        pose_rotation[rigid.station_pose[s]], pose_shift[rigid.station_pose[s]] = base.rotation, base.translation_mm
    R, t = np.array([p.rotation for p in relative]), np.array([p.translation_mm for p in relative])
    return replace(state, relative_rotation=R, relative_shift=t, pose_rotation=pose_rotation, pose_shift=pose_shift)
