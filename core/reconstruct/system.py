"""What of a photogrammetric calibration is prepared once and used for every capture.

A camera pixel with viewing direction d (Z = -1) sees the points ``X = d / q`` with the inverse depth q = -1/Z. In the
projector the point has the homogeneous image ``M d + m q`` with ``M = K R``, ``m = K t``, ``K = diag(c, c, -1)``:
linear in q, which is why everything here is written in q.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from core.geometry import Pose, image_to_pixel, lens_of
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Floats, Interior, Pair
from core.reconstruct.rays import camera_rays
from core.reconstruct.sigma_table import Devices, SigmaTable, depth_slopes, make_table

COMPILED = "A1..A6"  # the lens model of the projector that the kernel knows


@dataclass(frozen=True)
class System:
    """A calibration prepared for forward intersection."""

    rays: Floats  #: (H, W, 2): viewing directions of the camera's pixels, see `camera_rays`
    #: matrix, vector: (3, 3): m and m of the module's text
    matrix: Array
    vector: Array
    #: (A1, A2, A5, A6, -A1 r0² - A2 r0⁴) of the projector; None for another lens model than A1..A6
    radial: tuple[float, float, float, float, float] | None
    #: line_u, line_v: (k0, kx, ky): the projector coordinate is k0 + kx x' + ky y', with (x', y') the image after
    #: radial and decentring parameters, without principal point; affine parameters, principal point and pitch are in
    #: the three
    line_u: tuple[float, float, float]
    line_v: tuple[float, float, float]
    slopes: tuple[float, float]  #: how much u and v change with depth, see `depth_slopes`
    devices: Devices


Key = tuple[DeviceSpec, Interior, DeviceSpec, Interior, bytes, bytes]  # an array cannot be the key of a cache


def prepare(calibration: Pair) -> System:
    """Prepare a calibration; the last two are remembered."""
    return _prepare(_key(calibration))


def sigma_table(calibration: Pair, axes: str) -> SigmaTable:
    """Give the table of what the covariance does to points, for the observed axes.

    `axes` is "u", "v" or "uv", in any order; the last four tables are remembered.
    """
    return _table(_key(calibration), np.ascontiguousarray(calibration.covariance, np.float64).tobytes(), axes)


def _key(calibration: Pair) -> Key:
    camera, projector, pose = calibration.camera, calibration.projector, calibration.projector_from_camera
    turn, shift = (np.ascontiguousarray(a, np.float64).tobytes() for a in (pose.rotation, pose.translation_mm))
    return camera.spec, camera.interior, projector.spec, projector.interior, turn, shift


def _devices(key: Key) -> Devices:
    pose = Pose(np.frombuffer(key[4]).reshape(3, 3), np.frombuffer(key[5]))
    return Devices((key[0], key[1]), (key[2], key[3]), pose)


@lru_cache(maxsize=4)
def _table(key: Key, covariance: bytes, axes: str) -> SigmaTable:
    matrix = np.frombuffer(covariance)
    return make_table(_devices(key), matrix.reshape(round(matrix.size**0.5), -1), axes)


@lru_cache(maxsize=2)
def _prepare(key: Key) -> System:
    devices = _devices(key)
    spec, interior = devices.projector
    lens = lens_of(interior)
    # without what bends straight lines a lens is an affine map of the collinearity image
    plain = lens.plain(interior)
    at_zero, by_xy = image_to_pixel(spec, lens.distort(plain, np.zeros(2))), lens.derivatives(plain, np.zeros(2))[0]
    affine = by_xy / np.array([[spec.pitch_mm[0]], [-spec.pitch_mm[1]]])
    zero, radial = at_zero, None
    if lens.name == COMPILED:
        a1, a2, _, _, a5, a6 = interior.a
        r02 = interior.r0_mm**2
        radial = (a1, a2, a5, a6, -a1 * r02 - a2 * r02 * r02)
    K = np.array([interior.c_mm, interior.c_mm, -1.0])
    return System(
        rays=camera_rays(*devices.camera),
        matrix=K[:, None] * devices.projector_from_camera.rotation,
        vector=K * devices.projector_from_camera.translation_mm,
        radial=radial,
        line_u=(float(zero[0]), float(affine[0, 0]), float(affine[0, 1])),
        line_v=(float(zero[1]), float(affine[1, 0]), float(affine[1, 1])),
        slopes=depth_slopes(devices),
        devices=devices,
    )
