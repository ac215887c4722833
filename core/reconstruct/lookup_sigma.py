"""What the camera's orientation and the noise of the curves leave uncertain of points that were looked up.

A point is ``X = d s`` on its pixel's ray d, where the plate stood at position z: ``s = (n t + n a z) / (n d)`` is
linear in z, and so are its derivatives by the interior orientation, the plate's pose and its axis. So each variance is
a quadratic in z, with coefficients that change slowly over the image: they are worked out on a grid of pixels and
interpolated. The curves' noise moves z itself, along the ray as the noise of the capture does.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from core.geometry import matrix_from_rotation_vector, ray_directions, rotation_vector_from_matrix
from core.model import Array, DepthCalibration, Floats

NODES = 24  # along the longer side: between them the variances are even to 1 %
STEP = 0.02  # sigmas, of the numerical derivatives
_last: list[tuple[Any, ...]] = []  # calibration and image size asked for last, and the coefficients: every capture asks


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
    pose = calibration.camera_from_plate
    normal = pose.rotation[:, 2]
    per_mm = float(normal @ pose.rotation @ calibration.axis_direction)
    return np.asarray(
        ((xyz @ normal.astype(np.float32)) - np.float32(normal @ pose.translation_mm)) / np.float32(per_mm)
    )


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
    at_z = np.array([-far, 0.0, far])
    moves = size * np.eye(len(size))
    J = np.stack([(_points(calibration, uv, at_z, m) - _points(calibration, uv, at_z, -m)) / 2 for m in moves], axis=-1)
    low, middle, high = (np.einsum("vuip,pq,vuiq->ivu", j, scaled, j) for j in J)
    return np.stack([middle, (high - low) / (2 * far), (high + low - 2 * middle) / (2 * far**2)], axis=1).astype(
        np.float32
    )


def _points(calibration: DepthCalibration, uv: Array, z: Array, change: Array) -> Array:
    """Where the rays of pixels (..., 2) meet the plate at each z (k,), with the parameters changed: (k, ..., 3)."""
    start, pose, axis = calibration.camera, calibration.camera_from_plate, calibration.axis_direction
    interior = start.changed(change[:-8])
    R = matrix_from_rotation_vector(rotation_vector_from_matrix(pose.rotation) + change[-8:-5])
    slopes = axis[:2] / axis[2] + change[-2:]
    direction = np.sign(axis[2]) * np.array([*slopes, 1.0]) / np.sqrt(1 + slopes @ slopes)
    rays = ray_directions(calibration.camera_spec, interior, uv)
    normal = R[:, 2]
    along = normal @ R @ direction * z[:, None, None]
    reach = (normal @ (pose.translation_mm + change[-5:-2]) + along) / (rays @ normal)
    return np.asarray(rays * reach[..., None])
