"""Where a device sees or lights points of space, with the derivatives by all that matters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.geometry.device import image_to_pixel
from core.geometry.lens import distort, lens_of
from core.geometry.rotation import Pose
from core.model import DeviceSpec, Interior

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Projection:
    """Pixel coordinates of points and their derivatives; NaN for points behind the device.

    Attributes
    ----------
    uv : array, shape (..., 2)
        px of a camera, lines of a projector.
    by_point : array, shape (..., 2, 3)
        Per mm of the point, in the frame it was given in.
    by_interior : array, shape (..., 2, k)
        Per unit of c, x0, y0 and the additional parameters of the device's lens.
    by_pose : array, shape (..., 2, 6)
        Per rad of a rotation vector w, ``R <- exp(w) R``, and per mm of the translation.
    """

    uv: Array
    by_point: Array
    by_interior: Array
    by_pose: Array


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
    zero = np.zeros_like(k)
    ends = np.stack([np.stack([k, zero, -k * X / Z], -1), np.stack([zero, k, -k * Y / Z], -1)], axis=-2)
    to_pixel = np.array([[1 / spec.pitch_mm[0]], [-1 / spec.pitch_mm[1]]])
    by_device_point = to_pixel * (by_xy @ ends)
    by_turn = np.cross(turned[..., None, :], by_device_point)  # (w × RP)·d = w·(RP × d)
    return Projection(
        image_to_pixel(spec, distort(interior, xy)),
        by_device_point @ pose.rotation,
        to_pixel * by_interior,
        np.concatenate([by_turn, by_device_point], axis=-1),
    )
