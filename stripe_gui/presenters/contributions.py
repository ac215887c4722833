"""What every capture of a board contributes to a calibration: its view of the board and its targets."""

from __future__ import annotations

from collections.abc import Mapping

from core.errors import InputError
from core.lazy import dataclass
from core.measure import measured_view, predicted_view
from core.model import Capture, DeviceSpec, TargetSet
from core.pipeline import METHODS
from core.progress import SILENT, Progress
from stripe_gui.presenters.folder import CaptureEntry, ProjectFolder
from stripe_gui.presenters.told import translate

PERPENDICULAR_DEG = 10.0  # a board inclined by less counts as seen straight on


@dataclass(frozen=True)
class Contribution:
    """One capture as a source for a calibration."""

    name: str
    role: str
    usable: bool  #: whether it can take part
    #: roll_deg, tilt_deg: turn of the board about the viewing axis, and its inclination to the image plane; from the
    #: targets measured, else from the picks, and the nominal camera
    roll_deg: float | None
    tilt_deg: float | None
    targets: int | None  #: how many were measured last, None before measuring
    excluded: int  #: how many an operator excluded
    remark: str  #: what it adds, or why it cannot take part


def contributions(folder: ProjectFolder, progress: Progress = SILENT) -> tuple[Contribution, ...]:
    """Describe the captures that methods read, testfields before plates."""
    measured: dict[str, TargetSet] = {}
    for targets in folder.result("targets.npz", tuple) or ():
        measured.setdefault(targets.capture, targets)  # of several cameras the first
    cameras = folder.project.rig.cameras
    roles = dict.fromkeys(role for method in METHODS.values() for role in method.roles)
    entries = [entry for role in roles for entry in folder.of_role(role)]
    return tuple(_contribution(e, cameras, measured.get(e.name)) for e in progress.over(entries, "{0.name}"))


def _contribution(entry: CaptureEntry, cameras: Mapping[str, DeviceSpec], measured: TargetSet | None) -> Contribution:
    assert entry.capture is not None
    capture = entry.capture.series[0]
    roll, tilt = _angles(capture, cameras[capture.camera], measured) or (None, None)
    if capture.role == "depth":
        remark = translate("Calibrate", "plate at {z:g} mm").format(z=capture.z_mm)
    elif capture.role != "testfield":
        remark = ""
    elif roll is None and not capture.seeds:
        remark = translate("Calibrate", "nothing picked: its targets are told by themselves, if the board allows")
    else:
        remark = _adds(roll, tilt)
    usable = any(method.uses(capture) for method in METHODS.values())
    count = len(measured.row) if measured is not None else None
    return Contribution(entry.name, capture.role, usable, roll, tilt, count, len(capture.excluded), remark)


def _angles(capture: Capture, camera: DeviceSpec, measured: TargetSet | None) -> tuple[float, float] | None:
    """Roll and tilt of the board, None where nothing tells."""
    if (field := capture.testfield) is None:
        return None
    try:
        view = measured_view(field, camera, measured) if measured is not None else None
        if view is None and capture.seeds:
            view = predicted_view(field, camera, capture.seeds)
    except (InputError, KeyError):  # picks that cannot be right, targets of a board that was replaced
        return None
    return view.angles_deg if view is not None else None


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
