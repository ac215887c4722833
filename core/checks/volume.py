"""How well a calibration knows the working volume, and by how much two calibrations differ in it.

The volume is a grid of camera pixels at some depths, where the projector lights it. Every parameter of a calibration
that is off by one sigma, in the directions in which they are independent, moves all points at once: such fields add up
to covariances. What is left of them after the best movement of all points as one is what bends shapes; where the rig
stands is nobody's concern.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from core.checks.plates import intersect_targets
from core.digits import fixed
from core.errors import InputError
from core.geometry import held_axes, pair_of, perturbed, project, ray_directions
from core.lazy import dataclass
from core.model import AdjustedDevice, Adjustment, Array, Concern, Interior, Pair, PhotogrammetricCalibration
from core.numerics import chi_square_limit, quantile_of

GRID = 13  # nodes along the image's longer side
DEPTHS = 5
USUAL = 0.02, 0.98  # quantiles of the targets' depths: the volume
LEVEL = 0.001  # chance that equal calibrations are found to differ
DEEPER, LEAST_PARALLAX = 1e-4, 0.03  # a share of the depth; rad between rays of camera and projector, rigs have 0.2
LEAST_MODE = 1e-3  # of the strongest: weaker directions are less sure than the linear model


@dataclass(frozen=True)
class Volume:
    """Nodes (n): pixels, projector lines and points of a calibration; `place` (n, 3) counts depth, row and column."""

    uv: Array
    lines: Array
    xyz_mm: Array
    place: Array
    shape: tuple[int, int, int]

    def grid(self, values: Array) -> Array:
        """Lay values of the nodes, shape (n, ...), into the grid; NaN where the projector lights nothing."""
        out = np.full((*self.shape, *values.shape[1:]), np.nan)
        out[tuple(self.place.T)] = values
        return out


def working_depths(pair: Pair, adjustment: Adjustment | None, camera: str) -> Array:
    """Depths at which the targets of a calibration were seen; without them about where both devices' axes meet."""
    if adjustment is not None and len(at := _seen(adjustment, camera)):
        nearest, farthest = (quantile_of(-at[:, 2], share) for share in USUAL)
        return np.linspace(nearest, farthest, DEPTHS)
    pose = pair.projector_from_camera
    ends = np.array([[0.0, 0.0, -1.0], -pose.rotation[2]]).T
    along = np.linalg.lstsq(ends * [1.0, -1.0], pose.inverse().translation_mm, rcond=None)[0][0]
    middle = along if along > 0 else 10 * float(np.linalg.norm(pose.translation_mm))
    return np.asarray(middle * np.linspace(0.9, 1.1, DEPTHS))


def depthless_concerns(calibration: PhotogrammetricCalibration, adjustment: Adjustment) -> list[Concern]:
    """Find projectors of which one coordinate alone was observed, and the one that hardly changes with depth."""
    concerns, cameras = [], calibration.cameras
    for name in calibration.projectors if len(cameras) == 1 else ():  # cameras do without
        pair, xyz = pair_of(calibration, cameras[0], name), _seen(adjustment, cameras[0])
        pose, spec = pair.projector_from_camera, pair.projector.spec
        held = held_axes(pose, np.diagonal(pair.covariance)[-6:])
        if len(held) != 1 or held[0] == "z" or not len(xyz):
            continue
        k = 1 - "xy".index(held[0])
        ends = [project(spec, pair.projector.interior, xyz * s, pose)[:, k] for s in (1 - DEEPER, 1 + DEEPER)]
        parallax = np.diff(ends, axis=0) / (2 * DEEPER) * spec.pitch_mm[k] / pair.projector.interior.c_mm
        if float(np.sqrt(np.mean(parallax**2))) < LEAST_PARALLAX:
            text = (
                f"{name}: {'uv'[k]} alone was observed, which hardly changes with depth on this rig: no points follow "
                f"from it, and how far camera and projector are apart stays unknown; capture with patterns along "
                f"{held[0]}"
            )
            concerns.append(Concern("failed", text))
    return concerns


def _seen(adjustment: Adjustment, camera: str) -> Array:
    """Targets as a camera saw them, (n, 3), in its frame, those of all stations."""
    network = adjustment.network
    own = [s for s, name in enumerate(network.station_device) if name == camera]
    seen = [network.observation_point[network.observation_station == s] for s in own]
    at = [adjustment.station_from_object[s].apply(adjustment.points_mm[p]) for s, p in zip(own, seen, strict=True)]
    return np.concatenate(at) if at else np.zeros((0, 3))


def volume_of(pair: Pair, depths_mm: Array) -> Volume:
    """Make the nodes of a calibration's volume; InputError if the projector lights nothing the camera sees there."""
    spec, lit = pair.camera.spec, pair.projector.spec
    step = max(spec.width, spec.height) / GRID
    rows, columns = (max(round(side / step), 2) for side in (spec.height, spec.width))
    d, r, c = (a.ravel() for a in np.mgrid[: len(depths_mm), :rows, :columns])
    uv = np.stack([(c + 0.5) * spec.width / columns - 0.5, (r + 0.5) * spec.height / rows - 0.5], axis=1)
    xyz = ray_directions(spec, pair.camera.interior, uv) * depths_mm[d][:, None]
    lines = project(lit, pair.projector.interior, xyz, pair.projector_from_camera)
    use = np.all((lines > -0.5) & (lines < [lit.width - 0.5, lit.height - 0.5]), axis=1)
    if np.count_nonzero(use) < 3:
        near, far = fixed(depths_mm[0], 0), fixed(depths_mm[-1], 0)
        seen = f"the projector lights nothing that the camera sees {near} to {far} mm away"
        raise InputError("the working volume", seen, "check that camera and projector belong to one rig")
    place = np.stack([d, r, c], axis=1)[use]
    return Volume(uv[use], lines[use], xyz[use], place, (len(depths_mm), rows, columns))


def point_fields(pair: Pair, volume: Volume) -> Array:
    """Move the points that a calibration gives by its independent errors of one sigma each, shape (k, n, 3), mm."""
    return _fields(pair, volume.uv, volume.lines)


def fields_at(pair: Pair, uv: Array, xyz_mm: Array) -> Array:
    """Move points (n, 3) of camera pixels (n, 2) by independent errors of a calibration, one sigma each: (k, n, 3)."""
    return _fields(pair, uv, project(pair.projector.spec, pair.projector.interior, xyz_mm, pair.projector_from_camera))


def _fields(pair: Pair, uv: Array, lines: Array) -> Array:
    sigma = np.ones(lines.shape)
    start = intersect_targets(pair, uv, lines, sigma)[0]
    moved = [
        intersect_targets(perturbed(pair, e), uv, lines, sigma, start)[0] for e in independent_errors(pair.covariance)
    ]
    return np.reshape(moved, (-1, *start.shape)) - start


def image_fields(device: AdjustedDevice, covariance: Array, xyz_mm: Array) -> Array:
    """Move the image of points in the device's frame by the independent errors of its interior, shape (k, n, 2), px.

    What another place of the device would do as well is taken off: no calibration tells them apart.
    """
    vector, r0, model = device.interior.vector, device.interior.r0_mm, device.interior.model
    start = project(device.spec, device.interior, xyz_mm)
    moved = [
        project(device.spec, Interior.from_vector(vector + e, r0, model), xyz_mm) - start
        for e in independent_errors(covariance)
    ]
    size = 1e-4 * float(np.abs(xyz_mm[:, 2]).mean())
    stepped = [project(device.spec, device.interior, xyz_mm + size * m) - start for m in _movements(xyz_mm)]
    return _without(np.reshape(moved, (-1, *start.shape)), np.array(stepped))


def bend_of_plane(fields: Array, xyz_mm: Array, normal: Array) -> float:
    """By how much errors of a calibration, as fields (k, n, 3), bend a plane through points (n, 3), mm r.m.s.

    Where the plane stands and how it is tilted is no matter of its form. Points that rays miss, NaN, do not count.
    """
    met = np.isfinite(xyz_mm).all(axis=1) & np.isfinite(fields).all(axis=(0, 2))
    fields, xyz_mm = fields[:, met], xyz_mm[met]
    if not fields.size:
        return 0.0
    A = np.column_stack([np.ones(len(xyz_mm)), xyz_mm - xyz_mm.mean(axis=0)])
    moved = fields @ normal
    rest = moved - moved @ np.linalg.pinv(A, rcond=1e-9).T @ A.T
    return float(np.sqrt(np.mean(np.sum(rest**2, axis=0))))


def form_of_fields(fields: Array, xyz_mm: Array) -> Array:
    """Take the best movement of all points as one off each field, shape (k, n, 3)."""
    return _without(fields, _movements(xyz_mm))


def sigmas_of(fields: Array) -> Array:
    """Add fields, shape (k, n, d), up to sigmas of whole displacements, shape (n,)."""
    return np.asarray(np.sqrt(np.sum(fields**2, axis=(0, 2))))


@dataclass(frozen=True)
class Difference:
    """What a second calibration makes of a volume that a first one has, its sigmas of both as if independent.

    `shift_mm` (n, 3) of every node, and `form_mm` (n, 3), what the best movement leaves of it; `sigma_mm` and
    `form_sigma_mm` (n,) of their lengths. `statistic` is chi-square distributed with `dof` degrees of freedom where the
    calibrations differ by chance, and above `limit` once in a thousand times; None where neither has sigmas.
    """

    volume: Volume
    shift_mm: Array
    form_mm: Array
    sigma_mm: Array
    form_sigma_mm: Array
    statistic: float | None
    dof: int
    limit: float | None

    @property
    def significant(self) -> bool | None:
        """Whether the calibrations differ by more than chance."""
        return None if self.statistic is None or self.limit is None else self.statistic > self.limit


def difference(first: Pair, second: Pair, depths_mm: Array) -> Difference:
    """Intersect what the first calibration sees of a volume by the second one."""
    volume = volume_of(first, depths_mm)
    shift = intersect_targets(second, volume.uv, volume.lines, np.ones(volume.lines.shape))[0] - volume.xyz_mm
    sound = np.isfinite(shift).all(axis=1)
    volume = replace(volume, **{n: getattr(volume, n)[sound] for n in ("uv", "lines", "xyz_mm", "place")})
    shift = shift[sound]
    fields = np.concatenate([point_fields(pair, volume) for pair in (first, second)])
    form = form_of_fields(np.concatenate([shift[None], fields]), volume.xyz_mm)
    statistic, dof = None, 0
    if len(fields):
        _, strength, modes = np.linalg.svd(fields.reshape(len(fields), -1), full_matrices=False)
        use = strength > LEAST_MODE * strength[0]
        statistic, dof = float(np.sum((modes[use] @ shift.ravel() / strength[use]) ** 2)), int(use.sum())
    limit = chi_square_limit(dof, LEVEL) if dof else None
    return Difference(volume, shift, form[0], sigmas_of(fields), sigmas_of(form[1:]), statistic, dof, limit)


def independent_errors(covariance: Array) -> Iterator[Array]:
    """Give the independent errors of one sigma each, shape (k,), of a covariance."""
    scale = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    unit = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    for value, vector in zip(values, vectors.T, strict=True):
        if value > 1e-14 * max(float(values[-1]), 0.0):
            yield np.sqrt(value) * vector * scale


def _movements(xyz_mm: Array) -> Array:
    """Three shifts and three turns, shape (6, n, 3), of about one unit each."""
    local = (xyz_mm - xyz_mm.mean(axis=0)) / np.ptp(xyz_mm, axis=0).max()
    shifts = np.broadcast_to(np.eye(3)[:, None], (3, *xyz_mm.shape))
    return np.concatenate([shifts, np.cross(np.eye(3)[:, None], local[None])])


def _without(fields: Array, basis: Array) -> Array:
    """Project fields, shape (k, n, d), off what a basis, shape (j, n, d), spans."""
    H, flat = basis.reshape(len(basis), -1).T, fields.reshape(len(fields), basis[0].size).T  # of none, too
    return np.asarray((flat - H @ np.linalg.lstsq(H, flat, rcond=None)[0]).T.reshape(fields.shape))
