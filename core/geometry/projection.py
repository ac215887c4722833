"""Where a device sees or lights points of space, with the derivatives by all that matters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from core.geometry.device import image_to_pixel
from core.geometry.lens import distort, lens_of
from core.geometry.rotation import Pose
from core.model import Array, DeviceSpec, Interior


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
