"""Initial values from the nominal focal lengths and the approximate points alone.

Every station is resected by itself with all solutions a flat field allows. Poses and main interior parameters are
then improved together on the points as they are, and the ambiguous choices made again until none changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.calibrate.equations import linearise
from core.calibrate.normals import SingularNormalsError, assemble, solve_normals
from core.calibrate.problem import Problem, State, Step, moved, problem_of, reweighted
from core.calibrate.resection import resect
from core.errors import AdjustmentError
from core.geometry import (
    Pose,
    matrix_from_rotation_vector,
    pixel_to_image,
    rotation_vector_from_matrix,
    undistort,
)
from core.model import Interior, Network

Array = NDArray[np.float64]

MAIN_PARAMETERS = ("c", "x0", "y0", "A1")
LEAST_POINTS = 4  # that fix one station's pose without ambiguity
ROUNDS = 4
PRIOR = 0.03  # how far nominal values may be off, as a share of the focal length and of the image's half diagonal
INDEPENDENT = 8


def initial_state(network: Network, problem: Problem) -> State:
    """Approximate values of all unknowns of a network.

    Raises
    ------
    AdjustmentError
        If the pose of a station, or the orientation of a rigid device relative to its base, cannot be found.
    """
    stations = resectable(network)
    state = _improved_stations(network, stations)
    found = {s: Pose(state.pose_rotation[k], state.pose_shift[k]) for k, s in enumerate(stations)}
    relative = _relative_orientations(problem, found)
    pose_rotation, pose_shift = np.zeros((problem.poses, 3, 3)), np.full((problem.poses, 3), np.nan)
    # a pose is taken from its base device where that was resected: it is written last
    for s in sorted(found, key=lambda s: problem.station_device[s] == problem.base[problem.station_device[s]]):
        device = problem.station_device[s]
        if device in relative:
            base_from_object = relative[device].inverse() @ found[s]
            pose_rotation[problem.station_pose[s]] = base_from_object.rotation
            pose_shift[problem.station_pose[s]] = base_from_object.translation_mm
    lost = np.isnan(pose_shift[problem.station_pose, 0])
    if lost.any() or len(relative) < len(problem.device_names):
        station = network.station_names[int(np.argmax(lost))]
        raise AdjustmentError(
            f"station {station}",
            "its orientation cannot be found from the approximate points",
            "check the identities of its points and the nominal focal length, or leave the station out",
        )
    R = np.array([relative[d].rotation for d in range(len(relative))])
    t = np.array([relative[d].translation_mm for d in range(len(relative))])
    return State(state.interior, R, t, pose_rotation, pose_shift, problem.approximate.copy())


def resectable(network: Network) -> list[int]:
    """Stations that see enough points in both coordinates to be oriented by themselves."""
    complete = np.all(np.isfinite(network.observation_uv), axis=1)
    counts = np.bincount(network.observation_station[complete], minlength=len(network.station_names))
    return [int(s) for s in np.flatnonzero(counts >= LEAST_POINTS)]


def _relative_orientations(problem: Problem, found: dict[int, Pose]) -> dict[int, Pose]:
    """Median over the poses of every device's orientation relative to its base device."""
    relative = {d: Pose() for d in range(len(problem.base)) if problem.base[d] == d}
    by_pose: dict[int, dict[int, Pose]] = {}
    for s, pose in found.items():
        by_pose.setdefault(int(problem.station_pose[s]), {})[int(problem.station_device[s])] = pose
    for _ in problem.base:  # a device may share poses only with one that is not the base itself
        for d in range(len(problem.base)):
            if d in relative:
                continue
            samples = []
            for views in by_pose.values():
                for other, pose in views.items():
                    if d in views and other in relative and problem.base[other] == problem.base[d]:
                        samples.append(views[d] @ pose.inverse() @ relative[other])
            if samples:
                relative[d] = _median_pose(samples)
    return relative


def _median_pose(samples: list[Pose]) -> Pose:
    """Pose in the middle of several, little moved by a few wrong ones."""
    turns = [[np.linalg.norm(rotation_vector_from_matrix(a.rotation @ b.rotation.T)) for b in samples] for a in samples]
    middle = samples[int(np.argmin(np.median(turns, axis=1)))].rotation
    vectors = np.array([rotation_vector_from_matrix(s.rotation @ middle.T) for s in samples])
    R = matrix_from_rotation_vector(np.median(vectors, axis=0)) @ middle
    return Pose(R, np.median([s.translation_mm for s in samples], axis=0))


# ------------------------------------------------------------------------------------------------ station by station


def _single_problem(network: Network, stations: list[int]) -> Problem:
    """Give the problem in which those stations are free, points are held and only main parameters are estimated."""
    devices = {
        name: replace(d, estimate=tuple(p for p in d.estimate if p in MAIN_PARAMETERS))
        for name, d in network.devices.items()
    }
    renumber = np.full(len(network.station_names), -1)
    renumber[stations] = np.arange(len(stations))
    use = renumber[network.observation_station] >= 0
    single = replace(
        network,
        devices=devices,
        station_names=tuple(network.station_names[s] for s in stations),
        station_device=tuple(network.station_device[s] for s in stations),
        station_pose=tuple(range(len(stations))),
        observation_station=renumber[network.observation_station[use]],
        observation_point=network.observation_point[use],
        observation_uv=network.observation_uv[use],
        observation_sigma=network.observation_sigma[use],
        scale=None,
    )
    return replace(problem_of(single), points_free=False)


def _improved_stations(network: Network, stations: list[int]) -> State:
    """Poses of stations, each free, and main interior parameters, on the approximate points."""
    specs = [d.spec for d in network.devices.values()]
    interior = np.array([[s.nominal_c_mm, *([0.0] * 8)] for s in specs])
    S, D = len(stations), len(specs)
    if not stations:
        raise AdjustmentError(
            "the network", f"no station sees {LEAST_POINTS} points in both coordinates", "add image points"
        )
    problem = _single_problem(network, stations)
    one, zero = np.array([np.eye(3)] * D), np.zeros((D, 3))
    state = State(interior, one, zero, np.zeros((S, 3, 3)), np.zeros((S, 3)), problem.approximate)
    best = np.full(S, np.inf)
    for _ in range(ROUNDS):
        changed = False
        for R, t in _candidates(network, problem, stations, state):
            trial = _refined(problem, replace(state, pose_rotation=R, pose_shift=t))
            costs = _absolute_sums(problem, trial)
            better = costs < 0.99 * best
            changed |= bool(better.any())
            state = replace(
                state,
                pose_rotation=np.where(better[:, None, None], trial.pose_rotation, state.pose_rotation),
                pose_shift=np.where(better[:, None], trial.pose_shift, state.pose_shift),
            )
            best = np.where(better, costs, best)
        if not changed:
            break
        state = _improved_together(problem, state, interior)
        best = _absolute_sums(problem, state)
    return state


def _candidates(network: Network, problem: Problem, stations: list[int], state: State) -> list[tuple[Array, Array]]:
    """Resections of every station with the present interior orientations: up to three sets of poses."""
    specs = [network.devices[name].spec for name in problem.device_names]
    interiors = [Interior.from_vector(v, r0) for v, r0 in zip(state.interior, problem.r0, strict=True)]
    lists = []
    for k in range(problem.poses):
        rows = slice(problem.first[k], problem.first[k + 1])
        d = problem.station_device[k]
        xy = undistort(interiors[d], pixel_to_image(specs[d], problem.uv[rows]))
        use = np.all(problem.root_weight[rows] > 0, axis=1) & np.all(np.isfinite(xy), axis=1)
        points = problem.approximate[problem.point[rows][use]]
        poses = resect(points, xy[use] / interiors[d].c_mm) if np.count_nonzero(use) >= LEAST_POINTS else []
        if not poses and np.any(state.pose_rotation[k]):
            poses = [Pose(state.pose_rotation[k], state.pose_shift[k])]
        if not poses:
            raise AdjustmentError(
                f"station {network.station_names[stations[k]]}",
                f"no pose explains its {np.count_nonzero(use)} points",
                "check their identities, the axis directions and the nominal focal length, or leave the station out",
            )
        lists.append(poses)
    count = max(len(poses) for poses in lists)
    chosen = [[poses[min(k, len(poses) - 1)] for poses in lists] for k in range(count)]
    return [(np.array([p.rotation for p in row]), np.array([p.translation_mm for p in row])) for row in chosen]


def _absolute_sums(problem: Problem, state: State) -> Array:
    """Sum of absolute whitened residuals of every pose: a measure that a few wrong points do not rule."""
    sums = np.sum(np.abs(linearise(problem, state).w), axis=1)
    return np.add.reduceat(sums, problem.first[:-1])


def _softened(problem: Problem, state: State) -> Problem:
    """Huber weights: observations beyond three median residuals of their pose count less."""
    size = np.linalg.norm(linearise(problem, state).w, axis=1)
    middle = np.array([np.median(size[a:b]) for a, b in zip(problem.first[:-1], problem.first[1:], strict=True)])
    limit = np.maximum(3 * middle, 1e-9)[problem.pose]
    with np.errstate(invalid="ignore"):
        return reweighted(problem, np.sqrt(np.minimum(1.0, limit / np.maximum(size, 1e-12)))[:, None])


def _refined(problem: Problem, state: State, iterations: int = 8) -> State:
    """Poses improved one by one with all else held, each with its own damping."""
    held = replace(problem, columns=np.full_like(problem.columns, -1))
    damping = np.full(problem.poses, 1e-3)
    for _ in range(iterations):
        soft = _softened(held, state)
        equations = linearise(soft, state)
        normals = assemble(soft, equations)
        costs = np.add.reduceat(np.sum(equations.w**2, axis=1), problem.first[:-1])
        ridge = np.einsum("p,pij,ij->pij", damping, normals.N_pose, np.eye(6)) + 1e-12 * np.eye(6)
        step = np.linalg.solve(normals.N_pose + ridge, normals.b_pose[..., None])[..., 0]
        trial = moved(held, state, Step(np.zeros(0), step, np.zeros((0, 3)), 0.0))
        trial_costs = np.add.reduceat(np.sum(linearise(soft, trial).w ** 2, axis=1), problem.first[:-1])
        better = trial_costs < costs
        state = replace(
            state,
            pose_rotation=np.where(better[:, None, None], trial.pose_rotation, state.pose_rotation),
            pose_shift=np.where(better[:, None], trial.pose_shift, state.pose_shift),
        )
        damping = np.where(better, damping / 10, damping * 10)
        if np.all(costs - trial_costs < 1e-3 * costs):
            break
    return state


def _improved_together(problem: Problem, state: State, nominal: Array, iterations: int = 15) -> State:
    """Poses and main interior parameters improved together, wrong points softened, weak parameters kept near nominal.

    The misfit is mostly the points' approximation, which is alike for neighbouring points: a pose counts like
    `INDEPENDENT` observations of that misfit against the nominal values with sigmas `PRIOR`.
    """
    if problem.globals == 0:
        return _refined(problem, state)
    # radial: its displacement at the edge of the image, as a share of that radius
    radius = np.hypot(problem.raster[:, 0] * problem.raster[:, 2], problem.raster[:, 1] * problem.raster[:, 3])
    sigma = np.full_like(nominal, np.inf)
    sigma[:, 0], sigma[:, 1:3], sigma[:, 3] = PRIOR * nominal[:, 0], PRIOR * radius[:, None], PRIOR / radius**2
    places, free = problem.columns[:, :9], problem.columns[:, :9] >= 0
    damping = 1e-3
    for _ in range(iterations):
        soft = _softened(problem, state)
        equations = linearise(soft, state)
        unit = equations.cost / (INDEPENDENT * problem.poses)
        normals = assemble(soft, equations)
        weight = (unit / sigma**2)[free]
        normals.N[places[free], places[free]] += weight
        normals.b[places[free]] += weight * (nominal - state.interior)[free]
        try:
            step = solve_normals(soft, state, normals, damping)
        except SingularNormalsError:
            damping *= 100
            continue
        trial = moved(soft, state, step)
        before, after = (
            e.cost + float(np.sum(weight * (nominal - s.interior)[free] ** 2))
            for e, s in ((equations, state), (linearise(soft, trial), trial))
        )
        if after < before:
            state, damping = trial, damping / 10
            if step.gain < 1e-4 * before:
                break
        else:
            damping *= 10
    return state
