"""What the report will say, and the files of the one that is written."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from core import pipeline
from core.errors import InputError
from core.lazy import dataclass
from core.model import PlaneEvaluation, Project
from core.pipeline.signed import load_sign_off
from core.progress import SILENT, Progress
from core.report import ReportPaths, SignOff, Summary, summary
from stripe_gui.presenters.calibrate import gather
from stripe_gui.presenters.folder import ProjectFolder, written_ns
from stripe_gui.presenters.stages import State
from stripe_gui.presenters.status import stage_statuses

if TYPE_CHECKING:
    from core.evaluate import Line


@dataclass(frozen=True)
class Wishes:
    """Which files the operator wants."""

    report: bool = True
    tables: bool = True
    profiles: bool = True
    deviations: bool = False


@dataclass(frozen=True)
class ReportView:
    """The summary of the results there are, and the report's files; a file is None where it is not written."""

    summary: Summary
    evaluations: tuple[PlaneEvaluation, ...]
    sign_off: SignOff | None
    html: Path | None
    pdf: Path | None
    written: str


def load_report(folder: ProjectFolder, progress: Progress = SILENT) -> ReportView:
    """Sum the results up and look for the files."""
    data = gather(folder)
    data = replace(data, sign_off=load_sign_off(folder.project, data.evaluations))
    progress.check()
    files = [folder.result_file(f"report/report.{kind}") for kind in ("html", "pdf")]
    html, pdf = (file if file.is_file() else None for file in files)
    at = written_ns(html) if html else None
    written = f"{datetime.fromtimestamp(at / 1e9):%Y-%m-%d %H:%M}" if at else ""
    return ReportView(summary(data), data.evaluations, data.sign_off, html, pdf, written)


def write_signed_report(
    project: Project, sign_off: SignOff | None, out: Path | None = None, progress: Progress = SILENT
) -> ReportPaths:
    """Sign the evaluation, or withdraw the sign-off, and write the report into the project or a folder.

    Planes are evaluated anew where that is out of date; nobody signs figures before he has seen them: InputError.
    """
    status = stage_statuses(ProjectFolder(project.path))["evaluate"]
    current = status.state is State.DONE
    if sign_off is not None and not current:
        raise InputError("sign-off", f"the evaluation is not up to date: {status.reason}", "evaluate, look, then sign")
    evaluations = pipeline.evaluate.load_evaluation(project) if current else None
    pipeline.signing.sign_project(project, sign_off, evaluations)
    return pipeline.report_project(project, out, progress, evaluations=evaluations)


def export_files(
    project: Project,
    sign_off: SignOff | None,
    line: Line | None,
    wishes: Wishes,
    out: Path,
    progress: Progress = SILENT,
) -> list[Path]:
    """Write what is wished for into a folder; give the files."""
    files: list[Path] = []
    if wishes.report:
        paths = write_signed_report(project, sign_off, out, progress.part(0.0, 0.5))
        files += [paths.html, paths.pdf]
    evaluations = pipeline.tables.kept_evaluation(project)
    if wishes.tables:
        files += pipeline.tables.export_tables(project, out, evaluations)
    if wishes.profiles:
        profiles = pipeline.tables.read_all_profiles(project, evaluations, line)
        files += pipeline.tables.export_profiles(profiles, out)
    if wishes.deviations:
        files += pipeline.tables.export_deviations(project, evaluations, out, progress=progress.part(0.5, 1.0))
    return files
