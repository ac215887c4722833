"""Stage 7: tables, HTML and PDF from what the project holds."""

from __future__ import annotations

import json
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from core.model import Adjustment, PlaneEvaluation, Project
from core.pipeline.calibrate import load_calibrations
from core.pipeline.evaluate import evaluate_project
from core.pipeline.folders import captures_of, result_path
from core.progress import SILENT, Progress
from core.project import load_archive

if TYPE_CHECKING:
    from core.report import ReportData, ReportPaths


def report_data(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> ReportData:
    """Gather what a report tells of, from the project's results."""
    from core.report import ReportData

    calibrations = load_calibrations(project)
    adjustment = None
    if "photogrammetric" in calibrations:
        adjustment = load_archive(result_path(project, "adjustment.npz"), Adjustment)
    truth = project.path / "truth.json"
    return ReportData(
        project=project,
        adjustment=adjustment,
        photogrammetric=calibrations.get("photogrammetric"),  # type: ignore[arg-type]
        depth=calibrations.get("polynomial"),  # type: ignore[arg-type]
        evaluations=evaluations,
        truth=json.loads(truth.read_text()) if truth.exists() else None,
        made_on=f"{date.today():%Y-%m-%d}",
        made_by=f"stripe-core {version('stripe-workbench')}",
    )


def report_project(project: Project, out: Path | None = None, progress: Progress = SILENT) -> ReportPaths:
    """Write the HTML and PDF report from the project's calibrations; its planes are evaluated by them first."""
    from core.report import write_report

    evaluations: tuple[PlaneEvaluation, ...] = ()
    if captures_of(project, "plane"):
        evaluations = evaluate_project(project, progress.part(0.0, 0.5))
    data = report_data(project, evaluations)
    return write_report(data, out or result_path(project, "report"), progress=progress.part(0.5, 1.0))


def result_tables(project: Project, evaluations: tuple[PlaneEvaluation, ...] = ()) -> str:
    """Tables 1 to 3 of a project's results as text."""
    from core.report import tables, text_table

    return "\n\n".join(text_table(table) for table in tables(report_data(project, evaluations)))
