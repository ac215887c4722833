"""What the stages' buttons run: functions of a project and a progress, over `core.pipeline`."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from core import pipeline
from core.model import Calibration, Capture, Method, PhaseMap, PlaneEvaluation, Project, TargetSet
from core.pipeline import CalibrateOptions
from core.progress import SILENT, Progress


def decode_all(project: Project, progress: Progress = SILENT) -> int:
    """Decode every capture that was not decoded as it is now, and keep the figures; give the count.

    A capture that cannot be decoded is noted there, and told once the others are done.
    """
    return pipeline.decode_project(project, progress)


def measure(project: Project, progress: Progress = SILENT) -> tuple[TargetSet, ...]:
    """Measure the targets of all captures that have picks."""
    return pipeline.measure_project(project, progress)


@dataclass(frozen=True)
class CalibrateChoice:
    """What the operator chose for a calibration."""

    method: str = "all"  # "all", "photogrammetric", "polynomial"
    options: CalibrateOptions = CalibrateOptions()  # noqa: RUF009  frozen


def calibrate(project: Project, choice: CalibrateChoice, progress: Progress = SILENT) -> dict[Method, Calibration]:
    """Calibrate by the chosen method."""
    return pipeline.calibrate_project(project, choice.method, choice.options, progress)


def export_points(
    project: Project, capture: str, method: Method, out: Path, devices: dict[str, str], progress: Progress = SILENT
) -> int:
    """Write the points of a capture for another program, by the name's ending; give their number."""
    pipeline.check_cloud(out)
    phase, cloud = pipeline.reconstruct_capture(project, capture, method, progress=progress, **devices)  # type: ignore[arg-type]
    progress.check()
    return pipeline.write_cloud(out, phase.image, cloud)


def evaluate(
    project: Project,
    progress: Progress = SILENT,
    *,
    captures: Collection[str] | None = None,
    methods: Collection[Method] | None = None,
) -> tuple[PlaneEvaluation, ...]:
    """Judge plane captures by calibrations, all of either unless some are named."""
    return pipeline.evaluate_project(project, progress, captures=captures, methods=methods)


def decode_one(capture: Capture, progress: Progress = SILENT) -> PhaseMap:
    """Decode one capture, of one camera and one projector, for a look at it."""
    return pipeline.decode_capture(capture.path, progress, camera=capture.camera, projector=capture.projector)
