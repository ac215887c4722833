"""What the plane-table wizard offers, and what it writes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QCoreApplication

from core import pipeline
from core.model import Project
from core.pipeline import METHODS
from core.progress import SILENT, Progress
from core.report import ReportPaths, SignOff, table_file, write_table_csv
from stripe_gui.presenters.evaluate import EvaluationView, Pair, angle_text
from stripe_gui.presenters.folder import ProjectFolder, written_ns
from stripe_gui.presenters.status import StageStatus, State, method_name

translate = QCoreApplication.translate
UM = 1000.0


@dataclass(frozen=True)
class Choice:
    """Something to tick: its name for the program, as the operator reads it, and where it stands."""

    name: str
    title: str
    state: str


@dataclass(frozen=True)
class Wishes:
    """Which files the operator wants."""

    report: bool = True
    table: bool = True
    profiles: bool = True
    deviations: bool = False


def plane_choices(folder: ProjectFolder) -> list[Choice]:
    """List the plane captures with angle, date, and whether they are evaluated as they are now."""
    evaluated = {e.capture for e in folder.result("evaluation.npz", tuple) or ()}
    at = written_ns(folder.result_file("evaluation.npz")) or 0
    found = []
    for entry in folder.of_role("plane"):
        if entry.name not in evaluated:
            state = translate("PlaneTable", "not evaluated")
        elif entry.recorded_ns > at:
            state = translate("PlaneTable", "changed since it was evaluated")
        else:
            state = translate("PlaneTable", "evaluated")
        when = translate("PlaneTable", "captured {when}").format(when=_when(entry.recorded_ns))
        found.append(
            Choice(entry.name, f"{entry.name}   {angle_text(entry.capture.angle_deg)}".rstrip(), f"{when}, {state}")
        )
    return found


def calibration_choices(folder: ProjectFolder, statuses: Mapping[str, StageStatus]) -> list[Choice]:
    """List the calibrations with date, run, and whether they are out of date."""
    runs = pipeline.current_runs(folder.project)
    status = statuses.get("calibrate")
    stale = status is not None and status.state is State.STALE
    found = []
    for method in METHODS:
        at = written_ns(folder.result_file(f"{method}.npz"))
        if at is None:
            continue
        parts = [translate("PlaneTable", "calibrated {when}").format(when=_when(at))]
        if method in runs:
            parts.append(translate("PlaneTable", "run {n}").format(n=runs[method]))
        if stale:
            parts.append(translate("PlaneTable", "out of date: {reason}").format(reason=status.reason))
        else:
            parts.append(translate("PlaneTable", "up to date"))
        found.append(Choice(method, method_name(method), ", ".join(parts)))
    return found


def is_evaluated(
    folder: ProjectFolder, view: EvaluationView | None, captures: Collection[str], methods: Collection[str]
) -> bool:
    """Say whether the evaluation there is holds just these planes by these methods, as they are now.

    A calibration that is out of date may be judged all the same: its line says so.
    """
    if view is None:
        return False
    at = written_ns(folder.result_file("evaluation.npz")) or 0
    inputs = [entry.recorded_ns for entry in folder.of_role("plane") if entry.name in captures]
    inputs += [written_ns(folder.result_file(f"{method}.npz")) or 0 for method in methods]
    made = {(e.capture, e.method) for e in view.evaluations if e.camera is not None}
    return made == {(c, m) for c in captures for m in methods} and max(inputs, default=0) <= at


def write_signed_report(project: Project, sign_off: SignOff | None, progress: Progress = SILENT) -> ReportPaths:
    """Sign the project's evaluation and write the report into the project."""
    evaluations = pipeline.load_evaluation(project)
    pipeline.sign_project(project, sign_off, evaluations)
    return pipeline.report_project(project, progress=progress, evaluations=evaluations)


def export_files(
    project: Project,
    view: EvaluationView,
    sign_off: SignOff | None,
    line: tuple[Pair, Pair],
    wishes: Wishes,
    out: Path,
    progress: Progress = SILENT,
) -> list[Path]:
    """Write what is wished for into a folder; give the files.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    pipeline.sign_project(project, sign_off, view.evaluations)
    files: list[Path] = []
    if wishes.table:
        files.append(out / table_file(view.table))
        write_table_csv(files[-1], view.table)
    if wishes.profiles:
        files += pipeline.export_profiles(project, view.evaluations, out, line)
    if wishes.deviations:
        files += pipeline.export_deviations(project, view.evaluations, out, progress=progress.part(0.0, 0.5))
    if wishes.report:
        paths = pipeline.report_project(project, out, progress.part(0.5, 1.0), evaluations=view.evaluations)
        files += [paths.html, paths.pdf]
    return files


def _when(at_ns: int) -> str:
    return f"{datetime.fromtimestamp(at_ns / 1e9):%Y-%m-%d %H:%M}"
