"""Stage 7: tables, HTML and PDF from what the project holds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from dataclasses import asdict, replace
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.atomic import check_place
from core.errors import InputError
from core.fields import Fields, regular
from core.figures import evaluation_figures
from core.model import (
    Adjustment,
    DepthCalibration,
    DriftPoint,
    Method,
    PhotogrammetricCalibration,
    PlaneEvaluation,
    Project,
)
from core.pipeline.calibrate import load_calibrations
from core.pipeline.evaluate import evaluate_project, load_evaluation
from core.pipeline.folders import captures_of, known_truth, result_path
from core.pipeline.graph import project_states
from core.pipeline.holdings import reported_now
from core.pipeline.methods import METHODS
from core.pipeline.orient import drift_of
from core.pipeline.picking import current_target_sets
from core.pipeline.runs import SIGN_OFF, calibration_file, current_runs, run_folder
from core.pipeline.volumes import volume_figures
from core.progress import SILENT, Progress
from core.project import load_archive, write_json
from core.project.archive import read_head
from core.project.contents import hash_file, hash_value
from core.project.lock import writing_results

if TYPE_CHECKING:
    from core.report import ReportData, ReportPaths, SignOff


def report_data(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> ReportData:
    """Gather what a report tells of, from the project's results."""
    from core.report import ReportData

    calibrations = parts_of_report(load_calibrations(project))
    adjustment = None
    if calibrations["photogrammetric"] is not None:
        path = calibration_file(project, "adjustment.npz") or result_path(project, "adjustment.npz")
        adjustment = load_archive(path, Adjustment)
        if not len(adjustment.residuals):
            adjustment = None  # calibrated by another program
    return ReportData(
        project=project,
        adjustment=adjustment,
        **calibrations,
        evaluations=evaluations,
        truth=known_truth(project),
        made_on=f"{date.today():%Y-%m-%d}",
        made_by=f"stripe-core {version('stripe-workbench')}",
        sign_off=load_sign_off(project, evaluations),
        volume=_volume(project, calibrations["photogrammetric"]),
        drift=_drift(project, calibrations["photogrammetric"]),
        responses=_responses(project),
    )


def _responses(project: Project) -> dict[str, dict[str, Any]]:
    """Give the response curves by projector and capture, of the captures that show one."""
    found: dict[str, dict[str, Any]] = {}
    for targets in current_target_sets(project):
        if targets.response is not None:
            found.setdefault(targets.projector, {})[targets.capture] = targets.response
    return found


def _drift(project: Project, calibration: PhotogrammetricCalibration | None) -> tuple[tuple[DriftPoint, ...], ...]:
    """Give the control charts of what `orient` has kept."""
    charts = {} if calibration is None else drift_of(project, kept=True)
    return tuple(chart for chart in charts.values() if len(chart) > 1)


def _volume(project: Project, calibration: PhotogrammetricCalibration | None) -> tuple[Any, Any] | None:
    """Give the uncertainty over the working volume of a calibration that has sigmas."""
    if calibration is None or not calibration.covariance.any():
        return None
    return volume_figures(project)


def parts_of_report(found: Mapping[Method, Any]) -> dict[str, Any]:
    """Give calibrations under the names that `ReportData` has for them."""
    kinds = {"photogrammetric": PhotogrammetricCalibration, "depth": DepthCalibration}
    named: dict[str, Any] = {
        field: next((c for c in found.values() if isinstance(c, kind)), None) for field, kind in kinds.items()
    }
    others = {METHODS[m].title: c for m, c in found.items() if all(c is not known for known in named.values())}
    return {**named, "others": others}


def report_project(
    project: Project,
    out: Path | None = None,
    progress: Progress = SILENT,
    *,
    evaluations: tuple[PlaneEvaluation, ...] | None = None,
) -> ReportPaths:
    """Write the HTML and PDF report from the project's calibrations.

    Its planes are evaluated by them first, unless `evaluations` of a moment ago are given or those that are kept are
    current. What it says of results that are outdated stands among its warnings.
    """
    from core.report import write_report

    own = result_path(project, "report")
    out = out or own
    for name in ("report.html", "report.pdf"):
        check_place(out / name)
    with writing_results(project.path, "report") if evaluations is None or out == own else nullcontext():
        data = report_data(project, evaluations or ())  # what is damaged is told before the evaluation is written anew
        if evaluations is None:
            evaluations = _planes(project, progress.part(0.0, 0.5))
        data = replace(
            data,
            evaluations=evaluations,
            sign_off=load_sign_off(project, evaluations),
            outdated=outdated_words(project),
        )
        record = reported_now(project)
        paths = write_report(data, out, progress=progress.part(0.5, 1.0))
        files = {path.name: hash_file(path) for path in (paths.html, paths.pdf)}
        write_json(out / "report.json", {"format": "stripe-report", "version": 1, "files": files, "made_from": record})
    return paths


def _planes(project: Project, progress: Progress) -> tuple[PlaneEvaluation, ...]:
    """Evaluate all planes, or take the evaluation there is if it is of just them as they are."""
    if not captures_of(project, "plane"):
        return ()
    states = project_states(project)
    if states.stages["evaluate"].state == "current" and all(
        of["evaluate"].state == "current" for of in states.captures.values() if "evaluate" in of
    ):
        with suppress(InputError):  # damaged: made anew
            return load_evaluation(project)
    return evaluate_project(project, progress)


def outdated_words(project: Project) -> tuple[str, ...]:
    """Say in a sentence each which results that evaluating and reporting use do not follow from what is there."""
    states = project_states(project)
    return states.outdated("calibrate") or states.outdated("evaluate")


def save_sign_off(project: Project, sign_off: SignOff, evaluations: tuple[PlaneEvaluation, ...]) -> Path:
    """Keep who signed for these figures, with the run they were made by; the figures stay with it.

    So it lapses when others take their place. Signing again for the same changes nothing.
    """
    if not sign_off.despite.strip() and (failed := failed_verdicts(project, evaluations)):
        remedy = "see to its cause, or write why you sign all the same (`despite`, in the window the reason)"
        raise InputError("sign-off", f"the verdict failed: {failed[0]}", remedy)
    numbers = current_runs(project).values()
    folder = run_folder(project, max(numbers)) if numbers else result_path(project, "")
    signed = evaluation_figures(evaluations)["planes"]
    document = {"format": "stripe-sign-off", "version": 1, **asdict(sign_off), "signed": signed}
    path = folder / SIGN_OFF
    try:
        same = json.loads(path.read_text(encoding="utf-8")) == json.loads(json.dumps(document))
    except (OSError, ValueError):
        same = False
    if not same:
        write_json(path, document)
    return path


def failed_verdicts(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> list[str]:
    """Say what failed among these evaluations and the calibrations in use; a sign-off then needs a reason."""
    from core.report import ReportData, verdicts_of

    data = ReportData(project=project, **parts_of_report(load_calibrations(project)), evaluations=evaluations)
    return [f"{name}: {verdict.because[0]}" for name, verdict in verdicts_of(data) if verdict.state == "failed"]


def withdraw_sign_off(project: Project) -> None:
    """Take the sign-off of the calibrations in use back."""
    for path in _sign_offs(project):
        path.unlink(missing_ok=True)


def _sign_offs(project: Project) -> list[Path]:
    """Where a sign-off can lie: with the runs in use, or, of earlier versions, beside them."""
    numbers = sorted(set(current_runs(project).values()), reverse=True)
    folders = [*(run_folder(project, number) for number in numbers), result_path(project, "")]
    return [folder / SIGN_OFF for folder in folders]


def load_sign_off(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> SignOff | None:
    """Give the sign-off of exactly these figures; None where nobody signed, or for others."""
    from core.report import SignOff, Tolerance

    fields = _signed(project, evaluation_figures(evaluations)["planes"])
    if fields is None:
        return None
    entry = fields.optional("tolerance")
    tolerance = Tolerance(entry.real("limit_mm", above=0), entry.text("of", among=("rms", "max"))) if entry else None
    texts = {name: fields.text(name, default="") for name in ("instrument", "remark", "date", "despite")}
    return SignOff(fields.text("operator"), tolerance=tolerance, **texts)


def signed_state(project: Project) -> str | None:
    """Hash the sign-off that is in force for the evaluation there is; None where there is none."""
    try:
        planes = [e["fields"] for e in read_head(result_path(project, "evaluation.npz"))["value"]]
        fields = _signed(project, planes)
    except (InputError, TypeError, KeyError):
        return None
    return None if fields is None else hash_value({k: v for k, v in fields.data.items() if k != "signed"})


def _signed(project: Project, planes: list[Any]) -> Fields | None:
    """Read the sign-off of just these figures."""
    for path in _sign_offs(project):
        if not path.exists():
            continue
        try:
            fields = Fields.of(json.loads(regular(path).read_text(encoding="utf-8")), str(path))
        except (OSError, ValueError) as error:
            raise InputError(path, f"damaged ({error})", "delete it and sign again") from error
        if _figures(fields.items("signed"), path) == _figures(planes, path):
            return fields
    return None


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
