"""What the stages' buttons run: functions of a project and a progress, over `core.pipeline`."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from core import pipeline
from core.errors import StripeError
from core.figures import phase_figures
from core.model import Calibration, Method, PhaseMap, PlaneEvaluation, Project, TargetSet
from core.pipeline import CalibrateOptions
from core.progress import SILENT, Progress
from core.project import write_json
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.status import decoded_captures


def decode_all(project: Project, progress: Progress = SILENT) -> int:
    """Decode every capture that was not decoded as it is now; keep the figures in results/decode.json; give the count.

    A capture that cannot be decoded is noted there, and told once the others are done.
    """
    folder = ProjectFolder(project.path)
    kept = decoded_captures(project.path)
    entries = [e for e in folder.captures() if e.capture]
    kept = {e.name: kept[e.name] for e in entries if e.name in kept}
    due = [e for e in entries if kept.get(e.name, {}).get("recorded_ns") != e.recorded_ns or kept[e.name].get("error")]
    problem: StripeError | None = None
    for entry in progress.over(due, "{0.name}"):
        try:
            figures = phase_figures(pipeline.decode_capture(entry.folder))
        except StripeError as error:
            problem = problem or error
            figures = {"error": str(error)}
        kept[entry.name] = {"recorded_ns": entry.recorded_ns, **figures}
        write_json(project.path / "results" / "decode.json", {"captures": kept})
    if problem is not None:
        raise problem
    return len(due)


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
    return pipeline.calibrate_project(project, choice.method, choice.options, progress)  # type: ignore[arg-type]


def cloud_file(project: Project, capture: str, method: str) -> Path:
    """Where the program keeps the points of a capture."""
    return pipeline.result_path(project, f"points/{capture}.{method}.npz")


def reconstruct(project: Project, capture: str, method: Method, progress: Progress = SILENT) -> Path:
    """Reconstruct a capture and keep its points in the project; give the file."""
    phase, cloud = pipeline.reconstruct_capture(project, capture, method, progress=progress)
    progress.check()
    path = cloud_file(project, capture, method)
    pipeline.write_cloud(path, phase, cloud)
    return path


def export_points(project: Project, capture: str, method: Method, out: Path, progress: Progress = SILENT) -> int:
    """Write the points of a capture for another program, by the name's ending; give their number."""
    pipeline.check_cloud(out)
    phase, cloud = pipeline.reconstruct_capture(project, capture, method, progress=progress)
    progress.check()
    return pipeline.write_cloud(out, phase, cloud)


def evaluate(
    project: Project,
    progress: Progress = SILENT,
    *,
    captures: Collection[str] | None = None,
    methods: Collection[Method] | None = None,
) -> tuple[PlaneEvaluation, ...]:
    """Judge plane captures by calibrations, all of either unless some are named."""
    return pipeline.evaluate_project(project, progress, captures=captures, methods=methods)


def decode_one(folder: Path, progress: Progress = SILENT) -> PhaseMap:
    """Decode one capture for a look at it."""
    return pipeline.decode_capture(folder, progress)
