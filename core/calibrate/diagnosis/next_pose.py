"""What further captures of the board would bring, and which: from the covariance, before anything is captured.

A pose that is added to a network takes ``QAᵀ(I + AQAᵀ)⁻¹AQ`` off the cofactors Q of all that poses share, with A its
whitened equations, the pose itself eliminated. Its observations need not be known for that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from core.calibrate.adjust import solve_network
from core.calibrate.diagnosis.left_out import global_names
from core.calibrate.solution.equations import POSE, linearise
from core.calibrate.solution.normals import reduced_equations
from core.calibrate.solution.problem import problem_of
from core.calibrate.solution.solve import AdjustOptions, Solved
from core.calibrate.solution.state import interior_of
from core.digits import fixed
from core.errors import InputError
from core.geometry import Pose, matrix_from_axis_angle, project
from core.lazy import dataclass
from core.model import Array, Network
from core.model.arrays import Ints
from core.progress import SILENT, Progress

TILTED = ((0.0, 0.0), *((30.0, about) for about in np.arange(0.0, 360.0, 45.0).tolist()))
ROLLS_DEG = (0.0, 90.0, 180.0, 270.0)
SIDES = (  # of the board as the first device sees it, anticlockwise from the right
    "right side",
    "upper right corner",
    "upper edge",
    "upper left corner",
    "left side",
    "lower left corner",
    "lower edge",
    "lower right corner",
)
NEARER = (0.9, 1.0, 1.1)  # distances over the mean of those captured
MOST_POINTS = 60  # of an image stand for all of them
LEAST_POINTS = 6  # that a device must see


@dataclass(frozen=True)
class NextPose:
    """A pose of the board that was not captured, and what it would bring.

    From facing the first device upright, the board is turned by `roll_deg` in its plane, then tilted by `tilt_deg`
    about an axis across the view, `about_deg` anticlockwise from the image's right; its middle is `distance_mm` away.
    The sigmas of all interior and relative orientations fall by `gain` (a share, geometric mean), that of `parameter`
    most, by `most`, from what they are with the poses proposed before.
    """

    tilt_deg: float
    about_deg: float
    roll_deg: float
    distance_mm: float
    gain: float
    parameter: str
    most: float

    @property
    def words(self) -> str:
        """How to hold the board."""
        near = SIDES[round((self.about_deg + 90.0) / 45.0) % len(SIDES)]
        tilt = (
            f"tilted by {self.tilt_deg:.0f}°, its {near} towards the camera" if self.tilt_deg else "facing the camera"
        )
        return f"{tilt}; rolled by {self.roll_deg:.0f}°; {fixed(self.distance_mm, 0)} mm away"


def next_poses(network: Network, count: int = 3, progress: Progress = SILENT) -> tuple[NextPose, ...]:
    """Try poses of the board of an adjusted network and give those to capture next, in this order.

    Each brings most once those before it are captured.

    Raises
    ------
    InputError
        If no pose that is tried is seen by all devices, or the points are too many for a board.
    AdjustmentError
        As `adjust`.
    """
    solved, _ = solve_network(network, AdjustOptions(variance_components=True), progress.part(0.0, 0.3))
    if solved.problem.by_points:
        raise InputError("the network", f"has {solved.problem.points} points", "ask for a board's next pose")
    front = np.diag([1.0, 1.0, 1.0] if np.mean(solved.state.pose_rotation[:, 2, 2]) > 0 else [1.0, -1.0, -1.0])
    middle = solved.state.pose_shift.mean(axis=0)
    tried: list[tuple[float, float, float]] = []
    poses: list[Pose] = []
    for (tilt, about), roll, nearer in product(TILTED, ROLLS_DEG, NEARER):
        across = [np.cos(np.radians(about)), np.sin(np.radians(about)), 0.0]
        turned = front @ matrix_from_axis_angle([0.0, 0.0, 1.0], np.radians(roll))
        pose = Pose(matrix_from_axis_angle(across, np.radians(tilt)) @ turned, nearer * middle)
        if min(map(len, _seen(solved, pose))) >= LEAST_POINTS:
            tried.append((tilt, about, roll))
            poses.append(pose)
    if not poses:
        raise InputError("the network", "no pose tried is seen by all devices", "place the board where all see it")
    return tuple(
        NextPose(*tried[k], float(-poses[k].translation_mm[2]), *gain)
        for k, gain in _chosen(solved, poses, min(count, len(poses)), progress.part(0.3, 1.0))
    )


def _seen(solved: Solved, pose: Pose) -> list[Ints]:
    """Points that each device would see with the board at a pose of the first one."""
    state, seen = solved.state, []
    for d, spec in enumerate(solved.problem.specs):
        stand = Pose(state.relative_rotation[d], state.relative_shift[d]) @ pose
        uv = project(spec, interior_of(solved.problem, state, d), state.xyz, stand)
        seen.append(np.flatnonzero(np.all((uv > 0) & (uv < [spec.width - 1, spec.height - 1]), axis=1)))
    return seen


def _chosen(
    solved: Solved, poses: list[Pose], count: int, progress: Progress
) -> list[tuple[int, tuple[float, str, float]]]:
    """Choose poses one after the other: which, and its gain, the parameter that gains most, and by how much.

    A pose brings hardly more after another than before it. So only those are tried again whose earlier gain is above
    the best of this turn. Source: Minoux, *Accelerated greedy algorithms for maximizing submodular set functions*,
    1978.
    """
    equations, names = _equations_of(solved, poses), global_names(solved)
    Q, G = solved.inverse.Q, solved.problem.globals
    unit = np.sqrt(np.diagonal(Q)[:G])
    scale = np.outer(unit, unit)
    gains: list[tuple[float, str, float]] = [(np.inf, "", 0.0)] * len(poses)
    chosen = []
    for turn in range(count):
        before, current = Q[:G, :G], set[int]()
        while (best := max(range(len(poses)), key=lambda k: gains[k][0])) not in current:
            progress((turn + len(current) / len(poses)) / count, "trying poses")
            A = equations(best)
            after = before - _brought(A, A @ Q, G)
            change = np.linalg.slogdet(after / scale)[1] - np.linalg.slogdet(before / scale)[1]
            shares = 1 - np.sqrt(np.diagonal(after) / np.diagonal(before))
            most = int(np.argmax(shares))
            gains[best] = float(1 - np.exp(change / (2 * G))), names[most], float(shares[most])
            current.add(best)
        chosen.append((best, gains[best]))
        A = equations(best)
        Q = Q - _brought(A, A @ Q, len(Q))
    return chosen


def _brought(A: Array, AQ: Array, size: int) -> Array:
    """Cofactors of the first unknowns that equations A take off Q."""
    return AQ[:, :size].T @ np.linalg.solve(np.eye(len(A)) + AQ @ A.T, AQ[:, :size])


def _equations_of(solved: Solved, poses: list[Pose]) -> Callable[[int], Array]:
    """Give the whitened equations of a pose, which is eliminated, in the shared unknowns."""
    network, names = solved.network, solved.problem.device_names
    with np.errstate(divide="ignore"):
        known = 1 / solved.problem.root_weight
    usual = [np.median(known[solved.problem.device == d], axis=0) for d in range(len(names))]
    rigid = bool((solved.problem.base != np.arange(len(names))).any())
    station, point, sigma = [], [], []
    for k, pose in enumerate(poses):
        for d, seen in enumerate(_seen(solved, pose)):
            few = seen[:: max(len(seen) // MOST_POINTS, 1)]
            station += [k * len(names) + d] * len(few)
            point += few.tolist()
            sigma += [usual[d] * np.sqrt(len(few) / len(seen))] * len(few)
    stations, sigmas = range(len(poses) * len(names)), np.array(sigma)
    more = replace(
        network,
        station_names=tuple(map(str, stations)),
        station_device=names * len(poses),
        station_pose=tuple(s // len(names) if rigid else s for s in stations),
        station_ids=(),
        observation_station=np.array(station),
        observation_point=np.array(point),
        # what is never seen, such as rows by a projector that shows columns alone, is not seen here either
        observation_uv=np.where(np.isfinite(sigmas), 0.0, np.nan),
        observation_sigma=sigmas,
    )
    problem = problem_of(more, by_points=False)
    each = [Pose(solved.state.relative_rotation[d], solved.state.relative_shift[d]) for d in range(len(names))]
    stands = poses if rigid else [own @ pose for pose in poses for own in each]
    R, t = np.array([p.rotation for p in stands]), np.array([p.translation_mm for p in stands])
    J = linearise(problem, replace(solved.state, pose_rotation=R, pose_shift=t)).J
    none, per = np.zeros((len(stands), 6, len(solved.inverse.Q))), 1 if rigid else len(names)

    def equations(k: int) -> Array:
        parts = []
        for e in range(k * per, (k + 1) * per):
            own = np.arange(problem.first[e], problem.first[e + 1])
            basis = np.linalg.qr(J[own, :, POSE : POSE + 6].reshape(-1, 6))[0]
            whole = reduced_equations(problem, J, none, own).reshape(2 * len(own), -1)
            parts.append(whole - basis @ (basis.T @ whole))
        return np.concatenate(parts)

    return equations
