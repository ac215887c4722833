"""Initial values from the nominal focal lengths and the approximate points alone.

Each station is oriented by itself; the relative orientations of a rigid rig are the median over its poses. A projector
that knows its columns only is resected from all poses of the rig at once. Where some points are known, the places of
the others may be rough: stations are also oriented by the known ones alone, and the others intersected from them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.calibrate.approximate.columns import resect_columns
from core.calibrate.approximate.stations import LEAST_POINTS, in_own_lenses, oriented_stations, resectable, tangents_of
from core.calibrate.selection import Bools, Warnings, known_points
from core.calibrate.solution.equations import misclosures
from core.calibrate.solution.problem import Problem, never_observed, problem_of
from core.calibrate.solution.state import State, interior_of, poses_in_devices
from core.errors import AdjustmentError
from core.geometry import Pose, matrix_from_rotation_vector, rotation_vector_from_matrix, similarity
from core.model import Array, Ints, Network

OTHER_SIZE = 0.2  # of the logarithm of a scale: no board is printed that wrongly
MOST_CONDITION = 1e6  # of a point's normal equations: rays a milliradian apart
MISPLACED = 0.5  # of the object's size: an approximate point so far from where its images intersect may be wrong
ROUNDS = 4  # of orienting and intersecting anew
MOST_NAMED = 5
WRONG = 5.0  # times as far off as others in the middle, an approximate point is wrong, not rough as they are
CONTRADICTED = 10.0  # times the misclosures there that it leaves, if it is
ENOUGH_SAMPLES = 300  # among which the rotation in the middle is sought


def initial_state(network: Network, problem: Problem) -> State:
    """Approximate values of all unknowns of a network.

    AdjustmentError if the pose of a station, or the orientation of a rigid device to its base, cannot be found.
    """
    known = known_points(network)
    if known.all() or not known.any():
        return _oriented(network, problem)
    states: list[State] = []
    failure: AdjustmentError | None = None
    for seen in (network, _of_known_points(network, known)):
        try:
            states.append(_oriented(seen, problem))
        except AdjustmentError as error:
            failure = failure or error
    if failure is not None and not states:
        raise failure
    states += [_intersected(problem, state, known) for state in states]
    return min(states, key=lambda s: float(np.median(_misfits(problem, s))))


def _of_known_points(network: Network, known: NDArray[np.bool_]) -> Network:
    """Keep of stations that see enough known points these alone."""
    told = known[network.observation_point]
    enough = np.bincount(network.observation_station[told], minlength=len(network.station_names)) >= LEAST_POINTS
    use = told | ~enough[network.observation_station]
    return replace(
        network,
        observation_station=network.observation_station[use],
        observation_point=network.observation_point[use],
        observation_uv=network.observation_uv[use],
        observation_sigma=network.observation_sigma[use],
    )


def _intersected(problem: Problem, state: State, known: NDArray[np.bool_]) -> State:
    """Intersect the points that are not known from the oriented stations; poses that fit worse than most count less."""
    R, t = poses_in_devices(problem, state)
    usual = _medians(problem.pose, _misfits(problem, state))
    middle = max(float(np.median(usual)), 1.0)
    seen = (problem.root_weight > 0) * (middle / np.maximum(usual, middle))[problem.pose, None] ** 2
    xyz, sure = intersections(problem.point, tangents_of(problem, state), R, t, seen, len(known))
    return replace(state, xyz=np.where((sure & ~known)[:, None], xyz, state.xyz))


def intersections(point: Ints, tangents: Array, R: Array, t: Array, weight: Array, count: int) -> tuple[Array, Bools]:
    """Intersect a number of points, (n, 3), and say which the rays tell.

    The rays are those of tangents ``-X/Z, -Y/Z`` (m, 2) with weights (m, 2) in devices at poses R (m, 3, 3), t (m, 3):
    ``x Z + c X = 0`` and its twin in y are linear in a point's coordinates.
    """
    rows, right = tangents[:, :, None] * R[:, 2:] + R[:, :2], -(tangents * t[:, 2:] + t[:, :2])
    N, b = np.zeros((count, 3, 3)), np.zeros((count, 3))
    np.add.at(N, point, np.einsum("mk,mki,mkj->mij", weight, rows, rows))
    np.add.at(b, point, np.einsum("mk,mki,mk->mi", weight, rows, right))
    sure = np.asarray(np.isfinite(N).all(axis=(1, 2)) & np.isfinite(b).all(axis=1))
    sure[sure] = np.linalg.cond(N[sure]) < MOST_CONDITION
    xyz = np.zeros((count, 3))
    xyz[sure] = np.linalg.solve(N[sure], b[sure][..., None])[..., 0]
    return xyz, sure


def misplaced(network: Network, problem: Problem, state: State) -> tuple[Network, Problem, State, Warnings]:
    """Put approximate points that their images contradict where these intersect, with a warning that names them.

    They might lie behind a device, where nothing is projected, and would draw stations and datum. What stations they
    drew are oriented again, which may show others. Where all are as rough, the datum stays with what was given.
    """
    given, known, moved = network, known_points(network), np.zeros(len(network.point_names), bool)
    for _ in range(ROUNDS):
        there = _intersected(problem, state, known)
        off = np.linalg.norm(there.xyz - state.xyz, axis=1)
        size = np.median(np.linalg.norm(state.xyz - np.median(state.xyz, axis=0), axis=1))
        wrong = off > MISPLACED * size
        if wrong.any():
            before, after = (_medians(problem.point, _misfits(problem, s)) for s in (state, there))
            wrong &= (before > CONTRADICTED * after) & (after < CONTRADICTED * np.median(np.minimum(before, after)))
        if not wrong.any():
            break
        moved |= wrong
        xyz = np.where(wrong[:, None], there.xyz + problem.origin_mm, network.point_xyz_mm)
        network = replace(network, point_xyz_mm=xyz)
        problem = problem_of(network)
        state = initial_state(network, problem)
    if not moved.any():
        return network, problem, state, []
    moved &= ~_rough(given.point_xyz_mm, _intersected(problem, state, known).xyz, moved)
    network = replace(given, point_xyz_mm=np.where(moved[:, None], network.point_xyz_mm, given.point_xyz_mm))
    begun, problem = problem, problem_of(network)
    state = _moved(state, begun.origin_mm - problem.origin_mm)
    if not moved.any():
        return network, problem, state, []
    names = ", ".join(network.point_names[i] for i in np.flatnonzero(moved)[:MOST_NAMED])
    told = f"the images contradict the approximate coordinates of {np.count_nonzero(moved)} points: {names}"
    return network, problem, state, [f"{told}; they were intersected instead"]


def _rough(given: Array, found: Array, moved: NDArray[np.bool_]) -> Bools:
    """Which approximate points (n, 3) are as rough as the others, by where points were found, and not wrong.

    The datum is theirs too, or it would depend on which of them their images moved.
    """
    if np.count_nonzero(~moved) < LEAST_POINTS:
        return np.zeros(len(moved), bool)
    scale, R, shift = similarity(found[~moved], given[~moved])
    off = np.linalg.norm(scale * found @ R.T + shift - given, axis=1)
    return np.asarray(off < WRONG * np.median(off[~moved]))


def oriented_anew(network: Network, problem: Problem, state: State, lenses: bool = False) -> State:
    """Orient all stations again, on the points of a solution; AdjustmentError if one cannot be oriented on them.

    With `lenses` by its interior orientations as well, which a solution that is lost may have bent to anything.
    """
    there = replace(network, point_xyz_mm=state.xyz + problem.origin_mm)
    if lenses:
        found = {name: interior_of(problem, state, d) for d, name in enumerate(problem.device_names)}
        devices = {n: replace(d, spec=replace(d.spec, interior=found[n])) for n, d in network.devices.items()}
        there = replace(there, devices=devices)
    other = problem_of(there)
    return _moved(initial_state(there, other), other.origin_mm - problem.origin_mm)


def _moved(state: State, shift: Array) -> State:
    """Move a state's points by a shift (3,), and poses with them."""
    return replace(state, pose_shift=state.pose_shift - state.pose_rotation @ shift, xyz=state.xyz + shift)


def _misfits(problem: Problem, state: State) -> Array:
    """Larger misclosure of every observation, shape (m,)."""
    return np.asarray(np.max(np.abs(misclosures(problem, state)), axis=1))


def _medians(group: NDArray[np.int64], misfit: Array) -> Array:
    """Upper median of the misfits of every group, 0 to the last, each of which has some."""
    order = np.lexsort((misfit, group))
    count = np.bincount(group)
    return np.asarray(misfit[order[np.cumsum(count) - count + count // 2]])


def _oriented(network: Network, problem: Problem) -> State:
    """Orient every station by the points that the network's observations see, as they are."""
    stations = resectable(network)
    state = oriented_stations(network, stations)
    found = {s: Pose(state.pose_rotation[k], state.pose_shift[k]) for k, s in enumerate(stations)}
    relative = _relative_orientations(problem, found)
    rotation, shift = np.zeros((problem.poses, 3, 3)), np.full((problem.poses, 3), np.nan)
    # a pose is taken from its base device where that was resected: it is written last
    for s in sorted(found, key=lambda s: problem.station_device[s] == problem.base[problem.station_device[s]]):
        device = problem.station_device[s]
        if device in relative:
            base_from_object = relative[device].inverse() @ found[s]
            rotation[problem.station_pose[s]] = base_from_object.rotation
            shift[problem.station_pose[s]] = base_from_object.translation_mm
    for d in range(len(problem.base)):
        if d not in relative:
            resected = resect_columns(problem, d, state.interior[d], rotation, shift)
            if resected is not None:
                relative[d], state.interior[d] = resected
    lost = np.isnan(shift[problem.station_pose, 0]) | ~np.isin(problem.station_device, list(relative))
    if lost.any():
        station = int(np.argmax(lost))
        unseen = never_observed(network).get(network.station_device[station])
        if unseen and problem.base[problem.station_device[station]] == problem.station_device[station]:
            raise AdjustmentError(
                f"station {network.station_names[station]}",
                f"{unseen} was never observed: without it, no image of a flat field orients a device by itself",
                "adjust the rig as a rigid one, without free stations, or observe both coordinates",
            )
        raise AdjustmentError(
            f"station {network.station_names[station]}",
            "its orientation cannot be found from the approximate points",
            "check the identities of its points and the nominal focal length, or leave the station out",
        )
    R = np.array([relative.get(d, Pose()).rotation for d in range(len(problem.base))])
    t = np.array([relative.get(d, Pose()).translation_mm for d in range(len(problem.base))])
    size = _size(problem)
    return in_own_lenses(
        network, State(state.interior, R, size * t, rotation, size * shift, size * problem.approximate)
    )


def _size(problem: Problem) -> float:
    """Factor by which the approximate points are too small for the measured distance, where it differs by far.

    A distance in other units would draw the two ends towards each other first, and the rest of the network after them.
    """
    if not problem.distances or problem.point_weight.any():
        return 1.0
    first = problem.distances[0]
    apart = float(np.linalg.norm(problem.approximate[first.start] - problem.approximate[first.stop]))
    factor = first.length_mm / apart if apart > 0 else 1.0
    return factor if abs(np.log(factor)) > OTHER_SIZE else 1.0


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
    rotations = np.array([s.rotation for s in samples])
    some = rotations[:: -(-len(samples) // ENOUGH_SAMPLES)]
    # the trace of a relative rotation is 1 + 2 cos of its angle
    turns = np.arccos(np.clip((np.einsum("aij,bij->ab", some, some) - 1) / 2, -1, 1))
    middle = some[int(np.argmin(np.median(turns, axis=1)))]
    vectors = np.array([rotation_vector_from_matrix(R) for R in rotations @ middle.T])
    R = matrix_from_rotation_vector(np.median(vectors, axis=0)) @ middle
    return Pose(R, np.median([s.translation_mm for s in samples], axis=0))
