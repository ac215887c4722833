"""The adjustment's own view of a network: index arrays and unknowns, in the order the kernels want them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.geometry import LENSES, estimated, lens_of, nominal
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Ints, Network, NetworkScale

MOST_REDUCED = 3000  # unknowns of points that are kept whole; more are eliminated if there are fewer of the poses
COMPILED = "A1..A6"  # the lens model that the kernels know; any other is worked out before they run
RELATIVE = 6  # columns of a relative orientation, before those of the interior
ALONG = {"u": 3, "v": 4}  # of these, the place along the axis of an image coordinate
HELD_MM = 1e-6  # sigma of what is held: far below anything observed, far above the rounding of the normals


class Observed(NamedTuple):
    """Arrays of a `Problem` as the kernels take them."""

    device: Ints
    pose: Ints
    point: Ints
    uv: Array
    root_weight: Array
    raster: Array
    r0: Array
    other: NDArray[np.bool_]


@dataclass(frozen=True)
class Problem:
    """What stays the same while the unknowns move.

    Observations are sorted by what the normal equations eliminate, the poses, or the points where these are many, and
    within each by device.
    """

    device_names: tuple[str, ...]
    #: device, pose, point: (m,): whose observation, at which pose, of which point
    device: Ints
    pose: Ints
    point: Ints
    order: Ints  #: (m,): position of each observation in the network
    #: uv, root_weight: (m, 2): pixels, and 1 / sigma: 0 where not observed
    uv: Array
    root_weight: Array
    raster: Array  #: (devices, 4): pitch x, y (mm) and the pixel coordinates u, v of the middle of the image
    r0: Array  #: (devices,): zero crossing of the radial parameters, mm
    specs: tuple[DeviceSpec, ...]
    models: tuple[str, ...]  #: lens model of each device; K is the number of parameters of the largest
    #: (devices, 6 + K): where each device's six relative and its interior parameters stand among the global unknowns;
    #: -1 if held
    columns: Ints
    #: (devices,): the device whose frame each device's relative orientation refers to (itself where it has none)
    base: Ints
    by_points: bool  #: whether the points are eliminated, not the poses
    first: Ints  #: (eliminated + 1,): where the observations of each pose (or point) begin
    station_pose: Ints  #: (stations,)
    station_device: Ints
    #: (3,): taken off all object coordinates while adjusting, so that large coordinates cost no digits
    origin_mm: Array
    approximate: Array  #: (n, 3): approximate points less the origin: the datum
    distances: tuple[NetworkScale, ...]
    point_weight: Array  #: (n, 3): 1 / sigma² of coordinates known before, 0 where not
    #: interior_known, interior_weight: (devices, K): interior orientation known before and 1 / sigma² of it, 0 where
    #: not
    interior_known: Array
    interior_weight: Array
    #: (poses,): which component of a pose, of its six, is held where it stands, -1 for none: see `_held_places`
    held_places: Ints
    points_free: bool = True  #: false holds the points where they are

    @property
    def observed(self) -> Observed:
        """For the kernels."""
        return Observed(self.device, self.pose, self.point, self.uv, self.root_weight, self.raster, self.r0, self.other)

    @property
    def other(self) -> NDArray[np.bool_]:
        """Devices whose lens the kernels do not know, shape (devices,)."""
        return np.array([model != COMPILED for model in self.models])

    @property
    def interior_columns(self) -> list[Ints]:
        """Of every device the places of its interior parameters among the globals, shape (k,) each; -1 if held."""
        sizes = [len(LENSES[model].names) for model in self.models]
        return [c[RELATIVE : RELATIVE + k] for c, k in zip(self.columns, sizes, strict=True)]

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
    def free_movements(self) -> Array:
        """Combinations of three shifts, three turns and the change of scale that nothing observed or known rules out.

        Shape (7, defect); turns and scale are about the mean of the points.
        """
        if not self.points_free:
            return np.zeros((7, 0))
        if not self.point_weight.any():
            return np.eye(7)[:, : 6 if self.distances else 7]
        local = self.approximate - self.approximate.mean(axis=0)
        size = max(float(np.abs(local).max()), 1e-12)
        fixed = movements(local / size)[self.point_weight.ravel() > 0]
        if self.distances:
            fixed = np.vstack([fixed, np.eye(7)[6:]])
        values, rows = np.linalg.svd(np.vstack([fixed, np.zeros((7, 7))]), full_matrices=False)[1:]
        free = rows[values <= 1e-9 * values[0]].T
        free[3:] /= size  # turns and scale were of points of size one
        return np.asarray(free)

    @property
    def defect(self) -> int:
        """Datum directions the observations leave free."""
        return self.free_movements.shape[1]

    @property
    def redundancy(self) -> int:
        """Observed values less unknowns, datum constraints counted."""
        observed = int(np.count_nonzero(self.root_weight)) + len(self.distances)
        if self.points_free:
            observed += int(np.count_nonzero(self.point_weight))
        observed += sum(
            int(np.count_nonzero((places >= 0) & (weight[: len(places)] > 0)))
            for places, weight in zip(self.interior_columns, self.interior_weight, strict=True)
        )
        poses = 6 * self.poses - int(np.count_nonzero(self.held_places >= 0))
        return observed + self.defect - self.globals - poses - 3 * self.points


def movements(xyz: Array) -> Array:
    """Three shifts, three turns, one change of scale about the origin, as columns, shape (3n, 7)."""
    H = np.zeros((len(xyz), 3, 7))
    H[:, :, :3] = np.eye(3)
    x, y, z = xyz.T
    H[:, 1, 3], H[:, 2, 3] = -z, y
    H[:, 0, 4], H[:, 2, 4] = z, -x
    H[:, 0, 5], H[:, 1, 5] = -y, x
    H[:, :, 6] = xyz
    return H.reshape(-1, 7)


def never_observed(network: Network) -> dict[str, str]:
    """Devices of which one coordinate was observed nowhere, with that coordinate, "u" or "v"."""
    seen = np.isfinite(network.observation_uv)
    result = {}
    for name, made in network.made_by.items():
        own = seen[made]
        if len(own) and not own.any(axis=0).all():
            result[name] = "v" if own[:, 0].any() else "u"
    return result


def problem_of(network: Network, *, by_points: bool | None = None) -> Problem:
    """Number a network's unknowns and sort its observations by what is to be eliminated.

    Devices without stations are held. Poses are eliminated while the system of the points that remains is small: it
    then grows with the board, not with the experiment. `by_points` decides otherwise; the results are the same.
    """
    names = tuple(network.devices)
    number = {name: k for k, name in enumerate(names)}
    station_device = np.array([number[d] for d in network.station_device], dtype=np.int64)
    _, station_pose = np.unique(np.array(network.station_pose), return_inverse=True)
    base = np.array([number[b] for b in network.bases.values()], dtype=np.int64)
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
    known, weight = _known_interior(network)
    return Problem(
        device_names=names,
        device=device[order],
        pose=pose[order],
        point=network.observation_point[order].astype(np.int64),
        order=order,
        uv=np.nan_to_num(network.observation_uv, nan=0.0)[order],
        root_weight=(1.0 / sigma)[order],
        raster=np.array([[*s.pitch_mm, (s.width - 1) / 2, (s.height - 1) / 2] for s in specs]),
        r0=np.array([nominal(s).r0_mm for s in specs]),
        specs=tuple(specs),
        models=tuple(s.model for s in specs),
        columns=columns,
        base=base,
        by_points=by_points,
        first=np.searchsorted(group[order], np.arange(count + 1)).astype(np.int64),
        station_pose=station_pose.astype(np.int64),
        station_device=station_device,
        origin_mm=origin,
        approximate=network.point_xyz_mm - origin,
        distances=(*((network.scale,) if network.scale is not None else ()), *network.lengths),
        point_weight=_point_weight(network),
        interior_known=known,
        interior_weight=weight,
        held_places=_held_places(network, station_pose),
    )


def _held_places(network: Network, station_pose: Ints) -> Ints:
    """Hold the places of devices along the axis of a coordinate never observed, where their stations stand alone.

    Nothing tells them, but distortion, and that from one image hardly: what all images tell together is for a rig, in
    which other devices give the poses. Shape (poses,).
    """
    held = np.full(int(station_pose.max()) + 1, -1, dtype=np.int64)
    lost = never_observed(network)
    if len(lost) == len({*network.station_device}):
        return held
    for pose, device in zip(station_pose.tolist(), network.station_device, strict=True):
        held[pose] = ALONG[lost[device]] if device in lost and not network.devices[device].along else -2
    alone = np.bincount(station_pose) == 1
    return np.where(alone, np.maximum(held, -1), -1)


def _point_weight(network: Network) -> Array:
    if network.point_sigma_mm is None:
        return np.zeros(network.point_xyz_mm.shape)
    return np.asarray(np.maximum(network.point_sigma_mm, HELD_MM) ** -2.0)


def _known_interior(network: Network) -> tuple[Array, Array]:
    """Values known before, and 1 / sigma² of them, shape (devices, K); a weight of 0 where not known, or held."""
    specs = [device.spec for device in network.devices.values()]
    known = np.zeros((len(specs), most_parameters(network)))
    weight = np.zeros(known.shape)
    for d, spec in enumerate(specs):
        start = nominal(spec).vector
        known[d, : len(start)] = start
        if spec.interior_sigma:
            sigma = np.array(spec.interior_sigma)
            weight[d, : len(sigma)] = np.where(sigma > 0, np.maximum(sigma, 1e-150) ** -2.0, 0.0)
    return known, weight


def most_parameters(network: Network) -> int:
    """K: the number of interior parameters of the device that has most."""
    return max(len(lens_of(device.spec).names) for device in network.devices.values())


def _columns(network: Network, base: Ints, used: set[int]) -> Ints:
    """Places of every device's unknowns among the globals: all interior orientations, then the relative ones."""
    columns = np.full((len(network.devices), RELATIVE + most_parameters(network)), -1, dtype=np.int64)
    wanted = np.zeros(columns.shape, bool)
    for d, device in enumerate(network.devices.values()):
        if d in used:
            names, free = lens_of(device.spec).names, estimated(device)
            wanted[d, RELATIVE : RELATIVE + len(names)] = [name in free for name in names]
            wanted[d, :RELATIVE] = base[d] != d
    for name, coordinate in never_observed(network).items():
        # the projection centre along the axis of a coordinate never observed
        wanted[list(network.devices).index(name), ALONG[coordinate]] &= network.devices[name].along
    for part in (slice(RELATIVE, None), slice(0, RELATIVE)):
        places = columns[:, part]
        places[wanted[:, part]] = columns.max() + 1 + np.arange(np.count_nonzero(wanted[:, part]))
    return columns


def reweighted(problem: Problem, factor: Array) -> Problem:
    """Divide every observation's sigma by a factor, shape (m, 2) or (m, 1)."""
    return replace(problem, root_weight=problem.root_weight * factor)


def by_fewest(problem: Problem) -> Problem:
    """The same problem, of which the points are eliminated where they have more unknowns than the poses."""
    if problem.by_points or 3 * problem.points <= 6 * problem.poses:
        return problem
    order = np.lexsort((problem.device, problem.point))
    point = problem.point[order]
    return replace(
        problem,
        device=problem.device[order],
        pose=problem.pose[order],
        point=point,
        order=problem.order[order],
        uv=problem.uv[order],
        root_weight=problem.root_weight[order],
        by_points=True,
        first=np.searchsorted(point, np.arange(problem.points + 1)).astype(np.int64),
    )


def weighted_problem(network: Network, factors: Mapping[str, float]) -> Problem:
    """Give the problem of a network with every device's variances multiplied by its factor."""
    problem = problem_of(network)
    roots = np.array([factors[name] for name in problem.device_names]) ** -0.5
    return reweighted(problem, roots[problem.device][:, None])
