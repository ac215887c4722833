"""The device, camera and projector alike: from points to pixels, with derivatives, and from pixels to rays.

The collinearity image ``(x, y)`` of a point passes through the device's lens; ``(x", y")`` is what the device measures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from core.geometry.lens import distort, lens_of, undistort
from core.geometry.rotation import Pose
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Interior, NetworkDevice


def pixel_to_image(spec: DeviceSpec, uv: ArrayLike) -> Array:
    """Image coordinates (x, y) in mm, shape (..., 2), of pixel coordinates (u, v), shape (..., 2).

    Examples
    --------
    >>> pixel_to_image(DeviceSpec(3, 3, (0.5, 0.5), 10.0), [[0, 0], [1, 1]])
    array([[-0.5,  0.5],
           [ 0. ,  0. ]])
    """
    p = np.asarray(uv, dtype=np.float64)
    xy = np.empty(p.shape)
    xy[..., 0] = (p[..., 0] - (spec.width - 1) / 2) * spec.pitch_mm[0]
    xy[..., 1] = ((spec.height - 1) / 2 - p[..., 1]) * spec.pitch_mm[1]
    return xy


def image_to_pixel(spec: DeviceSpec, xy: ArrayLike) -> Array:
    """Pixel coordinates (u, v), shape (..., 2), of image coordinates (x, y) in mm, shape (..., 2)."""
    p = np.asarray(xy, dtype=np.float64)
    uv = np.empty(p.shape)
    uv[..., 0] = p[..., 0] / spec.pitch_mm[0] + (spec.width - 1) / 2
    uv[..., 1] = (spec.height - 1) / 2 - p[..., 1] / spec.pitch_mm[1]
    return uv


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
    xy = undistort(interior, pixel_to_image(spec, uv))
    directions = np.full((*xy.shape[:-1], 3), -1.0)
    np.divide(xy, interior.c_mm, out=directions[..., :2])
    return directions


def estimated(device: NetworkDevice) -> tuple[str, ...]:
    """Names of a device's parameters that are estimated, in its lens's order."""
    lens = lens_of(device.spec)
    wanted = lens.usual if device.estimate is None else device.estimate
    sigma = device.spec.interior_sigma or (1.0,) * len(lens.names)
    return tuple(name for name, s in zip(lens.names, sigma, strict=True) if name in wanted and s > 0)


@dataclass(frozen=True)
class Projection:
    """Pixel coordinates of points and their derivatives; NaN for points behind the device."""

    uv: Array  #: px of a camera, lines of a projector
    by_point: Array  #: (..., 2, 3): per mm of the point, in the frame it was given in
    by_interior: Array  #: (..., 2, k): per unit of c, x0, y0 and the additional parameters of the device's lens
    by_pose: Array  #: (..., 2, 6): per rad of a rotation vector w, ``R <- exp(w) R``, and per mm of the translation


def project_with_derivatives(
    spec: DeviceSpec, interior: Interior, points: ArrayLike, device_from_object: Pose | None = None
) -> Projection:
    """Project points, shape (..., 3), as `project` does, and differentiate.

    Notes
    -----
    With ``X = R P + t`` the collinearity image is ``x = -c X/Z, y = -c Y/Z``; the lens takes it to the measured one.
    """
    pose = device_from_object or Pose()
    turned = np.asarray(points, dtype=np.float64) @ pose.rotation.T
    X, Y, Z = np.moveaxis(turned + pose.translation_mm, -1, 0)
    k = interior.c_mm / np.where(Z < 0, -Z, np.nan)
    xy = np.stack([k * X, k * Y], axis=-1)
    by_xy, by_interior = lens_of(interior).derivatives(interior, xy)
    to_pixel = np.array([[1 / spec.pitch_mm[0]], [-1 / spec.pitch_mm[1]]])
    by_pose = np.empty((*k.shape, 2, 6))
    by_turn, by_device_point = by_pose[..., :3], by_pose[..., 3:]
    by_device_point[..., :2] = to_pixel * by_xy * k[..., None, None]
    along = by_xy[..., 0] * xy[..., None, 0] + by_xy[..., 1] * xy[..., None, 1]
    by_device_point[..., 2] = to_pixel[:, 0] * along / -Z[..., None]
    for j in range(3):  # (w × RP)·d = w·(RP × d)
        a, b = turned[..., None, j - 2], turned[..., None, j - 1]
        by_turn[..., j] = a * by_device_point[..., j - 1] - b * by_device_point[..., j - 2]
    return Projection(
        image_to_pixel(spec, distort(interior, xy)),
        (by_device_point.reshape(-1, 3) @ pose.rotation).reshape(by_device_point.shape),
        to_pixel * by_interior,
        by_pose,
    )
