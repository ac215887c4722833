"""Every station by itself: resected with all solutions a flat field allows, then improved with its device.

Poses and main interior parameters are improved together on the points as they are, and the ambiguous choices made
again until none changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.calibrate.approximate.refinement import refined, robust_factors
from core.calibrate.approximate.resection import resect_despite_errors
from core.calibrate.solution.elimination import reduce
from core.calibrate.solution.equations import cost_of, misclosures
from core.calibrate.solution.normals import SingularNormalsError, assemble
from core.calibrate.solution.problem import COMPILED, RELATIVE, Problem, most_parameters, problem_of, reweighted
from core.calibrate.solution.state import State, interior_of, moved
from core.errors import AdjustmentError
from core.geometry import LENSES, estimated, fitted, lens_of, undistort
from core.model import Array, DeviceSpec, Interior, Network, NetworkDevice
from core.numerics import distinct

MAIN_PARAMETERS = ("c", "x0", "y0", "A1")
LEAST_POINTS = 4  # that fix one station's pose without ambiguity
ENOUGH_POINTS = 60  # of a station serve for approximate values
ROUNDS = 4
PRIOR = 0.03  # how far nominal values may be off, as a share of the focal length and of the image's half diagonal
INDEPENDENT = 8
SETTLED = 1e-4  # gain of a step, as a share of the weighted squares, after which approximate values are good enough
STALLED = 1e-3  # the same of a step that does not lower them: damping would take long to win so little


def resectable(network: Network) -> list[int]:
    """Stations that see enough points in both coordinates to be oriented by themselves."""
    complete = np.all(np.isfinite(network.observation_uv), axis=1)
    counts = np.bincount(network.observation_station[complete], minlength=len(network.station_names))
    return [int(s) for s in np.flatnonzero(counts >= LEAST_POINTS)]


def _single_problem(network: Network, stations: list[int]) -> Problem:
    """Give the problem in which those stations are free, points are held and only main parameters are estimated."""
    devices = {name: NetworkDevice(*_stand_in(d)) for name, d in network.devices.items()}
    renumber = np.full(len(network.station_names), -1)
    renumber[stations] = np.arange(len(stations))
    use = (renumber[network.observation_station] >= 0) & np.all(np.isfinite(network.observation_uv), axis=1)
    use = _thinned(network, use)
    single = replace(
        network,
        devices=devices,
        station_names=tuple(network.station_names[s] for s in stations),
        station_device=tuple(network.station_device[s] for s in stations),
        station_ids=(),
        station_pose=tuple(range(len(stations))),
        observation_station=renumber[network.observation_station[use]],
        observation_point=network.observation_point[use],
        observation_uv=network.observation_uv[use],
        observation_sigma=network.observation_sigma[use],
        scale=None,
        lengths=(),
    )
    return replace(problem_of(single, by_points=False), points_free=False)


def _stand_in(device: NetworkDevice) -> tuple[DeviceSpec, tuple[str, ...]]:
    """Give a device with the lens that the kernels know, and the main parameters to be estimated: none if known."""
    spec, free = device.spec, estimated(device)
    if spec.interior is None:
        return spec, tuple(p for p in free if p in MAIN_PARAMETERS)
    interior = spec.interior
    if interior.model != COMPILED:
        interior = fitted(spec, interior, COMPILED)[0]
    plain = replace(spec, interior=interior, interior_sigma=())
    if np.isfinite(spec.interior_sigma).any() or "c" not in free:
        return plain, ()
    bends = bool(lens_of(spec).of_kind("radial")) and any(p in free for p in lens_of(spec).of_kind("radial"))
    return plain, tuple(p for p in MAIN_PARAMETERS if p in free or (p == "A1" and bends))


def in_own_lenses(network: Network, state: State) -> State:
    """Say approximate interior orientations, shape (D, 9), in each device's own lens model, shape (D, K)."""
    interior = np.zeros((len(network.devices), most_parameters(network)))
    for d, device in enumerate(network.devices.values()):
        spec, k = device.spec, len(lens_of(device.spec).names)
        found = Interior.from_vector(state.interior[d, : len(LENSES[COMPILED].names)], nominal_r0(spec), COMPILED)
        if spec.interior is None:
            interior[d, :k] = found.vector
            continue
        known = spec.interior.vector
        if _stand_in(device)[1] and spec.interior.model == COMPILED:
            interior[d, :k] = found.vector
        elif _stand_in(device)[1]:
            names = lens_of(spec).names
            said = fitted(spec, found, spec.model)[0].vector
            interior[d, :k] = [s if n in estimated(device) else v for n, s, v in zip(names, said, known, strict=True)]
        else:
            interior[d, :k] = known
    return replace(state, interior=interior)


class NoPoseError(AdjustmentError):
    """A station whose points fit no pose; others may fit theirs."""


def nominal_r0(spec: DeviceSpec) -> float:
    """Zero of the radial parameters where a device is described by the lens that the kernels know."""
    return spec.interior.r0_mm if spec.interior is not None and spec.model == COMPILED else spec.zero_radius_mm


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
    S, D = len(stations), len(network.devices)
    if not stations:
        raise AdjustmentError(
            "the network", f"no station sees {LEAST_POINTS} points in both coordinates", "add image points"
        )
    problem = _single_problem(network, stations)
    interior = problem.interior_known
    one, zero = np.array([np.eye(3)] * D), np.zeros((D, 3))
    state = State(interior, one, zero, np.zeros((S, 3, 3)), np.zeros((S, 3)), problem.approximate)
    candidates = [
        replace(state, pose_rotation=R, pose_shift=t) for R, t in _candidates(network, problem, state, stations)
    ]
    best = np.full(S, np.inf)
    for _ in range(ROUNDS):
        changed = False
        for k, candidate in enumerate(candidates):
            candidates[k], sums = refined(problem, replace(candidate, interior=state.interior))
            better = sums < 0.99 * best
            changed |= bool(better.any())
            state = replace(
                state,
                pose_rotation=np.where(better[:, None, None], candidates[k].pose_rotation, state.pose_rotation),
                pose_shift=np.where(better[:, None], candidates[k].pose_shift, state.pose_shift),
            )
            best = np.where(better, sums, best)
        if not changed:
            break
        state = _improved_together(problem, state, interior)
        best = robust_factors(problem, misclosures(problem, state))[1]
    return state


def tangents_of(problem: Problem, state: State) -> Array:
    """Tangents ``-X/Z, -Y/Z`` (m, 2) of all observations; without distortion where that cannot be inverted."""
    at = (problem.uv - problem.raster[problem.device, 2:]) * problem.raster[problem.device, :2] * [1, -1]
    tangents = np.zeros_like(at)
    for d in distinct(problem.device):
        own, interior = problem.device == d, interior_of(problem, state, int(d))
        plain = at[own] - [interior.x0_mm, interior.y0_mm]
        straight = undistort(interior, at[own])
        tangents[own] = np.where(np.isfinite(straight), straight, plain) / interior.c_mm
    return tangents


def _candidates(network: Network, problem: Problem, state: State, stations: list[int]) -> list[tuple[Array, Array]]:
    """Resections of every station with the lenses of a state: a few sets of poses."""
    seen = np.all(problem.root_weight > 0, axis=1)
    tangents = tangents_of(problem, state)
    lists = []
    for k in range(problem.poses):
        rows = np.arange(problem.first[k], problem.first[k + 1])
        rows = rows[seen[rows]]
        enough = len(rows) >= LEAST_POINTS
        poses = resect_despite_errors(problem.approximate[problem.point[rows]], tangents[rows]) if enough else []
        if not poses:
            raise NoPoseError(
                f"station {network.station_names[stations[k]]}",
                f"no pose explains its {len(rows)} points",
                "check their identities, the axis directions and the nominal focal length, or leave the station out",
            )
        lists.append(poses)
    count = max(len(poses) for poses in lists)
    chosen = [[poses[min(k, len(poses) - 1)] for poses in lists] for k in range(count)]
    return [(np.array([p.rotation for p in row]), np.array([p.translation_mm for p in row])) for row in chosen]


def _in_front(problem: Problem, state: State) -> Problem:
    """Leave out the observations of points that lie behind a device."""
    keep = np.isfinite(misclosures(problem, state)).all(axis=1)
    if keep.all():
        return problem
    arrays = {name: getattr(problem, name)[keep] for name in ("device", "pose", "point", "order", "uv", "root_weight")}
    first = np.searchsorted(arrays["pose"], np.arange(problem.poses + 1))
    return replace(problem, **arrays, first=first.astype(np.int64))


def _improved_together(problem: Problem, state: State, nominal: Array, iterations: int = 15) -> State:
    """Poses and main interior parameters improved together, wrong points softened, weak parameters kept near nominal.

    The misfit is mostly the points' approximation, which is alike for neighbouring points: a pose counts like
    `INDEPENDENT` observations of that misfit against the nominal values with sigmas `PRIOR`.
    """
    if problem.globals == 0:
        return refined(problem, state)[0]
    problem = _in_front(problem, state)
    # radial: its displacement at the edge of the image, as a share of that radius
    radius = np.hypot(problem.raster[:, 0] * problem.raster[:, 2], problem.raster[:, 1] * problem.raster[:, 3])
    sigma = np.full_like(nominal, np.inf)
    sigma[:, 0], sigma[:, 1:3], sigma[:, 3] = PRIOR * nominal[:, 0], PRIOR * radius[:, None], PRIOR / radius**2
    places, free = problem.columns[:, RELATIVE:], problem.columns[:, RELATIVE:] >= 0
    damping = 1e-3
    for _ in range(iterations):
        w = misclosures(problem, state)
        factor = robust_factors(problem, w)[0]
        soft, cost = reweighted(problem, factor), float(np.sum((factor * w) ** 2))
        weight = (cost / (INDEPENDENT * problem.poses) / sigma**2)[free]
        try:
            normals = assemble(soft, state, damping)
            normals.M[places[free], places[free]] += weight
            normals.diagonal[places[free]] += weight
            for right in (normals.right, normals.b):
                right[places[free]] += weight * (nominal - state.interior)[free]
            step = reduce(soft, state, damping, normals).solve(soft)
        except SingularNormalsError:
            damping *= 100
            continue
        trial = moved(soft, state, step)
        before, after = (
            squares + float(np.sum(weight * (nominal - s.interior)[free] ** 2))
            for squares, s in ((cost, state), (cost_of(soft, trial), trial))
        )
        if after < before:
            state, damping = trial, damping / 10
            if step.gain < SETTLED * before:
                break
        elif step.gain < STALLED * before:
            break
        else:
            damping *= 10
    return state
