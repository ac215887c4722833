"""Stage 5: the points of one capture."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from core.atomic import check_place
from core.errors import InputError
from core.model import (
    Calibration,
    DepthCalibration,
    Floats,
    Method,
    Note,
    Pair,
    PhaseMap,
    PhotogrammetricCalibration,
    PointCloud,
    Project,
)
from core.parallel import beside
from core.pipeline.calibrate import chosen_calibration, methods_in_use, photogrammetric_calibration
from core.pipeline.decode import decode_series, one_series, phase_maps
from core.pipeline.evidence import points_of, shared_frames
from core.pipeline.folders import find_capture
from core.pipeline.judge import judge_points, said_of
from core.pipeline.method import CalibrationMethod, strangers
from core.pipeline.methods import METHODS
from core.pipeline.orient import oriented
from core.pipeline.runs import current_runs
from core.pipeline.views import joint_clouds
from core.progress import SILENT, Progress
from core.project import atomic_write

Asked = tuple[tuple[str, ...], tuple[Note, ...] | None]


def reconstruct_capture(
    project: Project,
    name: str,
    method: Method | None = None,
    extrapolate: bool = False,
    progress: Progress = SILENT,
    *,
    orient: bool = False,
    camera: str = "",
    projector: str = "",
    asked: Callable[[], Asked] | None = None,
) -> tuple[PhaseMap, PointCloud]:
    """Reconstruct one capture (by its name or its folder) with one calibration, the photogrammetric one by default.

    With `orient` the projector stands where `orient_capture(..., correct=True)` found it. `camera` and `projector`
    choose whose frames, where the capture holds those of several; points are in that camera's frame. Where cameras
    alone are calibrated, the others of the capture have a part in them. The points' verdict says what the capture and
    the calibration leave in doubt. `asked` is what `asked_beside` has begun.
    """
    chosen, calibration = chosen_calibration(project, method)
    record = METHODS[chosen]
    capture = one_series(find_capture(project, name), camera, projector)
    check_pair(project, record, calibration, capture.camera, capture.projector)
    used, extrapolated = calibration, 0
    if extrapolate and not isinstance(calibration, DepthCalibration):
        remedy = "leave it out, or reconstruct by a depth calibration"
        raise InputError("--extrapolate", f"does not go with the {chosen} method", remedy)
    if orient:
        if not isinstance(calibration, PhotogrammetricCalibration):
            raise InputError("--orient", f"does not go with the {chosen} method", "leave one of the two out")
        used = oriented(project, capture, calibration)
    cameras_alone = isinstance(calibration, PhotogrammetricCalibration) and not calibration.projectors
    if cameras_alone and capture.camera in calibration.devices:
        due = [s for s in find_capture(project, name).series if s.projector == capture.projector]
        phases = {phase.camera: phase for _, phase in phase_maps(project, due, progress.part(0.0, 0.5))}
        seen = [*phases.values()]
        with points_of(capture, seen):
            clouds = joint_clouds(seen, calibration, camera=capture.camera, progress=progress.part(0.5, 1.0))
        phase, cloud = phases[capture.camera], clouds[capture.camera]
    else:
        phase = decode_series(capture, project, progress.part(0.0, 0.5))
        seen = [phase]
        with points_of(capture, seen):
            cloud = record.reconstruct(phase, used, extrapolate, progress.part(0.5, 1.0))
            if extrapolate:
                inside = record.reconstruct(phase, used, False, SILENT).valid
                extrapolated = int(np.count_nonzero(cloud.valid & ~inside))
    shared = asked()[1] if asked else None
    if shared is None:
        shared = shared_frames(project, [capture])[capture.name]
    said = (*shared, *said_of(capture, seen, _witness(project, chosen, used)))
    return phase, judge_points(cloud, {capture.name: said}, chosen, calibration, extrapolated)


def asked_beside(project: Project, name: str, method: Method | None) -> Callable[[], Asked]:
    """Begin to find out whether the calibration follows from what is there, and what the capture's frames share.

    What is given waits for it: what speaks against the calibration, and notes on frames that other captures have, too;
    None where several devices took the capture.
    """

    def asked() -> Asked:
        from core.pipeline.report import outdated_words  # of the copy alone

        shared = None
        with suppress(InputError):  # which the reconstruction tells
            capture = find_capture(project, name)
            shared = shared_frames(project, [capture])[capture.name] if len(capture.series) == 1 else None
        return outdated_words(project, method or methods_in_use(project)[0]), shared

    return cache(beside(asked))


def _witness(project: Project, method: Method, used: Calibration | Pair) -> Calibration | Pair:
    """Give the calibration that tells whether the rig has moved: for one of depths, that of devices of the same run."""
    runs = current_runs(project)
    if isinstance(used, DepthCalibration) and runs.get("photogrammetric") == runs.get(method):
        return photogrammetric_calibration(project)
    return used


def check_pair(project: Project, record: CalibrationMethod, calibration: Any, camera: str, projector: str) -> None:
    """Refuse devices that a calibration is not of."""
    if lacking := strangers(project, calibration, camera, projector):
        seen = f"the {record.title} has no device {' and '.join(lacking)}"
        raise InputError(project.path, seen, f"it knows {', '.join(calibration.devices)}; calibrate the other, too")
    if not record.is_of(project, calibration, camera, projector):
        of, other = (" with ".join(pair) for pair in (record.pair(project, calibration), (camera, projector)))
        seen = f"the {record.title} is of {of}, not of {other}"
        raise InputError(
            project.path,
            seen,
            "calibrate it by `--method polynomial --camera NAME --projector NAME`, or use --method photogrammetric",
        )


def write_cloud(out: Path, image: Floats, cloud: PointCloud) -> int:
    """Write points with their grey values (H, W) in the form that the name's ending says; give the number of points."""
    from core.reconstruct import exporter_for

    exporter = exporter_for(out, joined=min(cloud.valid.shape) < 2)
    with atomic_write(out) as file:
        return exporter.write(file, cloud, image)


def check_cloud(out: Path, joined: bool = False) -> None:
    """Refuse a file that `write_cloud` could not write, before the work begins; `joined` of points without pixels."""
    from core.reconstruct import exporter_for

    exporter_for(out, joined)
    check_place(out)
