"""The adjustment's own view of a network: index arrays and unknowns, in the order the kernels want them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.geometry import Pose, matrix_from_rotation_vector
from core.model import INTERIOR_NAMES, Network, NetworkScale

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


MOST_REDUCED = 3000  # unknowns of points that are kept whole; more are eliminated if there are fewer of the poses


class Observed(NamedTuple):
    """Arrays of a `Problem` as the kernels take them."""

    device: Ints
    pose: Ints
    point: Ints
    uv: Array
    root_weight: Array
    raster: Array
    r0: Array


class Unknowns(NamedTuple):
    """Arrays of a `State` as the kernels take them."""

    interior: Array
    relative_rotation: Array
    relative_shift: Array
    pose_rotation: Array
    pose_shift: Array
    xyz: Array


@dataclass(frozen=True)
class Problem:
    """What stays the same while the unknowns move.

    Observations are sorted by what the normal equations eliminate, the poses, or the points where these are many, and
    within each by device.

    Attributes
    ----------
    device_names : tuple of str
    device, pose, point : arrays, shape (m,)
        Whose observation, at which pose, of which point.
    order : array, shape (m,)
        Position of each observation in the network.
    uv, root_weight : arrays, shape (m, 2)
        Pixels, and 1 / sigma: 0 where not observed.
    raster : array, shape (devices, 4)
        Pitch x, y (mm) and the pixel coordinates u, v of the middle of the image.
    r0 : array, shape (devices,)
        Zero crossing of the radial parameters, mm.
    columns : array, shape (devices, 15)
        Where each device's nine interior and six relative parameters stand among the global unknowns; -1 if held.
    base : array, shape (devices,)
        The device whose frame each device's relative orientation refers to (itself where it has none).
    by_points : bool
        Whether the points are eliminated, not the poses.
    first : array, shape (eliminated + 1,)
        Where the observations of each pose (or point) begin.
    station_pose : array, shape (stations,)
    origin_mm : array, shape (3,)
        Taken off all object coordinates while adjusting, so that large coordinates cost no digits.
    approximate : array, shape (n, 3)
        Approximate points less the origin: the datum.
    points_free : bool
        False holds the points where they are.
    """

    device_names: tuple[str, ...]
    device: Ints
    pose: Ints
    point: Ints
    order: Ints
    uv: Array
    root_weight: Array
    raster: Array
    r0: Array
    columns: Ints
    base: Ints
    by_points: bool
    first: Ints
    station_pose: Ints
    station_device: Ints
    origin_mm: Array
    approximate: Array
    scale: NetworkScale | None
    points_free: bool = True

    @property
    def observed(self) -> Observed:
        """For the kernels."""
        return Observed(self.device, self.pose, self.point, self.uv, self.root_weight, self.raster, self.r0)

    @property
    def poses(self) -> int:
        """Number of poses."""
        return int(self.station_pose.max()) + 1

    @property
    def globals(self) -> int:
        """Number of interior and relative orientation parameters estimated."""
        return int(self.columns.max(initial=-1)) + 1

    @property
    def points(self) -> int:
        """Number of points adjusted, 0 where they are held."""
        return len(self.approximate) if self.points_free else 0

    @property
    def defect(self) -> int:
        """Datum directions the observations leave free."""
        return 0 if not self.points_free else 6 if self.scale is not None else 7

    @property
    def redundancy(self) -> int:
        """Observed values less unknowns, datum constraints counted."""
        observed = int(np.count_nonzero(self.root_weight)) + (self.scale is not None)
        return observed + self.defect - self.globals - 6 * self.poses - 3 * self.points


@dataclass(frozen=True)
class State:
    """The unknowns: interior (D, 9), relative orientations, poses and points less the problem's origin."""

    interior: Array
    relative_rotation: Array
    relative_shift: Array
    pose_rotation: Array
    pose_shift: Array
    xyz: Array

    @property
    def unknowns(self) -> Unknowns:
        """For the kernels."""
        return Unknowns(*(np.ascontiguousarray(array) for array in vars(self).values()))


@dataclass(frozen=True)
class Step:
    """A change of the unknowns, and the decrease of vᵀPv the linear model promises for it."""

    z: Array  # (globals,)
    pose: Array  # (poses, 6)
    xyz: Array  # (points, 3)
    gain: float


def never_observed(network: Network) -> dict[str, str]:
    """Devices of which one coordinate was observed nowhere, with that coordinate, "u" or "v"."""
    seen = np.isfinite(network.observation_uv)
    owner = np.array(network.station_device)[network.observation_station]
    result = {}
    for name in network.devices:
        own = seen[owner == name]
        if len(own) and not own.any(axis=0).all():
            result[name] = "v" if own[:, 0].any() else "u"
    return result


def base_devices(network: Network) -> dict[str, str]:
    """Give for each device the device it is held rigidly to: the first of those it shares poses with, or itself."""
    base = {name: name for name in network.devices}
    rank = {name: k for k, name in enumerate(network.devices)}
    together: dict[int, set[str]] = {}
    for device, pose in zip(network.station_device, network.station_pose, strict=True):
        together.setdefault(pose, set()).add(device)
    for group in together.values():
        merged = {base[name] for name in group}
        chief = min(merged, key=rank.__getitem__)
        base = {name: chief if b in merged else b for name, b in base.items()}
    return base


def problem_of(network: Network, *, by_points: bool | None = None) -> Problem:
    """Number a network's unknowns and sort its observations by what is to be eliminated.

    Parameters
    ----------
    network : Network
    by_points : bool or None
        Eliminate the points, not the poses; None decides by their numbers. The results are the same.

    Notes
    -----
    Poses are eliminated while the system of the points that remains is small: it then grows with the board, not with
    the experiment. Devices without stations are held.
    """
    names = tuple(network.devices)
    number = {name: k for k, name in enumerate(names)}
    station_device = np.array([number[d] for d in network.station_device], dtype=np.int64)
    _, station_pose = np.unique(np.array(network.station_pose), return_inverse=True)
    base = np.array([number[b] for b in base_devices(network).values()], dtype=np.int64)
    columns = _columns(network, base, set(station_device.tolist()))
    pose = station_pose[network.observation_station].astype(np.int64)
    groups, others = len(set(network.station_pose)), 3 * len(network.point_names)
    if by_points is None:
        by_points = others > MOST_REDUCED and others > 6 * groups
    device = station_device[network.observation_station]
    group = network.observation_point if by_points else pose
    order = np.lexsort((device, group))
    count = len(network.point_names) if by_points else groups
    origin = network.point_xyz_mm.mean(axis=0)
    sigma = np.where(np.isfinite(network.observation_uv), network.observation_sigma, np.inf)
    specs = [network.devices[name].spec for name in names]
    return Problem(
        device_names=names,
        device=device[order],
        pose=pose[order],
        point=network.observation_point[order].astype(np.int64),
        order=order,
        uv=np.nan_to_num(network.observation_uv, nan=0.0)[order],
        root_weight=(1.0 / sigma)[order],
        raster=np.array([[*s.pitch_mm, (s.width - 1) / 2, (s.height - 1) / 2] for s in specs]),
        r0=np.array([s.zero_radius_mm for s in specs]),
        columns=columns,
        base=base,
        by_points=by_points,
        first=np.searchsorted(group[order], np.arange(count + 1)).astype(np.int64),
        station_pose=station_pose.astype(np.int64),
        station_device=station_device,
        origin_mm=origin,
        approximate=network.point_xyz_mm - origin,
        scale=network.scale,
    )


def _columns(network: Network, base: Ints, used: set[int]) -> Ints:
    """Places of every device's unknowns among the globals: all interior orientations, then the relative ones."""
    columns = np.full((len(network.devices), 15), -1, dtype=np.int64)
    wanted = np.zeros(columns.shape, bool)
    for d, device in enumerate(network.devices.values()):
        if d in used:
            wanted[d, :9] = [p in device.estimate for p in INTERIOR_NAMES]
            wanted[d, 9:] = base[d] != d
    for name, coordinate in never_observed(network).items():
        # the projection centre along the axis of a coordinate never observed
        wanted[list(network.devices).index(name), 12 if coordinate == "u" else 13] = False
    for part in (slice(0, 9), slice(9, 15)):
        places = columns[:, part]
        places[wanted[:, part]] = columns.max() + 1 + np.arange(np.count_nonzero(wanted[:, part]))
    return columns


def moved(problem: Problem, state: State, step: Step) -> State:
    """Apply a step to the unknowns."""
    interior, relative_rotation, relative_shift = (
        state.interior.copy(),
        state.relative_rotation.copy(),
        state.relative_shift.copy(),
    )
    for d, columns in enumerate(problem.columns):
        free = columns[:9] >= 0
        interior[d, free] += step.z[columns[:9][free]]
        if columns[9] >= 0:
            relative_rotation[d] = matrix_from_rotation_vector(step.z[columns[9:12]]) @ relative_rotation[d]
            relative_shift[d] += np.where(columns[12:15] >= 0, step.z[columns[12:15]], 0.0)
    turns = _matrices(step.pose[:, :3])
    xyz = state.xyz + step.xyz if problem.points_free else state.xyz
    return State(
        interior,
        relative_rotation,
        relative_shift,
        turns @ state.pose_rotation,
        state.pose_shift + step.pose[:, 3:],
        xyz,
    )


def _matrices(vectors: Array) -> Array:
    """Rotation matrices, shape (k, 3, 3), of rotation vectors, shape (k, 3): Rodrigues' formula for many."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    # sin(a)/a and (1 - cos a)/a² through sinc, which knows its limit at 0
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (K @ K)


def reweighted(problem: Problem, factor: Array) -> Problem:
    """Divide every observation's sigma by a factor, shape (m, 2) or (m, 1)."""
    return replace(problem, root_weight=problem.root_weight * factor)


def station_orientations(problem: Problem, state: State) -> tuple[Pose, ...]:
    """``station_from_object`` of every station, in the network's own coordinates."""
    result = []
    for device, pose in zip(problem.station_device, problem.station_pose, strict=True):
        R, t = state.pose_rotation[pose], state.pose_shift[pose]
        base_from_object = Pose(R, t - R @ problem.origin_mm)
        result.append(Pose(state.relative_rotation[device], state.relative_shift[device]) @ base_from_object)
    return tuple(result)
