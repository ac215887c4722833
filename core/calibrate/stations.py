"""Every station by itself: resected with all solutions a flat field allows, then improved with its device.

Poses and main interior parameters are improved together on the points as they are, and the ambiguous choices made
again until none changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.calibrate.elimination import solve
from core.calibrate.equations import Equations, linearise
from core.calibrate.normals import SingularNormalsError, assemble
from core.calibrate.problem import Problem, State, Step, moved, problem_of, reweighted
from core.calibrate.resection import resect
from core.errors import AdjustmentError
from core.geometry import Pose, pixel_to_image, undistort
from core.model import Interior, Network

Array = NDArray[np.float64]

MAIN_PARAMETERS = ("c", "x0", "y0", "A1")
LEAST_POINTS = 4  # that fix one station's pose without ambiguity
ENOUGH_POINTS = 60  # of a station serve for approximate values
ROUNDS = 4
PRIOR = 0.03  # how far nominal values may be off, as a share of the focal length and of the image's half diagonal
INDEPENDENT = 8


def resectable(network: Network) -> list[int]:
    """Stations that see enough points in both coordinates to be oriented by themselves."""
    complete = np.all(np.isfinite(network.observation_uv), axis=1)
    counts = np.bincount(network.observation_station[complete], minlength=len(network.station_names))
    return [int(s) for s in np.flatnonzero(counts >= LEAST_POINTS)]


def _single_problem(network: Network, stations: list[int]) -> Problem:
    """Give the problem in which those stations are free, points are held and only main parameters are estimated."""
    devices = {
        name: replace(d, estimate=tuple(p for p in d.estimate if p in MAIN_PARAMETERS))
        for name, d in network.devices.items()
    }
    renumber = np.full(len(network.station_names), -1)
    renumber[stations] = np.arange(len(stations))
    use = (renumber[network.observation_station] >= 0) & np.all(np.isfinite(network.observation_uv), axis=1)
    use = _thinned(network, use)
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
    return replace(problem_of(single, by_points=False), points_free=False)


def _thinned(network: Network, use: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of the observations to be used, at most `ENOUGH_POINTS` of each station, spread at random but always the same."""
    rows = np.random.default_rng(0).permutation(np.flatnonzero(use))
    station = network.observation_station[rows]
    by_station = np.argsort(station, kind="stable")
    first = np.searchsorted(station[by_station], station[by_station])
    few = np.zeros_like(use)
    few[rows[by_station][np.arange(len(rows)) - first < ENOUGH_POINTS]] = True
    return few


def oriented_stations(network: Network, stations: list[int]) -> State:
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


def _softened(problem: Problem, equations: Equations) -> tuple[Problem, Equations]:
    """Huber weights: observations beyond three median residuals of their pose count less."""
    size = np.linalg.norm(equations.w, axis=1)
    middle = np.array([np.median(size[a:b]) for a, b in zip(problem.first[:-1], problem.first[1:], strict=True)])
    limit = np.maximum(3 * middle, 1e-9)[problem.pose]
    with np.errstate(invalid="ignore"):
        factor = np.sqrt(np.minimum(1.0, limit / np.maximum(size, 1e-12)))[:, None]
        softer = replace(equations, w=factor * equations.w, J=factor[..., None] * equations.J)
    return reweighted(problem, factor), softer


def _sums(problem: Problem, equations: Equations) -> Array:
    """Weighted sum of squares of every pose."""
    return np.add.reduceat(np.sum(equations.w**2, axis=1), problem.first[:-1])


def _refined(problem: Problem, state: State, iterations: int = 8) -> State:
    """Poses improved one by one with all else held, each with its own damping."""
    held = replace(problem, columns=np.full_like(problem.columns, -1))
    damping = np.full(problem.poses, 1e-3)
    for _ in range(iterations):
        soft, equations = _softened(held, linearise(held, state))
        normals, costs = assemble(soft, equations), _sums(soft, equations)
        ridge = damping[:, None, None] * normals.N_own * np.eye(6) + 1e-12 * np.eye(6)
        step = np.linalg.solve(normals.N_own + ridge, normals.b_own[..., None])[..., 0].astype(np.float64)
        trial = moved(held, state, Step(np.zeros(0), step, np.zeros((0, 3)), 0.0))
        trial_costs = _sums(soft, linearise(soft, trial))
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
        soft, equations = _softened(problem, linearise(problem, state))
        unit = equations.cost / (INDEPENDENT * problem.poses)
        normals = assemble(soft, equations)
        weight = (unit / sigma**2)[free]
        normals.N[places[free], places[free]] += weight
        normals.b[places[free]] += weight * (nominal - state.interior)[free]
        try:
            step = solve(soft, state, equations, damping, normals)
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
