"""What every capture of a board contributes to a calibration: its view of the board and its targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QCoreApplication

from core.geometry import Pose, matrix_from_rotation_vector, pixel_to_image
from core.model import Array, Capture, DeviceSpec, TargetSet
from core.progress import SILENT, Progress
from stripe_gui.presenters.folder import CaptureEntry, ProjectFolder

translate = QCoreApplication.translate
PERPENDICULAR_DEG = 10.0  # a board inclined by less counts as seen straight on


@dataclass(frozen=True)
class Contribution:
    """One capture as a source for a calibration.

    Attributes
    ----------
    name, role : str
    usable : bool
        Whether it can take part.
    roll_deg, tilt_deg : float or None
        Turn of the board about the viewing axis, and its inclination to the image plane; from the picks and the nominal
        camera.
    targets : int or None
        How many were measured last, None before measuring.
    excluded : int
        How many an operator excluded.
    remark : str
        What it adds, or why it cannot take part.
    """

    name: str
    role: str
    usable: bool
    roll_deg: float | None
    tilt_deg: float | None
    targets: int | None
    excluded: int
    remark: str


def contributions(folder: ProjectFolder, progress: Progress = SILENT) -> tuple[Contribution, ...]:
    """Describe the captures of boards, testfields before plates.

    Raises
    ------
    InputError
        If the measured targets are damaged.
    """
    measured = {t.capture: t for t in folder.result("targets.npz", tuple) or ()}
    camera = folder.project.camera
    entries = [*folder.of_role("testfield"), *folder.of_role("depth")]
    return tuple(_contribution(e, camera, measured.get(e.name)) for e in progress.over(entries, "{0.name}"))


def _contribution(entry: CaptureEntry, camera: DeviceSpec, measured: TargetSet | None) -> Contribution:
    capture = entry.capture
    assert capture is not None
    view = board_view(capture, camera)
    roll, tilt = view or (None, None)
    if capture.role == "depth":
        usable, remark = True, translate("Calibrate", "plate at {z:g} mm").format(z=capture.z_mm)
    elif not capture.seeds and (measured is None or not len(measured.row)):
        usable, remark = False, translate("Calibrate", "no targets picked yet")
    else:
        usable, remark = True, _adds(roll, tilt)
    count = len(measured.row) if measured is not None else None
    return Contribution(entry.name, capture.role, usable, roll, tilt, count, len(capture.excluded), remark)


def _adds(roll: float | None, tilt: float | None) -> str:
    """Say what a view of the testfield is good for."""
    if roll is None or tilt is None:
        return translate("Calibrate", "the picks do not fit the testfield")
    across = abs((roll + 45) % 180 - 45) > 45  # nearer to a quarter turn than to none or half a one
    turned = translate("Calibrate", "a quarter turn: A3, A4, x0, y0") if across else ""
    if tilt < PERPENDICULAR_DEG:
        seen = translate("Calibrate", "seen straight on: distortion")
    else:
        seen = translate("Calibrate", "inclined: c and the scale in depth")
    return "; ".join(text for text in (seen, turned) if text)


def board_view(capture: Capture, camera: DeviceSpec) -> tuple[float, float] | None:
    """How a camera sees a board: (roll, tilt) in degrees; None where the picks do not tell.

    The nominal camera is resected from the picks, so the angles are good to a few degrees. Roll is 0 where the board's
    rows run to the right in the image, and grows anticlockwise.
    """
    from core.calibrate.resection import resect

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
