"""Calibrations to and from other programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from core.atomic import check_place
from core.errors import InputError
from core.model import Adjustment, Concern, Network, NetworkDevice, PhotogrammetricCalibration, Project, verdict_of
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.folders import captures_of, check_names
from core.pipeline.method import ADJUSTMENT
from core.pipeline.methods import calibration_figures
from core.pipeline.options import CalibrateOptions
from core.pipeline.picking import current_target_sets
from core.pipeline.runs import Run, keep_run, now

if TYPE_CHECKING:
    from core.exchange import Format

WORSE_PX = 0.1  # r.m.s. that another program's model leaves: centroids of targets are measured to that at worst


def export_calibration(
    project: Project, name: str, path: Path, camera: str = "", projector: str = "", cameras: Sequence[str] = ()
) -> tuple[list[Path], dict[str, float]]:
    """Write the calibration of a camera and a projector, the first if none is named, or of two `cameras`: of those, if
    no projector is calibrated.

    Gives the files and, by device, what the other program's model leaves of ours, px r.m.s. over the image. InputError
    for an unknown format, no calibration, or one that the format cannot hold.
    """
    from core.exchange import fit_pair

    form = _format(name)
    check_place(path)
    calibration = photogrammetric_calibration(project)
    if not (calibration.projectors or cameras or camera or projector):
        cameras = calibration.cameras[:2]
    pair = fit_pair(calibration, form.free, *(cameras or (camera, projector)))
    return form.write(pair, path), {p.name: p.rms_px for p in (pair.camera, pair.projector)}


def import_calibration(
    project: Project, name: str, path: Path, camera: str = "", projector: str = "", cameras: Sequence[str] = ()
) -> PhotogrammetricCalibration:
    """Read another program's calibration of some of the project's devices, keep it as a run and put it in use.

    `camera` and `projector` name them; the first of each if unsaid. Or `cameras` names any number in the order of the
    file. Without a `projector` after them, it only labels corresponding places, and nothing of it is needed.

    InputError for an unknown format or device, or a file that does not hold as many devices of these sizes.
    """
    from core.exchange import pair_to_calibration

    form, rig = _format(name), project.rig
    check_names(project, "camera", filter(None, [camera, *cameras]))
    check_names(project, "projector", filter(None, [projector]))
    names = [*cameras, *filter(None, [projector])] if cameras else [*rig.pair(camera, projector)]
    if twice := next((name for name in cameras if cameras.count(name) > 1), ""):
        raise InputError("--cameras", f"names {twice} twice", "name the cameras in the order of the file")
    if len(names) < 2:
        raise InputError("--cameras", f"names {names[0]} alone", "name several cameras, or a projector too")
    pair = form.read(path, names)
    if (held := 2 + len(pair.more)) != len(names):
        seen = f"holds {held} devices, and {len(names)} are wanted: {', '.join(names)}"
        raise InputError(path, seen, "name those of the file, in its order, with --cameras and --projector")
    source = f"{path.name} ({name})"
    own = tuple(name for name in names if name in rig.cameras)
    calibration = pair_to_calibration(pair, {name: rig.devices[name] for name in names}, source, own)
    if concerns := _foreign(project, calibration):
        told = calibration.verdict.because if calibration.verdict else ()
        verdict = verdict_of([*concerns, *(Concern("doubtful", text) for text in told)])
        calibration = replace(calibration, verdict=verdict)
    run = Run(
        number=0,
        made_at=now(),
        options=CalibrateOptions(),
        captures={"photogrammetric": ()},
        excluded={},
        made_from={"photogrammetric": {"imported": path.name}},
        figures=calibration_figures({"photogrammetric": calibration}),
        name=f"imported from {path.name}",
    )
    keep_run(project, run, {"photogrammetric.npz": calibration, ADJUSTMENT: _no_adjustment(calibration)})
    return calibration


def _foreign(project: Project, calibration: PhotogrammetricCalibration) -> list[Concern]:
    """What the project's own boards and nominal values say against a calibration that came from elsewhere."""
    from core.checks import foreign_concerns, nominal_concerns, see_plates

    concerns = nominal_concerns(calibration.devices, calibration.cameras)
    for name, orientation in calibration.orientations.items():
        away, c = float(np.linalg.norm(orientation.device_from_base.origin_mm)), calibration.devices[name].interior.c_mm
        if away < c:
            text = f"{name} is {away:.2g} mm from {orientation.base}, less than its own c of {c:.3g} mm"
            concerns.append(Concern("doubtful", f"{text}: is the file in m instead of mm?"))
    if not calibration.projectors:
        return concerns
    boards = {c.name: c.testfield for c in captures_of(project, "testfield") if c.testfield is not None}
    own = calibration.camera_name, calibration.projector_name
    sets = [t for t in current_target_sets(project) if t.capture in boards and (t.camera, t.projector) == own]
    if not sets:
        return concerns
    board = boards[sets[0].capture]
    return [*concerns, *foreign_concerns(see_plates(calibration, sets, dict.fromkeys(boards, 0.0), board))]


def _format(name: str) -> Format:
    from core.exchange import FORMATS

    if name not in FORMATS:
        raise InputError("the format", f"{name!r} is unknown", f"choose {', '.join(sorted(FORMATS))}")
    return FORMATS[name]


def _no_adjustment(calibration: PhotogrammetricCalibration) -> Adjustment:
    """An adjustment without observations, in the place of the one that was made elsewhere."""
    devices = calibration.devices
    none, numbers = np.zeros((0, 2)), np.zeros(0, np.int64)
    network = Network(
        devices={name: NetworkDevice(device.spec) for name, device in devices.items()},
        station_names=(),
        station_device=(),
        station_pose=(),
        point_names=(),
        point_xyz_mm=np.zeros((0, 3)),
        observation_station=numbers,
        observation_point=numbers,
        observation_uv=none,
        observation_sigma=none,
    )
    return Adjustment(
        network=network,
        devices=devices,
        station_from_object=(),
        relative={name: known.device_from_base for name, known in calibration.orientations.items()},
        points_mm=np.zeros((0, 3)),
        point_cov_mm2=np.zeros((0, 3, 3)),
        residuals=none,
        redundancy_numbers=none,
        sigma0=1.0,
        redundancy=0,
        iterations=0,
        convergence=(),
        variance_factors={},
        parameter_names=(),
        parameter_cov=np.zeros((0, 0)),
        verdict=calibration.verdict,
    )
