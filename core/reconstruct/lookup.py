"""Depth by look-up: every pixel's own curve gives the plate's position, its ray the point on the plate.

At a pixel the measured u gives the plate position z at which the plate would be lit like that. The point is where the
pixel's ray meets the plate's plane at that position, so X and Y come from the camera's orientation.

The point is ``X = d s`` on its ray d, with ``s = (n t + n a z) / (n d)`` linear in z, and so are its derivatives by the
interior orientation, the plate's pose and its axis. So what the orientation leaves uncertain is a quadratic in z, with
coefficients that change slowly over the image: they are worked out on a grid of pixels and interpolated. The noise of
the curves moves z itself, along the ray as the noise of the capture does.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np

from core.compiling import njit
from core.errors import NoCoordinateError
from core.geometry import matrix_from_rotation_vector, ray_directions, rotation_vector_from_matrix
from core.model import Array, DepthCalibration, Floats, PhaseMap, PointCloud
from core.parallel import run_in_bands
from core.reconstruct.rays import camera_rays, flat

NODES = 24  # along the longer side: between them the variances are even to 1 %
STEP = 0.02  # sigmas, of the numerical derivatives
_last: list[tuple[Any, ...]] = []  # calibration and image size asked for last, and the coefficients: every capture asks


def look_up(phase: PhaseMap, calibration: DepthCalibration, *, extrapolate: bool = False) -> PointCloud:
    """Look up the depth of all pixels, (H, W), of a phase map with the calibrated axis; NoCoordinateError without it.

    `extrapolate` also gives points beyond the depths at which the pixel was calibrated: the polynomial as it goes on,
    or the table's end pieces prolonged. `sigma_depth_mm` of Z is from the capture's phase noise and that of the curves,
    `sigma_mm` from both and the camera's orientation, where the calibration has its covariance.
    """
    measured, sigma = (phase.u, phase.sigma_u) if calibration.axis == "u" else (phase.v, phase.sigma_v)
    if not np.isfinite(measured).any():
        axis = {"u": "x", "v": "y"}[calibration.axis]
        seen = f"no pixel has the coordinate {calibration.axis} that the depth calibration uses"
        raise NoCoordinateError("phase map", seen, f"capture with patterns along {axis}")
    rays = flat(camera_rays(calibration.camera_spec, calibration.camera))
    normal, at_zero, per_mm = _plate(calibration)
    plate = (*(float(n) for n in normal), at_zero, per_mm)
    xyz = np.empty((*measured.shape, 3), np.float32)
    sigma_depth = np.empty(measured.shape, np.float32)
    coefficients, u_range = calibration.coefficients, calibration.u_range

    def band(start: int, stop: int) -> None:
        if calibration.degree is None:
            _table_rows(
                measured, sigma, coefficients, calibration.depths_mm, u_range, extrapolate, rays, plate,
                flat(xyz), sigma_depth, start, stop,
            )  # fmt: skip
        else:
            _polynomial_rows(
                measured, sigma, coefficients, u_range, extrapolate, rays, plate, flat(xyz), sigma_depth, start, stop
            )

    run_in_bands(band, measured.shape[0])
    add_curves(calibration, sigma, xyz, sigma_depth)
    return PointCloud(xyz, whole_sigma(calibration, xyz, sigma_depth), sigma_depth, by_depth=True)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"}, inline="always")
def _place(z, slope, sigma, dx, dy, plate):  # type: ignore[no-untyped-def]
    """Distance along the ray (in units of -Z) to the plate at position z, and its sigma."""
    nx, ny, nz, at_zero, per_mm = plate
    facing = 1.0 / (nx * dx + ny * dy - nz)
    return (at_zero + per_mm * z) * facing, abs(per_mm * facing * slope) * sigma


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _polynomial_rows(u, sigma, coefficients, u_range, extrapolate, rays, plate, xyz, sigma_depth, start, stop):  # type: ignore[no-untyped-def]
    """Depth by the polynomials of rows start to stop - 1."""
    terms = coefficients.shape[0]
    for r in range(start, stop):
        for c in range(u.shape[1]):
            least, greatest = np.float64(u_range[0, r, c]), np.float64(u_range[1, r, c])
            half = 0.5 * (greatest - least)
            t = (np.float64(u[r, c]) - 0.5 * (least + greatest)) / half
            z, slope = 0.0, 0.0
            for k in range(terms - 1, -1, -1):
                slope = slope * t + z
                z = z * t + np.float64(coefficients[k, r, c])
            dx, dy = np.float64(rays[r, 2 * c]), np.float64(rays[r, 2 * c + 1])
            s, noise = _place(z, slope / half, np.float64(sigma[r, c]), dx, dy, plate)
            # u_range is stored as float32, as u is: a plate at its own calibrated depth is inside
            good = (extrapolate or abs(t) <= 1.0) and s > 0
            s = s if good else np.nan
            xyz[r, 3 * c], xyz[r, 3 * c + 1], xyz[r, 3 * c + 2] = dx * s, dy * s, -s
            sigma_depth[r, c] = noise if good else np.nan


@njit(cache=True, nogil=True, error_model="numpy")
def _table_rows(u, sigma, table, depths, u_range, extrapolate, rays, plate, xyz, sigma_depth, start, stop):  # type: ignore[no-untyped-def]
    """Depth by the piecewise-linear tables of rows start to stop - 1."""
    for r in range(start, stop):
        for c in range(u.shape[1]):
            xyz[r, 3 * c] = xyz[r, 3 * c + 1] = xyz[r, 3 * c + 2] = sigma_depth[r, c] = np.nan
            value = u[r, c]
            inside = u_range[0, r, c] <= value <= u_range[1, r, c]
            if not (inside or (extrapolate and np.isfinite(value) and np.isfinite(u_range[0, r, c]))):
                continue
            low, high = 0, len(depths) - 1
            while not np.isfinite(table[low, r, c]):
                low += 1
            while not np.isfinite(table[high, r, c]):
                high -= 1
            rising = table[high, r, c] > table[low, r, c]
            while high - low > 1:  # bisection: the table is monotonic
                middle = (low + high) // 2
                if (table[middle, r, c] <= value) == rising:
                    low = middle
                else:
                    high = middle
            slope = (depths[high] - depths[low]) / (np.float64(table[high, r, c]) - np.float64(table[low, r, c]))
            z = depths[low] + (np.float64(value) - np.float64(table[low, r, c])) * slope
            dx, dy = np.float64(rays[r, 2 * c]), np.float64(rays[r, 2 * c + 1])
            s, noise = _place(z, slope, np.float64(sigma[r, c]), dx, dy, plate)
            if s > 0:
                xyz[r, 3 * c], xyz[r, 3 * c + 1], xyz[r, 3 * c + 2] = dx * s, dy * s, -s
                sigma_depth[r, c] = noise


def add_curves(calibration: DepthCalibration, sigma: Floats, xyz: Floats, sigma_depth: Floats) -> None:
    """Add the noise of the curves to what a capture's own, `sigma` (H, W) lines, makes of Z, `sigma_depth` (H, W)."""
    if calibration.curve_noise_lines is None:
        return
    cells, size = np.atleast_2d(np.float32(calibration.curve_noise_lines)), sigma.shape[::-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        curve = cv2.resize(cells, size, interpolation=cv2.INTER_LINEAR) / sigma
        sigma_depth *= np.sqrt(1 + curve**2 * _leverage(calibration, _plate_z(calibration, xyz)))


def _plate_z(calibration: DepthCalibration, xyz: Floats) -> Floats:
    """Where along its axis the plate goes through points (H, W, 3)."""
    normal, at_zero, per_mm = _plate(calibration)
    return np.asarray(((xyz @ normal.astype(np.float32)) - np.float32(at_zero)) / np.float32(per_mm))


def _plate(calibration: DepthCalibration) -> tuple[Array, float, float]:
    """Of the plate in the camera's frame: its normal (3,), how far along it its origin lies, and goes with z."""
    pose = calibration.camera_from_plate
    normal = pose.rotation[:, 2]  # the plate is its own plane z = 0
    along = normal @ (pose.rotation @ calibration.axis_direction)
    return normal, float(normal @ pose.translation_mm), float(along)


def whole_sigma(calibration: DepthCalibration, xyz: Floats, sigma_depth: Floats) -> Floats | None:
    """Sigmas (H, W, 3) of looked-up points (H, W, 3): noise along the ray, and the camera's orientation.

    `sigma_depth` (H, W) is what noise makes of Z. None where the calibration has no covariance.
    """
    if calibration.covariance is None:
        return None
    height, width = sigma_depth.shape
    known = _last[0] if _last else (None, (0, 0), [])
    if known[0] is not calibration or known[1] != (height, width):
        known = calibration, (height, width), _coefficients(calibration, height, width)
        _last[:] = [known]  # as one: other threads may ask for another
    coefficients, z = known[2], _plate_z(calibration, xyz)
    result = np.empty(xyz.shape, np.float32)
    with np.errstate(invalid="ignore", divide="ignore"):
        for axis in range(3):
            a, b, c = (cv2.resize(part, (width, height), interpolation=cv2.INTER_LINEAR) for part in coefficients[axis])
            along = (xyz[..., axis] / xyz[..., 2] * sigma_depth) ** 2
            result[..., axis] = np.sqrt(np.maximum(a + z * (b + z * c), 0) + along)
    return result


def _leverage(calibration: DepthCalibration, z: Floats) -> Floats:
    """Variance of a curve at z (H, W) over that of one position, as if the pixel had been seen at all of them."""
    depths = calibration.depths_mm
    if calibration.degree is None:  # between two positions
        after = np.clip(np.searchsorted(depths, z), 1, len(depths) - 1)
        share = (z - depths[after - 1]) / (depths[after] - depths[after - 1])
        return np.asarray(1 - 2 * share + 2 * share**2, np.float32)
    middle, half = (depths[-1] + depths[0]) / 2, (depths[-1] - depths[0]) / 2
    A = np.vander((depths - middle) / half, calibration.degree + 1)
    Q = np.linalg.inv(A.T @ A)  # its antidiagonals have the coefficients of t's powers, the highest first
    t, result = (z - np.float32(middle)) / np.float32(half), np.zeros(z.shape, np.float32)
    for k in range(-calibration.degree, calibration.degree + 1):
        result = result * t + np.float32(np.trace(Q[::-1], offset=k))
    return result


def _coefficients(calibration: DepthCalibration, height: int, width: int) -> Floats:
    """Of every coordinate's variance the quadratic in z, shape (3, 3, rows, columns), at the middles of equal cells."""
    assert calibration.covariance is not None
    step = max(height, width) / NODES
    rows, cols = max(round(height / step), 2), max(round(width / step), 2)
    v, u = (np.arange(rows) + 0.5) * height / rows - 0.5, (np.arange(cols) + 0.5) * width / cols - 0.5
    uv = np.stack(np.meshgrid(u, v), axis=-1)
    far = max(float(np.abs(calibration.depths_mm).max()), 1.0)
    sigma = np.sqrt(np.maximum(np.diag(calibration.covariance), 0))
    size = np.where(sigma > 0, STEP * sigma, 1.0)
    scaled = calibration.covariance / np.outer(size, size)
    at_z = np.array([-far, 0.0, far])[:, None, None]
    moves = size * np.eye(len(size))
    J = np.stack([(_points(calibration, uv, at_z, m) - _points(calibration, uv, at_z, -m)) / 2 for m in moves], axis=-1)
    low, middle, high = (np.einsum("vuip,pq,vuiq->ivu", j, scaled, j) for j in J)
    return np.stack([middle, (high - low) / (2 * far), (high + low - 2 * middle) / (2 * far**2)], axis=1).astype(
        np.float32
    )


def moved_points(calibration: DepthCalibration, uv: Array, xyz: Array, errors: Iterable[Array]) -> Array:
    """Move points (n, 3) of pixels (n, 2) by errors (k, p) of the parameters with a covariance, shape (k, n, 3)."""
    z = _plate_z(calibration, np.asarray(xyz, np.float32)).astype(np.float64)
    moved = [(_points(calibration, uv, z, e) - _points(calibration, uv, z, -e)) / 2 for e in errors]
    return np.reshape(moved, (-1, *xyz.shape))


def _points(calibration: DepthCalibration, uv: Array, z: Array, change: Array) -> Array:
    """Where the rays of pixels (..., 2) meet the plate at z, of a shape that goes with theirs; parameters changed."""
    start, pose, axis = calibration.camera, calibration.camera_from_plate, calibration.axis_direction
    interior = start.changed(change[:-8])
    R = matrix_from_rotation_vector(rotation_vector_from_matrix(pose.rotation) + change[-8:-5])
    slopes = axis[:2] / axis[2] + change[-2:]
    direction = np.sign(axis[2]) * np.array([*slopes, 1.0]) / np.sqrt(1 + slopes @ slopes)
    rays = ray_directions(calibration.camera_spec, interior, uv)
    normal = R[:, 2]
    along = normal @ R @ direction * z
    reach = (normal @ (pose.translation_mm + change[-5:-2]) + along) / (rays @ normal)
    return np.asarray(rays * reach[..., None])
