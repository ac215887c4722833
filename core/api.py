"""The steps of the road from arrays, without files: for programs that record, detect or store in their own way.

Pixel coordinates are ``(u, v)``: u right, v down, the centre of the first pixel (or projector line) is (0, 0), as in
OpenCV. A device's frame has X right and Y *up*, and the device looks along *-Z*. OpenCV's has Y down and Z forward:
``X_opencv = diag(1, -1, -1) X``, which is its own inverse; ``resources/help/formats.md`` shows both in a picture.
Lengths are mm.

While the core works its own threads use the processors, and the linear algebra of NumPy and SciPy has one thread; set
OPENBLAS_NUM_THREADS before NumPy is imported to choose otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.arrays import (
    Device,
    as_board,
    as_coordinates,
    as_device,
    as_image,
    as_known,
    as_pattern,
    as_positions,
    as_sigmas,
    as_size,
)
from core.errors import InputError
from core.geometry import Pose, Projection, distort, image_to_pixel, pair_of, pixel_to_image, project_with_derivatives
from core.geometry.intersection import intersect_observations
from core.lazy import dataclass
from core.model import (
    Adjustment,
    Array,
    Concern,
    DeviceSpec,
    Pair,
    PhaseMap,
    PhotogrammetricCalibration,
    PointCloud,
    Registration,
    Rig,
    ScaleBar,
    TargetSet,
    Testfield,
    verdict_of,
)
from core.patterns import Pattern
from core.progress import SILENT, Progress

OPENCV_FROM_OURS = Pose(np.diag([1.0, -1.0, -1.0]))


def decode_frames(
    patterns: Sequence[Pattern | Mapping[str, Any]],
    images: Sequence[NDArray[Any]],
    *,
    projector_size: tuple[int, int] | None = None,
    progress: Progress = SILENT,
) -> PhaseMap:
    """Decode frames to the projector coordinates of every pixel.

    Parameters
    ----------
    patterns : sequence of Pattern or mapping
        What the projector showed in each image: made by `core.patterns`, or as capture.json has it, such as
        ``{"kind": "phase", "axis": "x", "period": 16, "steps": 4, "step": 0, "shift_rad": 0, "profile": "sine"}``.
    images : sequence of uint8 or uint16 arrays, shape (H, W)
        In the same order, whichever it is. A masked array must have nothing masked.
    projector_size : (int, int), optional
        Columns and rows of the projector; without it what the frames themselves tell apart, which of one period alone
        is the place within it.

    Returns
    -------
    phase_map : PhaseMap
        `u`, `v` in lines with `sigma_u`, `sigma_v`, NaN where invalid.

    Raises
    ------
    InputError
        When the frames do not fit together, or no absolute coordinate follows from them.
    """
    from core.decode import decode

    shown = [as_pattern(f"patterns[{k}]", pattern) for k, pattern in enumerate(patterns)]
    arrays = [as_image(f"images[{k}]", image) for k, image in enumerate(images)]
    size = None if projector_size is None else as_size("projector_size", projector_size)
    return decode(shown, arrays, lines=size, where="images", progress=progress)


def calibrate_points(
    camera: DeviceSpec,
    projector: DeviceSpec,
    board_mm: ArrayLike,
    camera_uv: Sequence[ArrayLike],
    projector_uv: Sequence[ArrayLike],
    *,
    camera_sigma_px: ArrayLike = 0.05,
    projector_sigma_lines: ArrayLike = 0.05,
    length: tuple[int, int, float, float] | None = None,
    rigid: bool = True,
    progress: Progress = SILENT,
) -> PhotogrammetricCalibration:
    """Calibrate camera and projector from points that anyone detected: corners, markers, centres of dots.

    Parameters
    ----------
    camera, projector : DeviceSpec
        With nominal focal lengths.
    board_mm : array-like, shape (n, 3) or (n, 2)
        The points of the board, y up, z towards the devices. They are estimated too: these are approximate.
    camera_uv, projector_uv : sequences of array-likes, shape (n, 2)
        One for each position of the board: where camera and projector see its points, NaN where they do not. A
        projector coordinate may be NaN alone.
    camera_sigma_px, projector_sigma_lines : array-like
        Standard deviations: a number, or whatever broadcasts to (positions, n, 2).
    length : (int, int, float, float), optional
        A measured distance: indices of two points, millimetres and its sigma. Without it the board gives the scale.
    rigid : bool
        One orientation of the projector to the camera for all positions.

    Returns
    -------
    calibration : PhotogrammetricCalibration
        With the covariance of all its parameters. Its `verdict` says what speaks against it: residuals against the
        sigmas given, nominal focal lengths, the board against the length.

    Raises
    ------
    core.InputError
        If the arrays do not fit together, or not the devices.
    core.AdjustmentError
        If the points do not determine the calibration.
    """
    from core import checks
    from core.calibrate import calibrate_photogrammetric

    as_device("camera", camera)
    as_device("projector", projector)
    board = as_board("board_mm", board_mm)
    n = len(board)
    if length is not None and (len(length) != 4 or length[0] == length[1] or not {*length[:2]} <= {*range(n)}):
        told = f"is {tuple(length)!r}, the board has {n} points"
        raise InputError("length", told, "give indices of two of them from 0, millimetres and their sigma")
    seen = as_positions("camera_uv", camera_uv, n, camera)
    lit = as_positions("projector_uv", projector_uv, n, projector)
    if len(seen) != len(lit):
        raise InputError("projector_uv", f"has {len(lit)} positions, camera_uv {len(seen)}", "give as many")
    sigma = as_sigmas("camera_sigma_px", camera_sigma_px, seen, exact=False)
    sigma_lit = as_sigmas("projector_sigma_lines", projector_sigma_lines, lit, exact=False)
    field = Testfield(np.zeros(n, np.int64), np.arange(n), board, np.full(n, np.nan))
    targets = [_targets(f"position {k + 1}", field, seen[k], sigma[k], lit[k], sigma_lit[k]) for k in range(len(seen))]
    bar = ScaleBar((0, length[0]), (0, length[1]), length[2], length[3]) if length else None
    rig = Rig({"camera": camera}, {"projector": projector})
    found, adjustment = calibrate_photogrammetric(rig, field, targets, scale=bar, rigid=rigid, progress=progress)
    rejected, _ = checks.rejected_of(adjustment, targets)
    concerns = [
        *_from_behind(adjustment),
        *checks.adjustment_concerns(adjustment, rejected),
        *checks.uneven_axes(adjustment),
        *checks.length_concerns(adjustment, field, bar, None, False),
        *checks.nominal_concerns(found.devices),
    ]
    verdict = verdict_of(concerns, checks.sound_words(adjustment))
    return replace(found, verdict=verdict, left_out=checks.left_out_of(targets, rejected))


def _targets(name: str, field: Testfield, seen: Array, sigma: Array, lit: Array, sigma_lit: Array) -> TargetSet:
    """The points that the camera sees at one position of the board."""
    use = np.isfinite(seen).all(axis=1)
    covariance = sigma[use, :, None] ** 2 * np.eye(2)
    nothing = np.zeros((np.count_nonzero(use), 2))
    where = lit[use], sigma_lit[use], nothing, nothing[:, 0]
    return TargetSet(name, field.row[use], field.col[use], seen[use], covariance, *where)


def _from_behind(adjustment: Adjustment) -> list[Concern]:
    """Tell a board whose z leads away from the devices, as it does where images are mirrored."""
    poses = adjustment.station_from_object
    behind = sum(1 for pose in poses if pose.rotation[2, 2] < 0)
    if 2 * behind <= len(poses):
        return []
    text = (
        f"board_mm: is seen from behind in {behind} of {len(poses)} images: give its y upwards, and v downwards; "
        "of mirrored images the calibration is mirrored, too"
    )
    return [Concern("doubtful", text)]


def reconstruct_phase(
    phase: PhaseMap, calibration: PhotogrammetricCalibration, progress: Progress = SILENT
) -> PointCloud:
    """Points with sigmas of all pixels of a phase map, in the camera's frame: pixels are exact, lines are not."""
    from core.reconstruct import reconstruct

    return reconstruct(phase, calibration, progress=progress)


def merge_phases(
    phases: Sequence[PhaseMap],
    calibration: PhotogrammetricCalibration,
    *,
    targets: Sequence[TargetSet | None] = (),
    by: Literal["both", "targets", "surface"] = "both",
    progress: Progress = SILENT,
) -> tuple[PointCloud, tuple[str, ...], Registration]:
    """Join what a rig saw of one object from several stations, or of an object that was turned.

    Parameters
    ----------
    phases : sequence of PhaseMap
        One of each station, by the same camera and projector.
    targets : sequence of TargetSet, optional
        Targets with the object, as each station saw them; without them the surface alone tells the poses.
    by : {"both", "targets", "surface"}
        What tells the poses.

    Returns
    -------
    cloud : PointCloud
        Shape (1, n, 3), in the frame of the first station's camera; its sigmas hold noise, poses and calibration.
    made_by : tuple of str
        Stations that have a part in a point, ``"0 + 2"``, by the cloud's `source`.
    registration : Registration
        With poses ``camera_from_first``.

    Raises
    ------
    InputError
        If the stations do not tell how they stand to each other.
    """
    from core.orient import View, register, starts_of
    from core.reconstruct import at_stations, joined, reconstruct

    if len(phases) < 2 or len(targets) not in (0, len(phases)):
        seen = f"{len(phases)} phase maps, {len(targets)} sets of targets"
        raise InputError("merge_phases", seen, "give at least two phase maps, and targets for each or for none")
    given = targets or [None] * len(phases)
    camera = phases[0].camera if len(calibration.cameras) > 1 else calibration.camera_name
    projector = phases[0].projector if len(calibration.projectors) > 1 else calibration.projector_name
    phases = [replace(phase, camera=camera, projector=projector) for phase in phases]
    views = [
        View(phase, reconstruct(phase, calibration), own, str(k))
        for k, (phase, own) in enumerate(zip(phases, given, strict=True))
    ]
    found = register(views, calibration, starts_of(views, calibration, progress), by=by, progress=progress)
    everywhere = at_stations(calibration, found, camera)
    cloud, _, made_by = joined([[phase] for phase in phases], found.captures, everywhere, progress)
    return cloud, tuple(stations for _, stations in made_by), found


@dataclass(frozen=True)
class Points:
    """Points in the camera's frame, mm: `xyz_mm`, shape (..., 3), and `covariance_mm2`, shape (..., 3, 3)."""

    xyz_mm: Array
    covariance_mm2: Array

    @property
    def sigma_mm(self) -> Array:
        """Standard deviations of X, Y, Z, shape (..., 3)."""
        return np.sqrt(np.diagonal(self.covariance_mm2, axis1=-2, axis2=-1))


def triangulate(
    calibration: PhotogrammetricCalibration,
    camera_uv: ArrayLike,
    projector_uv: ArrayLike,
    *,
    camera_sigma_px: ArrayLike = 0.0,
    projector_sigma_lines: ArrayLike = 0.05,
    calibration_error: bool = True,
) -> Points:
    """Intersect any camera coordinates with projector coordinates.

    Parameters
    ----------
    camera_uv : array-like, shape (..., 2)
        px, anywhere in the image.
    projector_uv : array-like, shape (..., 2)
        Lines; one of the two may be NaN. Masked values count as NaN.
    camera_sigma_px, projector_sigma_lines : array-like
        Standard deviations: numbers, or what broadcasts to (..., 2), NaN where the coordinate is. A pixel of a phase
        map is exact: 0.
    calibration_error : bool
        Let the covariance contain what the calibration is not sure of.

    Returns
    -------
    points : Points
        NaN where nothing intersects in front of both devices.

    Notes
    -----
    Least squares in the 3 coordinates from 3 or 4 observations, with the covariance
    ``C = N⁻¹ + (N⁻¹ AᵀP B) S (N⁻¹ AᵀP B)ᵀ``, N = AᵀPA, A and B the derivatives of the observations by point and by
    calibration, S the calibration's covariance.
    """
    if not isinstance(calibration, PhotogrammetricCalibration | Pair):
        raise InputError("calibration", f"is a {type(calibration).__name__}", "give a calibration of core")
    uv, lines = as_coordinates("camera_uv", camera_uv), as_coordinates("projector_uv", projector_uv)
    if uv.shape != lines.shape or uv.shape[-1:] != (2,):
        raise InputError("projector_uv", f"has shape {lines.shape}, camera_uv {uv.shape}", "give (..., 2) for both")
    sigmas = (
        as_sigmas("camera_sigma_px", camera_sigma_px, uv),
        as_sigmas("projector_sigma_lines", projector_sigma_lines, lines),
    )
    observed, sigma = (np.concatenate(both, axis=-1).reshape(-1, 4) for both in ((uv, lines), sigmas))
    pair = pair_of(calibration)
    S = pair.covariance if calibration_error else None
    xyz, covariance = intersect_observations(pair, observed, sigma, S)
    return Points(xyz.reshape(*uv.shape[:-1], 3), covariance.reshape(*uv.shape[:-1], 3, 3))


def project_points(device: Device, points_mm: ArrayLike, device_from_object: Pose | None = None) -> Projection:
    """Where a device sees (or lights) points, with derivatives.

    Parameters
    ----------
    device : AdjustedDevice or (DeviceSpec, Interior)
        Such as `calibration.projector`.
    points_mm : array-like, shape (..., 3)
        In the device's frame, or in the one that `device_from_object` leads from: for points in the camera's frame and
        the projector that is `calibration.projector_from_camera`.

    Returns
    -------
    projection : Projection
        `uv` (..., 2), `by_point` (..., 2, 3), `by_interior` (..., 2, k), `by_pose` (..., 2, 6); NaN behind the device.

    Examples
    --------
    >>> from core import Interior
    >>> device = DeviceSpec(640, 480, (0.01, 0.01), 8.0), Interior(8.0)
    >>> project_points(device, [0.0, 100.0, -800.0]).uv
    array([319.5, 139.5])
    """
    points = as_coordinates("points_mm", points_mm)
    if points.shape[-1:] != (3,):
        raise InputError("points_mm", f"has shape {points.shape}", "give (..., 3)")
    if not isinstance(device_from_object, Pose | None):
        raise InputError("device_from_object", f"is of type {type(device_from_object).__name__}", "give a core Pose")
    return project_with_derivatives(*as_known("device", device), points, device_from_object)


def undistort_image(
    device: Device,
    image: NDArray[Any],
    *,
    c_mm: float | None = None,
    interpolation: Literal["linear", "cubic"] = "linear",
) -> NDArray[Any]:
    """Resample an image as a camera without distortion would have taken it.

    Parameters
    ----------
    device : AdjustedDevice or (DeviceSpec, Interior)
    image : array, shape (H, W) or (H, W, k)
        uint8, uint16 or float32; a masked array must have nothing masked.
    c_mm : float, optional
        The new camera's principal distance, by default the device's; a smaller one shows more of the corners.
    interpolation : "linear" or "cubic"

    Returns
    -------
    image : array
        Of the same shape and type, 0 where nothing was seen. Its principal point is the middle of the image: the
        matrix of OpenCV is ``[[c/pitch_x, 0, (W-1)/2], [0, c/pitch_y, (H-1)/2], [0, 0, 1]]``.
    """
    import cv2

    spec, interior = as_known("device", device)
    image = as_image("image", image)
    if image.dtype not in (np.uint8, np.uint16, np.float32):
        raise InputError("image", f"has grey values of type {image.dtype}", "give uint8, uint16 or float32")
    if image.ndim not in (2, 3) or image.size == 0:
        raise InputError("image", f"has shape {image.shape}", "give (H, W) or (H, W, k)")
    if image.shape[:2] != (spec.height, spec.width):
        seen = f"has {image.shape[1]}x{image.shape[0]} px, the device {spec.width}x{spec.height}"
        raise InputError("image", seen, "give an image of this device")
    hows = {"linear": cv2.INTER_LINEAR, "cubic": cv2.INTER_CUBIC}
    if interpolation not in hows:
        raise InputError("interpolation", f"is {interpolation!r}", "give 'linear' or 'cubic'")
    c = interior.c_mm if c_mm is None else c_mm
    if not (isinstance(c, SupportsFloat) and 0 < c < np.inf):
        raise InputError("c_mm", f"is {c_mm!r}", "give millimetres above 0")
    u, v = np.meshgrid(np.arange(spec.width), np.arange(spec.height))
    ideal = pixel_to_image(spec, np.stack([u, v], axis=-1)) * (interior.c_mm / c)
    source = image_to_pixel(spec, distort(interior, ideal)).astype(np.float32)
    straight = np.empty(image.shape, image.dtype)
    for k in np.ndindex(image.shape[2:]):  # of several channels at once OpenCV 5 interpolates to 1/32 px only
        channel = np.ascontiguousarray(image[..., *k])
        straight[..., *k] = cv2.remap(channel, source[..., 0], source[..., 1], hows[interpolation])
    return straight
