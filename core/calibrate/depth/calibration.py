"""The depth calibration: every pixel's own curve from a plate moved through known positions.

A plate stands at known positions z along its axis and is captured at each. At every camera pixel the projector
coordinate u then is known at several z, and a polynomial z(u), or the table itself, is that pixel's calibration. The
camera's orientation from the plate's own targets turns z into points (`depth_camera`).

The method needs no model of the projector: lens and pattern errors that repeat are calibrated away with the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.algebra import on_own_threads
from core.calibrate.depth.camera import PlateCamera, TargetPlane, orient_camera
from core.calibrate.depth.curves import Curves, fit_curves
from core.calibrate.depth.smooth import smooth_maps
from core.errors import AdjustmentError, InputError
from core.geometry import Pose
from core.lazy import dataclass
from core.model import Array, DepthCalibration, DeviceSpec, Floats, Interior, PhaseMap, TargetSet, Testfield
from core.numerics import fisher_limit
from core.progress import SILENT, Progress

WHERE = "depth captures"
MOST_DEGREE = 7
OUTLIER_FACTOR = 6.0  # a pixel whose residuals exceed so many times what its noise explains has a gross error
CELL_PX = 8  # the noise of the curves is kept in cells of this side
CLEARLY = 0.95  # times the residuals of targets by nominal coordinates
FEW = 7  # px, along rows and columns, between pixels that tell whether curves bend more than polynomials
LEVEL = 0.001  # chance that they do not
TOO_MANY_LOST = 0.02  # share of pixels without a usable curve that is worth a warning


@dataclass(frozen=True)
class DepthPlane:
    """The plate at one position."""

    z_mm: float  #: position along the plate's axis
    phase: PhaseMap  #: the decoded capture, shape (H, W)
    targets: TargetSet | None = None  #: the plate's targets in this capture, where they were measured


@dataclass(frozen=True)
class DepthOptions:
    """How the depth is calibrated."""

    degree: int | None = 3  #: of every pixel's polynomial, 1 to 7; None for the table, interpolated linearly
    #: the projector coordinate that gives the depth; "auto" takes the one that changes more with it
    axis: Literal["auto", "u", "v"] = "auto"
    #: standard deviation (px) of the Gaussian by which the coordinate maps of the plate are smoothed before the curves
    #: are fitted, rims of targets and of the lit field left out; 0 for the maps as they are. The plate is smooth, so
    #: this takes the calibration's own noise away: simulated plane-tables deviate by 1.00 to 1.01 times what the true
    #: calibration leaves, without it by 1.2 to 1.7 times.
    low_pass_px: float = 2.0


@on_own_threads()
def calibrate_depth(
    camera: DeviceSpec,
    testfield: Testfield | None,
    planes: Sequence[DepthPlane],
    *,
    options: DepthOptions = DepthOptions(),  # noqa: B008  frozen
    interior: tuple[Interior, Array] | None = None,
    adjusted: Testfield | None = None,
    recentred: Callable[[TargetSet, Testfield, DeviceSpec, Interior, Pose], TargetSet] | None = None,
    progress: Progress = SILENT,
) -> DepthCalibration:
    """Calibrate the depth of every pixel, and the camera for X and Y.

    Parameters
    ----------
    testfield : Testfield or None
        The targets on the plate, in the plate's own frame (z = 0 on its surface).
    planes : sequence of DepthPlane
        In any order.
    interior : (Interior, array), optional
        The camera's from a photogrammetric calibration, with its covariance (k, k); without it the plate's own.
    adjusted : Testfield, optional
        `testfield` with adjusted coordinates. They are taken where the plate's targets fit them clearly better than the
        nominal ones: where the plate is the board that was adjusted, and no other made to the same drawing.
    recentred : callable, optional
        ``(targets, testfield, spec, interior, camera_from_plate) -> targets``: what a target's shape adds to its centre
        from the oriented camera instead of the nominal one. The plate's distance follows from how its image grows along
        the travel: 120 ppm too little of that puts all depths 0.4 mm off at 600 mm.

    Returns
    -------
    calibration : DepthCalibration
        `residual_rms_mm` is the r.m.s. of z(u) - z over all calibrated pixels and planes, with u as decoded, not
        smoothed (but without the rims of targets that the low-pass leaves out); for the table, which goes through its
        own points, that of each inner plane interpolated from its two neighbours.

    Raises
    ------
    InputError
        If the planes are too few, repeat a position, have another size than the camera, or lack the axis.
    AdjustmentError
        If no pixel sees the plate at enough positions.

    Notes
    -----
    Brenner, Böhm, Gühring, *Photogrammetric calibration and accuracy evaluation of a cross-pattern stripe projector*
    (1999), section 4.
    """
    planes = sorted(planes, key=lambda plane: plane.z_mm)
    least = _check(camera, planes, options)
    depths = np.array([plane.z_mm for plane in planes])
    progress(0.0, "orienting the camera by the plate")
    oriented = _orient(camera, testfield, planes, interior)
    if adjusted is not None:
        by_adjusted = _orient(camera, adjusted, planes, interior)
        if by_adjusted.rms_px < CLEARLY * oriented.rms_px:
            testfield, oriented = adjusted, by_adjusted
    if recentred is not None and testfield is not None:
        again = [_recentred(plane, recentred, testfield, camera, oriented) for plane in planes]
        oriented = _orient(camera, testfield, again, interior)
    axis = choose_axis([plane.phase for plane in planes]) if options.axis == "auto" else options.axis
    measured = np.stack([plane.phase.u if axis == "u" else plane.phase.v for plane in planes])
    if not np.isfinite(measured).any():
        seen = f"coordinate {axis} was decoded in no pixel"
        if options.axis != "auto":
            raise InputError(WHERE, seen, "choose the other axis")
        raise AdjustmentError(WHERE, seen, "see that their frames show the plate lit, as capture.json says")
    modulations = [plane.phase.modulation for plane in planes]
    sigmas = [plane.phase.sigma_u if axis == "u" else plane.phase.sigma_v for plane in planes]
    smooth = progress.part(0.1, 0.5)
    used, judged, variance = smooth_maps(measured, modulations, sigmas, options.low_pass_px, smooth)
    variance *= len(planes) / np.maximum(np.isfinite(used).sum(axis=0), 1)  # of curves that fewer positions carry
    progress(0.5, "fitting the depth of every pixel")
    curves = fit_curves(depths, used, judged, options.degree, least)
    progress(0.9, "looking for pixels with gross errors")
    sigma = _mean_sigma(sigmas)
    travel_mm = float(depths[-1] - depths[0])
    good, lost = _usable(curves, sigma, travel_mm)
    if not good.any():
        raise AdjustmentError(
            WHERE,
            f"no pixel sees the plate move at {least} or more of the {len(planes)} positions",
            "check that the captures show the plate where capture.json says",
        )
    u_range = np.where(good, curves.u_range, np.float32(np.nan))
    progress(1.0, "the depth is calibrated")
    return DepthCalibration(
        axis=axis,
        depths_mm=depths,
        degree=options.degree,
        coefficients=curves.coefficients,
        u_range=u_range,
        residual_rms_mm=_rms(curves, good),
        valid_pixels=int(np.count_nonzero(good)),
        camera_spec=camera,
        camera=oriented.interior,
        camera_from_plate=oriented.camera_from_plate,
        axis_direction=oriented.axis_direction,
        warnings=(*oriented.warnings, *lost),
        noise_rms_mm=_noise_rms(curves, sigma, travel_mm, good),
        bent_rms_mm=0.0 if options.degree is None else _left_bent(depths, judged, curves, good),
        between_rms_mm=_between(
            depths, options.degree, float(np.linalg.norm(oriented.camera_from_plate.translation_mm))
        ),
        covariance=oriented.covariance,
        curve_noise_lines=_in_cells(variance, good),
    )


def _check(camera: DeviceSpec, planes: Sequence[DepthPlane], options: DepthOptions) -> int:
    """Refuse what cannot be calibrated; give the least number of planes a pixel needs."""
    if options.degree is not None and not 1 <= options.degree <= MOST_DEGREE:
        raise InputError("degree", str(options.degree), f"choose 1 to {MOST_DEGREE}, or the table")
    needed = 2 if options.degree is None else options.degree + 1
    if len(planes) < needed:
        what = "the table" if options.degree is None else f"a polynomial of degree {options.degree}"
        raise InputError(
            WHERE, f"{len(planes)} plate positions, {what} needs {needed}", "add captures or choose a lower degree"
        )
    for plane in planes:
        if not np.isfinite(plane.z_mm):
            raise InputError(WHERE, f"z_mm is {plane.z_mm}", "give every depth capture its position")
        if plane.phase.u.shape != (camera.height, camera.width):
            height, width = plane.phase.u.shape
            seen = f"{width}×{height} pixels at z = {plane.z_mm:g} mm, the camera has {camera.width}×{camera.height}"
            raise InputError(WHERE, seen, "use captures of this project's camera")
    for one, next_one in pairwise(planes):
        if one.z_mm == next_one.z_mm:
            raise InputError(WHERE, f"two captures at z = {one.z_mm:g} mm", "leave one out or correct its z_mm")
    return max(min(needed + 1, len(planes)), needed)


def choose_axis(phases: Sequence[PhaseMap]) -> Literal["u", "v"]:
    """Name the coordinate that changes more, in its sigmas, while the plate moves; `phases` in the plate's order."""
    scores = []
    for values, sigmas in (
        ([p.u for p in phases], [p.sigma_u for p in phases]),
        ([p.v for p in phases], [p.sigma_v for p in phases]),
    ):
        thin = (slice(None, None, 5), slice(None, None, 5))  # a twenty-fifth of the pixels tells
        steps = [np.abs(b[thin] - a[thin]) for a, b in pairwise(values)]
        moved = np.concatenate([s[np.isfinite(s)] for s in steps])
        noise = np.concatenate([s[thin][np.isfinite(s[thin])] for s in sigmas])
        floor = float(np.median(noise)) if noise.size else 0.0
        scores.append(float(np.median(moved)) / max(floor, 1e-3) if moved.size else 0.0)
    return "u" if scores[0] >= scores[1] else "v"


def _orient(
    camera: DeviceSpec,
    testfield: Testfield | None,
    planes: Sequence[DepthPlane],
    interior: tuple[Interior, Array] | None,
) -> PlateCamera:
    seen = []
    places = testfield.index() if testfield is not None else {}
    for plane in planes:
        if plane.targets is None or testfield is None:
            continue
        found = [(i, places[key]) for i, key in enumerate(plane.targets.keys) if key in places]
        rows = np.array(found, dtype=np.int64).reshape(-1, 2)
        known = np.isfinite(plane.targets.camera_uv[rows[:, 0]]).all(axis=-1)
        rows = rows[known]
        target, uv = rows[:, 1], plane.targets.camera_uv[rows[:, 0]]
        seen.append(TargetPlane(plane.z_mm, target, testfield.xyz_mm[target], uv, plane.targets.capture))
    return orient_camera(camera, seen, interior=interior)


def _recentred(
    plane: DepthPlane,
    recentred: Callable[[TargetSet, Testfield, DeviceSpec, Interior, Pose], TargetSet],
    testfield: Testfield,
    camera: DeviceSpec,
    oriented: PlateCamera,
) -> DepthPlane:
    if plane.targets is None:
        return plane
    pose = oriented.camera_from_plate
    moved = Pose(pose.rotation, pose.apply(plane.z_mm * oriented.axis_direction))
    return replace(plane, targets=recentred(plane.targets, testfield, camera, oriented.interior, moved))


def _mean_sigma(sigmas: Sequence[Floats]) -> Floats:
    """Root mean square over the planes of the sigmas (H, W), 0 where none is known."""
    total = np.zeros(sigmas[0].shape, np.float32)
    count = np.zeros(sigmas[0].shape, np.float32)
    for sigma in sigmas:
        known = np.isfinite(sigma)
        total += np.where(known, sigma, 0) ** 2
        count += known
    return np.asarray(np.sqrt(total / np.maximum(count, 1)), np.float32)


def _rms(curves: Curves, good: NDArray[np.bool_]) -> float:
    return float(np.sqrt(curves.squares[good].sum(dtype=np.float64) / max(int(curves.count[good].sum()), 1)))


def _left_bent(depths: Array, judged: Floats, curves: Curves, good: NDArray[np.bool_]) -> float:
    """What one degree more would explain of the residuals in depth, r.m.s.; 0 where positions that are off would, too.

    The mean residual of each plate is nearly free of noise. H0: its part along the next polynomial is like the rest.
    """
    thin = (slice(None, None, FEW), slice(None, None, FEW))
    use = good[thin] & np.isfinite(judged[:, *thin]).all(axis=0)
    degree = len(curves.coefficients) - 1
    free = len(depths) - degree - 2
    if free < 1 or not use.any():
        return 0.0
    low, high = (each[thin][use] for each in curves.u_range)
    t = (2 * judged[:, *thin][:, use] - low - high) / (high - low)
    found = np.zeros(t.shape)
    for own in curves.coefficients[::-1]:
        found = found * t + own[thin][use]
    rest = found - depths[:, None]
    mean = np.asarray(rest.mean(axis=1))
    polynomials = np.linalg.qr(np.vander(t.mean(axis=1), degree + 2, increasing=True))[0]
    along = float(np.dot(polynomials[:, -1], mean)) ** 2
    if along * free <= fisher_limit(1, free, LEVEL) * (float(np.dot(mean, mean)) - along):
        return 0.0
    return _rms(curves, good) * (along / len(depths) / float(np.mean(rest**2, dtype=np.float64))) ** 0.5


def _between(depths: Array, degree: int | None, distance_mm: float) -> float:
    """By how much curves through no more positions than they need are off between these, r.m.s.; 0 through more.

    Depth over a coordinate of the projector is ``D / (1 + e t)`` for t from -1 to 1, ``e`` being half the travel over
    the distance D. A polynomial of degree n through n + 1 places t_i leaves ``D e^(n+1) (t - t_0) ... (t - t_n)``.
    """
    degree = degree or 1
    if len(depths) > degree + 1:
        return 0.0
    places = np.interp(depths, depths[[0, -1]], (-1.0, 1.0))
    off = np.prod(np.linspace(-1, 1, 201)[:, None] - places, axis=1)
    return distance_mm * (float(np.ptp(depths)) / 2 / distance_mm) ** (degree + 1) * float(np.sqrt(np.mean(off**2)))


def _noise_rms(curves: Curves, sigma: Floats, travel_mm: float, good: NDArray[np.bool_]) -> float | None:
    """Residuals in depth, r.m.s., that noise of these sigmas (H, W) would leave of a perfect calibration."""
    with np.errstate(invalid="ignore", divide="ignore"):
        expected = (sigma * travel_mm / (curves.u_range[1] - curves.u_range[0]))[good]
    expected = expected[np.isfinite(expected)]
    return float(np.sqrt(np.mean(expected.astype(np.float64) ** 2))) if expected.size else None


def _in_cells(variance: Floats, good: NDArray[np.bool_]) -> Floats:
    """Standard deviation, r.m.s. of the good pixels in each of equal cells."""
    height, width = good.shape
    size = max(width // CELL_PX, 1), max(height // CELL_PX, 1)
    sums = [
        cv2.resize(np.where(good, a, 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
        for a in (variance, good)
    ]
    with np.errstate(invalid="ignore"):
        mean = sums[0] / sums[1]
    return np.sqrt(np.where(sums[1] > 0, mean, variance[good].mean(dtype=np.float64))).astype(np.float32)


def _usable(curves: Curves, sigma: Floats, travel_mm: float) -> tuple[NDArray[np.bool_], list[str]]:
    """Find the pixels with a curve that fits; the warnings about those without."""
    fitted = np.isfinite(curves.u_range[0])
    if not fitted.any():
        return fitted, []
    rms = np.sqrt(curves.squares / np.maximum(curves.count, 1))
    typical = float(np.median(rms[fitted]))
    with np.errstate(invalid="ignore", divide="ignore"):
        expected = sigma * travel_mm / (curves.u_range[1] - curves.u_range[0])
    good = fitted & (rms <= OUTLIER_FACTOR * np.maximum(expected, typical))
    warnings = []
    gross = int(np.count_nonzero(fitted & ~good))
    if gross > TOO_MANY_LOST * np.count_nonzero(fitted):
        warnings.append(f"{gross} pixels left out: their residuals exceed {OUTLIER_FACTOR:g} times the noise")
    if curves.not_monotonic > TOO_MANY_LOST * (curves.not_monotonic + np.count_nonzero(fitted)):
        warnings.append(
            f"{curves.not_monotonic} pixels left out: their projector coordinate does not rise or fall steadily with "
            "the plate's position (background, reflections, or plates in the wrong order)"
        )
    return good, warnings
