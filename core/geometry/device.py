"""The device with interior orientation and six additional parameters, camera and projector alike.

The collinearity image ``(x, y)`` of a point passes through the additional parameters A1..A6; ``(x", y")`` is what the
device measures. A1, A2 are radial (zero crossing at r0), A3 and A4 affine, A5 and A6 decentring. The set is the one of
Brenner, Böhm, Gühring (1999), section 3; cf. Brown, *Close-range camera calibration* (1971).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.geometry.rotation import Pose
from core.model import DeviceSpec, Interior

Array = NDArray[np.float64]


def pixel_to_image(spec: DeviceSpec, uv: ArrayLike) -> Array:
    """Image coordinates (x, y) in mm, shape (..., 2), of pixel coordinates (u, v), shape (..., 2).

    Examples
    --------
    >>> pixel_to_image(DeviceSpec(3, 3, (0.5, 0.5), 10.0), [[0, 0], [1, 1]])
    array([[-0.5,  0.5],
           [ 0. ,  0. ]])
    """
    p = np.asarray(uv, dtype=np.float64)
    x = (p[..., 0] - (spec.width - 1) / 2) * spec.pitch_mm[0]
    y = ((spec.height - 1) / 2 - p[..., 1]) * spec.pitch_mm[1]
    return np.stack([x, y], axis=-1)


def image_to_pixel(spec: DeviceSpec, xy: ArrayLike) -> Array:
    """Pixel coordinates (u, v), shape (..., 2), of image coordinates (x, y) in mm, shape (..., 2)."""
    p = np.asarray(xy, dtype=np.float64)
    u = p[..., 0] / spec.pitch_mm[0] + (spec.width - 1) / 2
    v = (spec.height - 1) / 2 - p[..., 1] / spec.pitch_mm[1]
    return np.stack([u, v], axis=-1)


def distort(interior: Interior, xy: ArrayLike) -> Array:
    """From the collinearity image (x, y) to the measured image (x", y"), both mm, shape (..., 2).

    Notes
    -----
    With ``r² = x² + y²`` and ``d = A1 (r² - r0²) + A2 (r⁴ - r0⁴)``::

        x' = x + x d + 2 A5 x y + A6 (r² + 2x²) + x0        x" = x' + A3 x' + A4 y'
        y' = y + y d + 2 A6 x y + A5 (r² + 2y²) + y0        y" = y' + A4 x' - A3 y'
    """
    p = np.asarray(xy, dtype=np.float64)
    x, y = p[..., 0], p[..., 1]
    a1, a2, a3, a4, a5, a6 = interior.a
    r2, r02 = x * x + y * y, interior.r0_mm**2
    d = a1 * (r2 - r02) + a2 * (r2 * r2 - r02 * r02)
    x1 = x + x * d + 2 * a5 * x * y + a6 * (r2 + 2 * x * x) + interior.x0_mm
    y1 = y + y * d + 2 * a6 * x * y + a5 * (r2 + 2 * y * y) + interior.y0_mm
    return np.stack([x1 + a3 * x1 + a4 * y1, y1 + a4 * x1 - a3 * y1], axis=-1)


def undistort(interior: Interior, measured_xy: ArrayLike, tolerance_mm: float = 1e-9) -> Array:
    """From the measured image (x", y") back to the collinearity image (x, y), both mm, shape (..., 2).

    Newton's method on `distort` with its analytic Jacobian; points where it does not converge within 20 steps (outside
    the range in which the polynomial can be inverted) are NaN.
    """
    m = np.asarray(measured_xy, dtype=np.float64)
    a1, a2, a3, a4, a5, a6 = interior.a
    det = (1 + a3) * (1 - a3) - a4 * a4
    # the affine step is linear and is undone in closed form
    x1 = ((1 - a3) * m[..., 0] - a4 * m[..., 1]) / det - interior.x0_mm
    y1 = ((1 + a3) * m[..., 1] - a4 * m[..., 0]) / det - interior.y0_mm
    x, y = x1.copy(), y1.copy()
    r02 = interior.r0_mm**2
    step = np.full(x.shape, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(20):
            r2 = x * x + y * y
            d = a1 * (r2 - r02) + a2 * (r2 * r2 - r02 * r02)
            fx = x + x * d + 2 * a5 * x * y + a6 * (r2 + 2 * x * x) - x1
            fy = y + y * d + 2 * a6 * x * y + a5 * (r2 + 2 * y * y) - y1
            dr = 2 * (a1 + 2 * a2 * r2)
            jxx = 1 + d + x * x * dr + 2 * a5 * y + 6 * a6 * x
            jxy = x * y * dr + 2 * a5 * x + 2 * a6 * y
            jyy = 1 + d + y * y * dr + 2 * a6 * x + 6 * a5 * y
            j = jxx * jyy - jxy * jxy
            sx, sy = (jyy * fx - jxy * fy) / j, (jxx * fy - jxy * fx) / j
            x, y = x - sx, y - sy
            step = np.hypot(sx, sy)
            if not np.any(step > tolerance_mm):
                break
    lost = ~(step <= tolerance_mm)
    return np.stack([np.where(lost, np.nan, x), np.where(lost, np.nan, y)], axis=-1)


def project(spec: DeviceSpec, interior: Interior, points: ArrayLike, device_from_object: Pose | None = None) -> Array:
    """Pixel coordinates (u, v), shape (..., 2), at which a device sees (or lights) points, shape (..., 3), in mm.

    Points are in the object frame if `device_from_object` is given, else in the device frame. A point behind the device
    (Z >= 0) is NaN.
    """
    p = np.asarray(points, dtype=np.float64) if device_from_object is None else device_from_object.apply(points)
    depth = np.where(p[..., 2] < 0, -p[..., 2], np.nan)
    return image_to_pixel(spec, distort(interior, interior.c_mm * p[..., :2] / depth[..., None]))


def ray_directions(spec: DeviceSpec, interior: Interior, uv: ArrayLike) -> Array:
    """Directions in the device frame, shape (..., 3), with Z = -1, in which pixels (u, v), shape (..., 2), look."""
    xy = undistort(interior, pixel_to_image(spec, uv)) / interior.c_mm
    return np.concatenate([xy, np.full((*xy.shape[:-1], 1), -1.0)], axis=-1)
