"""Depth by look-up: every pixel's own curve gives the plate's position, its ray the point on the plate.

At a pixel the measured u gives the plate position z at which the plate would be lit like that. The point is where the
pixel's ray meets the plate's plane at that position, so X and Y come from the camera's orientation.
"""

from __future__ import annotations

import numpy as np

from core.compiling import njit
from core.errors import NoCoordinateError
from core.model import DepthCalibration, PhaseMap, PointCloud
from core.parallel import run_in_bands
from core.reconstruct.lookup_sigma import add_curves, whole_sigma
from core.reconstruct.rays import camera_rays, flat


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
    pose = calibration.camera_from_plate
    normal = pose.rotation[:, 2]  # the plate is its own plane z = 0
    at_zero = float(normal @ pose.translation_mm)
    per_mm = float(normal @ (pose.rotation @ calibration.axis_direction))
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
