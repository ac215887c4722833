"""How a camera sees a board, before anything is calibrated: from the picks and the nominal camera."""

from __future__ import annotations

import numpy as np

from core.calibrate.resection import resect
from core.geometry import Pose, matrix_from_rotation_vector, pixel_to_image
from core.model import Array, Capture, DeviceSpec


def board_view(capture: Capture, camera: DeviceSpec) -> tuple[float, float] | None:
    """How a camera sees a board: (roll, tilt) in degrees; None where the picks do not tell.

    The nominal camera is resected from the picks, so the angles are good to a few degrees. Roll is 0 where the board's
    rows run to the right in the image, and grows anticlockwise.
    """
    field = capture.testfield
    if field is None or len(capture.seeds) < 4:
        return None
    index = field.index()
    if not all((s.row, s.col) in index for s in capture.seeds):
        return None
    points = field.xyz_mm[[index[s.row, s.col] for s in capture.seeds]]
    image = pixel_to_image(camera, np.array([[s.u, s.v] for s in capture.seeds])) / camera.nominal_c_mm
    fitted = [_fitted(pose, points, image) for pose in resect(points, image)]
    return view_angles(min(fitted, key=lambda fit: fit[1])[0]) if fitted else None


def view_angles(camera_from_board: Array) -> tuple[float, float]:
    """Roll and tilt in degrees of a board seen from its front or, where its Z axis points away, from its back."""
    R = np.asarray(camera_from_board)
    if R[2, 2] < 0:
        R = R @ np.diag([1.0, -1.0, -1.0])
    roll = float(np.degrees(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))
    return roll, float(np.degrees(np.arccos(np.clip(R[2, 2], -1.0, 1.0))))


def _fitted(pose: Pose, points: Array, image: Array) -> tuple[Array, float]:
    """Improve a resected pose by least squares; give its rotation and what is left of the misfit."""
    from scipy.optimize import least_squares

    size = float(np.linalg.norm(pose.translation_mm))

    def rotation(step: Array) -> Array:
        return np.asarray(matrix_from_rotation_vector(step[:3]) @ pose.rotation)

    def misfit(step: Array) -> Array:
        seen = points @ rotation(step).T + pose.translation_mm + size * step[3:]
        return np.asarray((-seen[:, :2] / seen[:, 2:] - image).ravel())

    found = least_squares(misfit, np.zeros(6), method="lm")
    return rotation(found.x), float(found.cost)
