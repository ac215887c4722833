"""Stage 7: tables, HTML and PDF from what the project holds."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.atomic import check_place
from core.errors import InputError
from core.fields import Fields, regular
from core.figures import evaluation_figures
from core.model import Adjustment, PlaneEvaluation, Project
from core.pipeline.calibrate import load_calibrations
from core.pipeline.evaluate import evaluate_project
from core.pipeline.folders import captures_of, known_truth, result_path
from core.progress import SILENT, Progress
from core.project import load_archive, write_json

if TYPE_CHECKING:
    from core.report import ReportData, ReportPaths, SignOff


def report_data(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> ReportData:
    """Gather what a report tells of, from the project's results."""
    from core.report import ReportData

    calibrations = load_calibrations(project)
    adjustment = None
    if "photogrammetric" in calibrations:
        adjustment = load_archive(result_path(project, "adjustment.npz"), Adjustment)
        if not len(adjustment.residuals):
            adjustment = None  # calibrated by another program
    return ReportData(
        project=project,
        adjustment=adjustment,
        photogrammetric=calibrations.get("photogrammetric"),  # type: ignore[arg-type]
        depth=calibrations.get("polynomial"),  # type: ignore[arg-type]
        evaluations=evaluations,
        truth=known_truth(project),
        made_on=f"{date.today():%Y-%m-%d}",
        made_by=f"stripe-core {version('stripe-workbench')}",
        sign_off=load_sign_off(project, evaluations),
    )


def report_project(
    project: Project,
    out: Path | None = None,
    progress: Progress = SILENT,
    *,
    evaluations: tuple[PlaneEvaluation, ...] | None = None,
) -> ReportPaths:
    """Write the HTML and PDF report from the project's calibrations.

    Its planes are evaluated by them first, unless `evaluations` of a moment ago are given.
    """
    from core.report import write_report

    out = out or result_path(project, "report")
    for name in ("report.html", "report.pdf"):
        check_place(out / name)
    data = report_data(project, evaluations or ())  # a damaged result is told before the evaluation is written anew
    if evaluations is None:
        planes = captures_of(project, "plane")
        evaluations = evaluate_project(project, progress.part(0.0, 0.5)) if planes else ()
        data = replace(data, evaluations=evaluations, sign_off=load_sign_off(project, evaluations))
    return write_report(data, out, progress=progress.part(0.5, 1.0))


def save_sign_off(project: Project, sign_off: SignOff, evaluations: tuple[PlaneEvaluation, ...]) -> Path:
    """Keep who signed for these figures; the figures stay with it, so that it lapses when others take their place."""
    path = result_path(project, "sign-off.json")
    if not sign_off.despite.strip() and (failed := failed_verdicts(project, evaluations)):
        remedy = "see to its cause, or write why you sign all the same (`despite`, in the window the remark)"
        raise InputError("sign-off", f"the verdict failed: {failed[0]}", remedy)
    signed = evaluation_figures(evaluations)["planes"]
    write_json(path, {"format": "stripe-sign-off", "version": 1, **asdict(sign_off), "signed": signed})
    return path


def failed_verdicts(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> list[str]:
    """Say what failed among these evaluations and the calibrations in use; a sign-off then needs a reason."""
    from core.report import ReportData, verdicts_of

    calibrations = load_calibrations(project)
    data = ReportData(
        project=project,
        photogrammetric=calibrations.get("photogrammetric"),  # type: ignore[arg-type]
        depth=calibrations.get("polynomial"),  # type: ignore[arg-type]
        evaluations=evaluations,
    )
    return [f"{name}: {verdict.because[0]}" for name, verdict in verdicts_of(data) if verdict.state == "failed"]


def load_sign_off(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> SignOff | None:
    """Give the sign-off of exactly these figures; None where nobody signed, or for others.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    from core.report import SignOff, Tolerance

    path = result_path(project, "sign-off.json")
    if not path.exists():
        return None
    try:
        fields = Fields.of(json.loads(regular(path).read_text(encoding="utf-8")), str(path))
    except (OSError, ValueError) as error:
        raise InputError(path, f"damaged ({error})", "delete it and sign again") from error
    if _figures(fields.items("signed"), path) != _figures(evaluation_figures(evaluations)["planes"], path):
        return None
    tolerance = None
    if fields.data.get("tolerance") is not None:
        entry = fields.nested("tolerance")
        tolerance = Tolerance(entry.real("limit_mm", above=0), entry.text("of", among=("rms", "max")))
    return SignOff(
        operator=fields.text("operator"),
        instrument=fields.text("instrument", default=""),
        remark=fields.text("remark", default=""),
        date=fields.text("date", default=""),
        tolerance=tolerance,
        despite=fields.text("despite", default=""),
    )


def _figures(planes: list[Any], path: Path) -> list[tuple]:
    """What was judged with which result, to a nanometre, in one order."""
    entries = [Fields.of(plane, f"{path}: signed") for plane in planes]
    return sorted(
        (e.text("capture"), e.text("method"), e.integer("n"), round(e.real("rms_mm"), 6), round(e.real("max_mm"), 6))
        for e in entries
    )


def result_tables(project: Project, evaluations: tuple[PlaneEvaluation, ...] = ()) -> str:
    """Tables 1 to 3 of a project's results as text."""
    from core.report import tables, text_table

    return "\n\n".join(text_table(table) for table in tables(report_data(project, evaluations)))
