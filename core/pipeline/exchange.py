"""Calibrations to and from other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from core.atomic import check_place
from core.errors import InputError
from core.model import Adjustment, Concern, Network, NetworkDevice, PhotogrammetricCalibration, Project, verdict_of
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.folders import captures_of
from core.pipeline.methods import calibration_figures
from core.pipeline.options import CalibrateOptions
from core.pipeline.picking import current_target_sets
from core.pipeline.runs import Run, keep_run, now

if TYPE_CHECKING:
    from core.exchange import Format


def export_calibration(
    project: Project, name: str, path: Path, camera: str = "", projector: str = ""
) -> tuple[list[Path], dict[str, float]]:
    """Write the calibration of a camera and a projector, the first if none is named, for another program.

    Gives the files and, by device, what the other program's model leaves of ours, px r.m.s. over the image. InputError
    for an unknown format, no calibration, or one that the format cannot hold.
    """
    from core.exchange import fit_pair

    form = _format(name)
    check_place(path)
    pair = fit_pair(photogrammetric_calibration(project), form.free, camera, projector)
    return form.write(pair, path), {p.name: p.rms_px for p in (pair.camera, pair.projector)}


def import_calibration(
    project: Project, name: str, path: Path, camera: str = "", projector: str = ""
) -> PhotogrammetricCalibration:
    """Read another program's calibration of two of the project's devices, keep it as a run and put it in use.

    `camera` and `projector` name them; the first of each if unsaid.

    InputError for an unknown format or device, or a file that does not hold a camera and a projector of these sizes.
    """
    from core.exchange import pair_to_calibration

    rig = project.rig
    names = camera or rig.camera_name, projector or rig.projector_name
    for device, of in zip(names, (rig.cameras, rig.projectors), strict=True):
        if device not in of:
            raise InputError(project.path / "project.json", f"has no {device!r}", f"choose {', '.join(of)}")
    pair, specs = _format(name).read(path), (rig.cameras[names[0]], rig.projectors[names[1]])
    calibration = pair_to_calibration(pair, *specs, f"{path.name} ({name})", names)
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
    keep_run(project, run, {"photogrammetric.npz": calibration, "adjustment.npz": _no_adjustment(calibration)})
    return calibration


def _foreign(project: Project, calibration: PhotogrammetricCalibration) -> list[Concern]:
    """What the project's own boards and nominal values say against a calibration that came from elsewhere."""
    from core.checks import foreign_concerns, nominal_concerns, see_plates

    concerns = nominal_concerns(calibration.devices, calibration.cameras)
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
        relative={calibration.projector_name: calibration.projector_from_camera},
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
