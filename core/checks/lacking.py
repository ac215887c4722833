"""Terms that were not adjusted, estimated from what the images of one device leave; nothing is adjusted anew.

With poses and points free, and the device's own parameters, what remains of a term's column is orthogonal to all of
them: the residuals' part along it is the term, with its sigma (the score test of Rao, doi:10.1017/S0305004100023987).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from core.geometry import Projection, project_with_derivatives
from core.lazy import dataclass
from core.model import AdjustedDevice, Adjustment, Array, Ints
from core.numerics import distinct

FEWEST, MOST = 50, 800  # redundancy that tells a term; points, and stations, that are worth it
POSE, POSED = 6, 4  # parameters; points that tell them
TINY = 1e-300
RIDGE = 1e-12  # of the mean diagonal: for movements of all points, which poses make, too

# of an image, by its number of so many: projection, points in the object's and in the device's frame; (m, 2, e) px
Terms = Callable[[int, int, Projection, Array, Array], Array]


@dataclass(frozen=True)
class Lacking:
    """What e terms would be, each by itself, beside the k parameters of a device that were estimated."""

    free: Ints  # (k,), of the device's parameters
    stations: Ints  # whose images are looked at, in their order
    images: Array  # (m, 2, k + n): how they change with parameters and the first n terms, px
    rest: Array  # (e + 1, e + 1): normal equations of terms and residuals without all else, of columns of unit length
    made_up: Array  # (k, e): what parameters make of the terms
    unit: Array  # (k + e + 1,), lengths of the columns
    redundancy: int

    def amount(self, term: int) -> float:
        """The term, in its unit."""
        rest, k = self.rest, len(self.free)
        return float(rest[term, -1] / max(rest[term, term], TINY) * self.unit[-1] / self.unit[k + term])

    def sigmas(self, term: int) -> float:
        """The term over its standard deviation by the residuals; of computed images these are rounding alone."""
        variance = float(self.rest[term, term] * self.rest[-1, -1]) / self.redundancy
        return float(self.rest[term, -1] / np.sqrt(max(variance, TINY)))

    def by_parameters(self, term: int) -> Array:
        """What the parameters (k,) take up of one unit of the term, where it is not adjusted."""
        k = len(self.free)
        return np.asarray(self.made_up[:, term] * self.unit[k + term] / self.unit[:k])


def lacking(adjustment: Adjustment, name: str, device: AdjustedDevice, terms: Terms, shown: int) -> Lacking | None:
    """Hold terms against the residuals of a device's images; None if nothing tells.

    Of so many of them, the first ones, it is also `shown` how the images change with them.
    """
    network, free = adjustment.network, np.flatnonzero(device.sigma > 0)
    own, k = np.flatnonzero(network.made_by[name]), len(free)
    of_station = network.observation_station[own]
    stations = [own[of_station == s] for s in distinct(of_station) if np.count_nonzero(of_station == s) >= POSED]
    if not k or not stations or len(stations) > MOST:
        return None
    used = np.concatenate(stations)
    points, count = distinct(network.observation_point[used]), np.count_nonzero(np.isfinite(adjustment.residuals[used]))
    redundancy = int(count) - POSE * len(stations) - 3 * len(points) - k
    if redundancy < FEWEST or len(points) > MOST:
        return None
    equations, images = _equations(adjustment, device, free, stations, points, terms, shown)
    left, unit = _of_others(*equations)
    left /= np.outer(unit, unit)
    made_up = np.linalg.lstsq(left[:k, :k], left[:k, k:], rcond=1e-12)[0]
    rest = left[k:, k:] - left[k:, :k] @ made_up
    numbers = network.observation_station[[some[0] for some in stations]]
    return Lacking(free, numbers, images, rest, np.asarray(made_up[:, :-1], np.float64), unit, redundancy)


def _equations(
    adjustment: Adjustment,
    device: AdjustedDevice,
    free: Ints,
    stations: Sequence[Ints],
    points: Ints,
    terms: Terms,
    shown: int,
) -> tuple[tuple[Array, Array, Array, Array], Array]:
    """Equations of a device's images, as `_of_others` takes them, of parameters, terms and residuals.

    `stations` are the observations of each. Also how the images (m, 2, k + n) change with parameters and terms shown.
    """
    network, size = adjustment.network, 3 * len(points)
    images, of_poses = [], []
    of_points = np.zeros((len(points), 3, 3))
    mixed, of_others = np.zeros((len(points), 3, 0)), np.zeros((0, 0))
    for number, some in enumerate(stations):
        xyz, pose = (
            adjustment.points_mm[network.observation_point[some]],
            adjustment.station_from_object[network.observation_station[some[0]]],
        )
        found = project_with_derivatives(device.spec, device.interior, xyz, pose)
        more = terms(number, len(stations), found, xyz, pose.apply(xyz))
        by_all = np.concatenate([found.by_interior[..., free], more], axis=-1)
        images.append(by_all[..., : len(free) + shown])
        residuals = adjustment.residuals[some]
        weight = np.where(np.isfinite(residuals), 1 / network.observation_sigma[some], 0)[..., None]
        columns = found.by_pose, found.by_point, np.concatenate([by_all, residuals[..., None]], axis=-1)
        by_pose, by_point, by_others = (np.nan_to_num(each * weight) for each in columns)
        width = by_others.shape[2]
        if not number:
            mixed, of_others = np.zeros((len(points), 3, width)), np.zeros((width, width))
        at = np.searchsorted(points, network.observation_point[some])
        of_points[at] += np.einsum("nia,nib->nab", by_point, by_point)
        mixed[at] += by_point.swapaxes(1, 2) @ by_others
        flat = by_others.reshape(-1, width)
        of_others += flat.T @ flat
        Q, of_pose = np.linalg.qr(by_pose.reshape(-1, POSE))[0], np.zeros((POSE, size + width))
        of_pose[:, :size].reshape(POSE, -1, 3)[:, at] = np.einsum("nic,nia->cna", Q.reshape(by_pose.shape), by_point)
        of_pose[:, size:] = Q.T @ flat
        of_poses.append(of_pose)
    return (of_points, mixed, of_others, np.concatenate(of_poses)), np.concatenate(images)


def _of_others(of_points: Array, mixed: Array, of_others: Array, of_poses: Array) -> tuple[Array, Array]:
    """Normal equations (w, w) of all but points and poses, without these; lengths (w,) of columns without poses.

    Normal equations of points (n, 3, 3), of points and others (n, 3, w), and of others (w, w); and what orthonormal
    poses have of points and others, (p, 3 n + w). Whichever are fewer are eliminated as a whole, after the rest.
    """
    size, count = 3 * len(of_points), len(of_poses)
    by_points, by_others = of_poses[:, :size], of_poses[:, size:]
    unit = np.sqrt(np.maximum(np.diagonal(of_others) - np.sum(by_others**2, axis=0), TINY))
    of_points = of_points + RIDGE * (np.einsum("nii->", of_points) - np.sum(by_points**2)) / size * np.eye(3)
    if count < size:
        both = np.concatenate([by_points.T.reshape(-1, 3, count), mixed], axis=2)
        taken = both.reshape(size, -1).T @ np.linalg.solve(of_points, both).reshape(size, -1)
        normal, right = np.eye(count) - taken[:count, :count], by_others - taken[:count, count:]
        of_others = of_others - taken[count:, count:]
    else:
        normal, right = -by_points.T @ by_points, mixed.reshape(size, -1) - by_points.T @ by_others
        row = np.arange(size).reshape(-1, 3)
        normal[row[:, :, None], row[:, None]] += of_points
        of_others = of_others - by_others.T @ by_others
    return np.asarray(of_others - right.T @ np.linalg.solve(normal, right)), unit
