"""The camera's orientation from the targets of the depth plate itself.

The plate's targets are known in the plate's frame, and the plate moves by known amounts along one axis. Adjusted are
the camera's interior orientation, the plate's pose at z = 0 and the direction of the axis. Plates that stay parallel
show some of it poorly (a principal point and a small turn of the camera look nearly alike), so the interior
orientation enters with what is known of it: by a photogrammetric calibration with its covariance, else the loose
knowledge one has of any camera. Where that decides, the result says so.

A target that is off its nominal place is off by the same amount at every position. So the residuals of one target
share a part (its place) beside their own (the image noise); both variances are estimated and the correlation counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from core.digits import fixed
from core.errors import AdjustmentError
from core.geometry import (
    Pose,
    cross_matrix,
    lens_of,
    matrix_from_rotation_vector,
    nominal,
    project,
    project_with_derivatives,
    ray_directions,
    rotation_vector_from_matrix,
)
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Interior, Ints
from core.numerics import least_squares

LEAST_TARGETS = 4
MOST_MISSED = 0.02  # of the image's width, r.m.s., by which targets of one plate miss
LEAST_AGREEING = 3  # positions against which one can be the odd one
TARGETS_TO_START = 20
# rounds and steps of each: a dozen steps find the right start's solution, wrong ones creep on for hundreds
ROUGH, FULL = (1, 40), (3, 400)
TO_OPENCV = np.diag([1.0, -1.0, -1.0])  # X right, Y down, looking along +Z
ASSUMED_DISTANCE = 50.0  # focal lengths, where nothing tells the distance: 0.6 m with a 12 mm lens
AS_MARKED = 0.05  # lenses have the focal lengths that are marked on them, to within this part
POORLY_KNOWN = 0.7  # share of the prior sigma above which the observations have hardly spoken
LEAST_REPEATS = 20
LEAST_SIGMA_PX = 1e-4
OUTER = 9  # parameters after the interior: the plate's pose 6, its axis 2 and which way it points
ALONE = (
    "the camera is oriented by the plate's targets alone, which hardly tell a shift of its principal point from a "
    "turn: X and Y are only as good as their sigmas say; calibrate the photogrammetric method too"
)
AXIS_PRIOR_RAD = 0.02  # the plate's axis is perpendicular to the plate as well as one mounts it


@dataclass(frozen=True)
class TargetPlane:
    """The targets seen with the plate at one position.

    `target` (n,) numbers them, the same target alike at every position; `xyz_mm` (n, 3) are their nominal places on the
    plate, `uv` (n, 2) px those in the image.
    """

    z_mm: float
    target: Ints
    xyz_mm: Array
    uv: Array
    capture: str = ""


@dataclass(frozen=True)
class PlateCamera:
    """The camera before the plate.

    `axis_direction`, shape (3,), is the unit vector of the plate's movement in the plate's frame, for z rising.
    `covariance` (k + 8, k + 8) is of the interior orientation, the plate's rotation vector (rad) and shift (mm), and
    the axis' slopes in the plate's frame; None where all is assumed.
    """

    interior: Interior
    camera_from_plate: Pose
    axis_direction: Array
    warnings: tuple[str, ...]
    covariance: Array | None = None
    rms_px: float = np.inf  # of the targets' residuals


@dataclass(frozen=True)
class Known:
    """What is known of the interior orientation before: its values, and the inverse root (k, k) of their covariance."""

    interior: Interior
    root: Array
    measured: bool


def orient_camera(
    spec: DeviceSpec, planes: Sequence[TargetPlane], *, interior: tuple[Interior, Array] | None = None
) -> PlateCamera:
    """Orient the camera by the plate's targets; positions with fewer than 4 do not count.

    `interior` is from another calibration, with its covariance (k, k). AdjustmentError if the targets fit no pose of
    the plate.
    """
    usable = [plane for plane in planes if len(plane.uv) >= LEAST_TARGETS]
    if not usable:
        return _assumed(spec)
    known = _known(spec, interior)
    found = _fitted(spec, usable, known)
    if (rms_px := _rms_px(found)) < (most_px := MOST_MISSED * spec.width):
        return _result(spec, usable, found, known)
    without = [[p for p in usable if p is not plane] for plane in usable] if len(usable) > LEAST_AGREEING else []
    fits = [_rms_px(_fitted(spec, others, known)) < most_px for others in without]
    if sum(fits) == 1:
        raise AdjustmentError(
            usable[fits.index(True)].capture,
            f"its targets miss by {rms_px:.1f} px r.m.s.",
            "without it all others fit: its picks, z_mm or frames are wrong or turned",
        )
    raise AdjustmentError(
        "depth plate", f"its targets miss by {rms_px:.1f} px r.m.s.", "check the picks and z_mm of the depth captures"
    )


def _fitted(spec: DeviceSpec, planes: Sequence[TargetPlane], known: Known) -> _Solution:
    thin = [_thinned(plane) for plane in planes]
    tries = [_adjust(spec, thin, start, known, ROUGH) for start in _starts(spec, planes, known.interior)]
    if not tries:
        raise AdjustmentError("depth plate", "its targets fit no pose", "check the picks of the depth captures")
    best = min(tries, key=lambda result: result.cost)
    return _adjust(spec, planes, best.parameters, known)


def _rms_px(found: _Solution) -> float:
    return float(np.sqrt(np.mean(found.residuals**2)))


def _thinned(plane: TargetPlane) -> TargetPlane:
    """Enough targets to tell the starts apart."""
    every = slice(None, None, max(1, len(plane.uv) // TARGETS_TO_START))
    return replace(plane, target=plane.target[every], xyz_mm=plane.xyz_mm[every], uv=plane.uv[every])


def _assumed(spec: DeviceSpec) -> PlateCamera:
    distance_mm = ASSUMED_DISTANCE * spec.nominal_c_mm
    warnings = (
        "no targets on the depth plate: X and Y come from the nominal camera, square to the plate",
        f"the plate's distance is assumed to be {fixed(distance_mm, 0)} mm, so X and Y have no true scale",
    )
    pose = Pose(np.eye(3), np.array([0.0, 0.0, -distance_mm]))
    return PlateCamera(nominal(spec), pose, np.array([0.0, 0.0, 1.0]), warnings)


def _prior_sigmas(spec: DeviceSpec) -> Array:
    """What one knows of the camera: of any camera, or what was known of this one before."""
    usual = lens_of(spec).usual_sigma(spec)
    known = np.array(spec.interior_sigma or (np.inf,) * len(usual))
    return np.maximum(np.minimum(usual, known), 1e-9 * usual)


def _known(spec: DeviceSpec, given: tuple[Interior, Array] | None) -> Known:
    if given is None:
        return Known(nominal(spec), np.diag(1 / _prior_sigmas(spec)), False)
    least = np.diag((1e-9 * lens_of(spec).usual_sigma(spec)) ** 2)  # what was held has no variance
    return Known(given[0], np.linalg.inv(np.linalg.cholesky(given[1] + least)), True)


def _starts(spec: DeviceSpec, planes: Sequence[TargetPlane], start: Interior) -> list[Array]:
    """Initial parameters: both poses that fit a flat field nearly as well, and the axis either way."""
    most = max(planes, key=lambda plane: len(plane.uv))
    rays = ray_directions(spec, start, most.uv)
    flat = most.xyz_mm * (1.0, 1.0, 0.0)
    image = np.stack([rays[:, 0], -rays[:, 1]], axis=-1)
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(flat, image, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    except cv2.error:
        return []
    starts = []
    for turn, shift in zip(turns, shifts, strict=True):
        rotation = TO_OPENCV @ cv2.Rodrigues(turn)[0]
        seen_at = TO_OPENCV @ shift.ravel()
        if not (np.isfinite(rotation).all() and seen_at[2] < 0):
            continue
        for sign in (1.0, -1.0):
            origin = seen_at - rotation @ np.array([0.0, 0.0, sign * most.z_mm])
            tail = [*rotation_vector_from_matrix(rotation), *origin, 0.0, 0.0, sign]
            starts.append(np.array([*start.vector, *tail]))
    return starts


@dataclass(frozen=True)
class _Solution:
    parameters: Array
    cost: float
    residuals: Array  # of the image coordinates, px
    covariance: Array  # (k + 8, k + 8) posterior


def _axis(tangents: Array, sign: float) -> Array:
    direction = np.array([tangents[0], tangents[1], 1.0])
    return sign * direction / np.linalg.norm(direction)


def _unpack(spec: DeviceSpec, parameters: Array) -> tuple[Interior, Pose, Array]:
    start = nominal(spec)
    interior = Interior.from_vector(parameters[:-OUTER], start.r0_mm, start.model)
    turn, shift, axis, sign = np.split(parameters[-OUTER:], [3, 6, 8])
    return interior, Pose(matrix_from_rotation_vector(turn), shift), _axis(axis, float(sign[0]))


def _derivatives(spec: DeviceSpec, parameters: Array, places: Array, z: Array) -> Array:
    """Change (n, 2, k + 8) of the image of places (n, 3), the plate at z (n,), with the parameters but the sign."""
    interior, pose, axis = _unpack(spec, parameters)
    found = project_with_derivatives(spec, interior, places + z[:, None] * axis, pose)
    K, angle = cross_matrix(parameters[-OUTER:-6]), float(np.linalg.norm(parameters[-OUTER:-6]))
    # a change of the rotation vector turns by its left Jacobian (Solà, arXiv:1812.01537, eq. 145)
    left = np.eye(3) + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * K
    left += (1 - np.sinc(angle / np.pi)) / max(angle**2, 1e-12) * (K @ K)
    by_slopes = axis[2] * (np.eye(3, 2) - np.outer(axis, axis[:2]))
    by_axis = z[:, None, None] * (found.by_point @ by_slopes)
    return np.concatenate([found.by_interior, found.by_pose[..., :3] @ left, found.by_pose[..., 3:], by_axis], axis=-1)


def _adjust(
    spec: DeviceSpec, planes: Sequence[TargetPlane], start: Array, known: Known, effort: tuple[int, int] = FULL
) -> _Solution:
    """Least squares from one start, repeated with the variances that the residuals before it show."""
    places = np.concatenate([plane.xyz_mm for plane in planes])
    target = np.unique(np.concatenate([plane.target for plane in planes]), return_inverse=True)[1]
    z = np.concatenate([np.full(len(plane.uv), plane.z_mm) for plane in planes])
    uv = np.concatenate([plane.uv for plane in planes])
    k = len(known.root)
    scale = np.concatenate([_prior_sigmas(spec), np.full(3, 0.01), np.full(3, 10.0), np.full(2, 0.01)])
    sign = start[-1]

    def misfit(p: Array) -> Array:
        interior, pose, axis = _unpack(spec, np.append(p * scale, sign))
        found = project(spec, interior, places + z[:, None] * axis, pose)
        return np.asarray(np.nan_to_num(found - uv, nan=1e4))

    def magnified(p: Array) -> Array:
        """How large (n,) the plate's errors are seen, from near more so; 1 in the mean."""
        _, pose, axis = _unpack(spec, np.append(p * scale, sign))
        depth = -pose.apply(places + z[:, None] * axis)[:, 2]
        near = 1 / np.maximum(depth, 0.1 * np.abs(depth).mean())
        return np.asarray(near / near.mean())

    def residuals(p: Array, size: Array, own: float, shared: float) -> Array:
        before = known.root @ (p[:k] * scale[:k] - known.interior.vector)
        observed = _decorrelated(misfit(p), target, size, own, shared).ravel()
        return np.concatenate([observed, before, p[-2:] * scale[-2:] / AXIS_PRIOR_RAD])

    def jacobian(p: Array, size: Array, own: float, shared: float) -> Array:
        by = np.nan_to_num(_derivatives(spec, np.append(p * scale, sign), places, z)).reshape(len(uv), -1)
        observed = _decorrelated(by, target, size, own, shared).reshape(2 * len(uv), -1)
        before = np.eye(k, len(p)), np.eye(2, len(p), len(p) - 2) / AXIS_PRIOR_RAD
        return np.concatenate([observed, known.root @ before[0], before[1]]) * scale

    p, sigmas = start[:-1] / scale, (1.0, 0.0)
    rounds, steps = effort
    for _ in range(rounds):
        size, (own, shared) = magnified(p), sigmas
        misfits = partial(residuals, size=size, own=own, shared=shared)
        p, J = least_squares(misfits, partial(jacobian, size=size, own=own, shared=shared), p, steps)
        sigmas = _sigmas(misfit(p), target, magnified(p))
    unit = np.linalg.norm(J, axis=0)  # what is known to 1e-9 of its usual sigma must not hide what is not
    covariance = np.asarray(np.linalg.pinv((J / unit).T @ (J / unit), hermitian=True), np.float64)
    covariance *= np.outer(scale / unit, scale / unit)
    rest = misfit(p)
    return _Solution(np.append(p * scale, sign), float(np.sum(rest**2)), rest, covariance)


def _errors_of_targets(rest: Array, target: Ints, size: Array) -> tuple[Array, Array]:
    """Error (targets, 2) of each target's place, px, by its residuals (n, 2) seen in sizes (n,), and its weight."""
    weight = np.asarray(np.bincount(target, size**2)[:, None], np.float64)
    return np.stack([np.bincount(target, size * column) for column in rest.T], axis=-1) / weight, weight


def _decorrelated(rest: Array, target: Ints, size: Array, own: float, shared: float) -> Array:
    """Residuals (n, 2), or changes (n, 2 k) of them, made independent by the sigmas (px) of each and of each target.

    A target printed beside its place is seen so at all positions, but larger from near. Taken for as large it would
    change what tells the distance of every target, and the plate's tilt would be held twice as certain as it is.
    """
    errors, weight = _errors_of_targets(rest, target, size)
    keep = own / np.sqrt(own**2 + weight * shared**2)
    return (rest - size[:, None] * ((1 - keep) * errors)[target]) / own


def _sigmas(rest: Array, target: Ints, size: Array) -> tuple[float, float]:
    """Estimate the sigma of each residual alone and the one that a target's residuals share, in px."""
    errors, weight = _errors_of_targets(rest, target, size)
    repeats = len(rest) - len(weight)
    if repeats < LEAST_REPEATS:  # nothing was seen twice: all is taken for the residuals' own
        return max(float(np.sqrt(np.sum(rest**2) / max(rest.size - 8, 1))), LEAST_SIGMA_PX), 0.0
    own = np.sum((rest - size[:, None] * errors[target]) ** 2) / (2 * repeats)
    shared = np.sum(errors**2) / max(errors.size - 8, 1) - own * np.mean(1 / weight)
    return max(float(np.sqrt(own)), LEAST_SIGMA_PX), float(np.sqrt(max(shared, 0.0)))


def _result(spec: DeviceSpec, planes: Sequence[TargetPlane], best: _Solution, known: Known) -> PlateCamera:
    interior, pose, axis = _unpack(spec, best.parameters)
    warnings = []
    if not known.measured:
        warnings.append(ALONE)
        warnings += _other_than_nominal(spec, interior, pose, float(best.covariance[0, 0]) ** 0.5)
    prior = _prior_sigmas(spec)
    poor = np.sqrt(np.diag(best.covariance)[: len(prior)]) > POORLY_KNOWN * prior
    if poor.any() and not known.measured:
        names = ", ".join(name for name, flag in zip(lens_of(spec).names, poor, strict=True) if flag)
        warnings.append(f"the depth plate's targets hardly determine {names}: kept near the nominal camera")
    if len(planes) == 1:
        warnings.append("targets at one plate position only: the axis is taken as perpendicular to the plate")
    return PlateCamera(interior, pose, axis, tuple(warnings), best.covariance, _rms_px(best))


def _other_than_nominal(spec: DeviceSpec, interior: Interior, pose: Pose, sigma_mm: float) -> list[str]:
    """Warn of a principal distance that is not what the lens has when it is focused on the plate."""
    c, nominal_c = interior.c_mm, spec.nominal_c_mm
    focused = nominal_c / (1 - min(nominal_c / float(np.linalg.norm(pose.translation_mm)), 0.5))
    least, most = min(nominal_c, focused), max(nominal_c, focused)
    off = max(c - most, least - c)
    if off < max(AS_MARKED * nominal_c, 3.3 * sigma_mm):
        return []
    return [
        f"c of the camera is {c:.4g} mm by the plate, nominal_c_mm {nominal_c:.4g} mm: if this is right, x_mm and y_mm "
        "of the plate's targets, or z_mm of its positions, are off by as much"
    ]
