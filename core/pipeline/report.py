"""Stage 7: tables, HTML and PDF from what the project holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import core
from core.atomic import check_place
from core.errors import InputError, StripeError
from core.model import (
    Capture,
    DepthCalibration,
    DriftPoint,
    Method,
    PhotogrammetricCalibration,
    PlaneEvaluation,
    Project,
)
from core.parallel import beside
from core.pipeline.calibrate import load_adjustment, load_calibrations
from core.pipeline.evaluate import evaluate_project, load_evaluation
from core.pipeline.folders import all_captures, known_truth, result_path
from core.pipeline.merge import kept_registration
from core.pipeline.methods import METHODS
from core.pipeline.orient import drift_of
from core.pipeline.picking import current_target_sets
from core.pipeline.signed import load_sign_off
from core.pipeline.state.graph import Graph, project_states
from core.pipeline.state.holdings import reported_now
from core.pipeline.state.states import ProjectStates
from core.pipeline.volumes import volume_of_calibration
from core.progress import SILENT, Progress
from core.project import write_json
from core.project.archive import read_head
from core.project.contents import hash_file
from core.project.lock import read_only, writing_results

if TYPE_CHECKING:
    from core.report import ReportData, ReportPaths


def report_data(
    project: Project, evaluations: tuple[PlaneEvaluation, ...], captures: Sequence[Capture] | None = None
) -> ReportData:
    """Gather what a report tells of, from the project's results; `captures` are all there are, if they are read."""
    data = _result_data(project, evaluations)
    found = data.photogrammetric
    return replace(
        data,
        made_on=f"{date.today():%Y-%m-%d}",
        made_by=f"stripe-core {core.__version__}",
        sign_off=load_sign_off(project, evaluations),
        drift=_drift(project, found),
        responses=_responses(project, captures),
        merged=None if found is None else kept_registration(project, found),
    )


def _result_data(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> ReportData:
    """Gather what the calibrations in use and an evaluation by them have found."""
    from core.report import ReportData

    calibrations = parts_of_report(load_calibrations(project))
    calibration, adjustment, volume = calibrations["photogrammetric"], None, None
    if calibration is not None:
        adjustment = load_adjustment(project)
        if calibration.covariance.any() and calibration.projectors:
            with suppress(InputError):  # the projector lights nothing there, which its verdict tells
                volume = volume_of_calibration(calibration, adjustment)
        if not len(adjustment.residuals):
            adjustment = None  # calibrated by another program
    return ReportData(
        project=project,
        adjustment=adjustment,
        **calibrations,
        evaluations=evaluations,
        truth=known_truth(project),
        volume=volume,
    )


def _responses(project: Project, captures: Sequence[Capture] | None) -> dict[str, dict[str, Any]]:
    """Give the response curves by projector and capture, of the captures that show one."""
    with suppress(StripeError, AttributeError, LookupError, TypeError):  # which reading all of it tells
        sets = read_head(result_path(project, "targets.npz"))["value"]
        if all(each["fields"].get("response") is None for each in sets):
            return {}
    found: dict[str, dict[str, Any]] = {}
    for targets in current_target_sets(project, captures):
        if targets.response is not None:
            found.setdefault(targets.projector, {})[targets.capture] = targets.response
    return found


def _drift(project: Project, calibration: PhotogrammetricCalibration | None) -> tuple[tuple[DriftPoint, ...], ...]:
    """Give the control charts of what `orient` has kept."""
    if calibration is None or not result_path(project, "drift").is_dir():
        return ()
    charts = drift_of(project, kept=True)
    return tuple(chart for chart in charts.values() if len(chart) > 1)


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
    current. What it says of results that are outdated stands among its warnings. Where a project may only be read, the
    report that it has is given if it is current.
    """
    from core.report import ReportPaths, write_report

    own = result_path(project, "report")
    out, fixed = out or own, read_only(project.path)
    there = ReportPaths(own / "report.html", own / "report.pdf")
    if fixed and out == own and there.pdf.exists() and project_states(project).stages["report"].state == "current":
        return there
    for name in ("report.html", "report.pdf"):
        check_place(out / name)
    writes = not fixed and (evaluations is None or out == own)
    with writing_results(project.path, "report") if writes else nullcontext():
        captures = all_captures(project)
        data = report_data(project, evaluations or (), captures)  # what is damaged is told before anything is written
        states = _states(project, captures)
        if evaluations is None and (evaluations := _kept_planes(project, captures, states)) is None:
            evaluations = evaluate_project(project, progress.part(0.0, 0.5))
            states = _states(project)
        data = replace(
            data,
            evaluations=evaluations,
            sign_off=load_sign_off(project, evaluations),
            outdated=_outdated(states),
        )
        record = reported_now(project)
        paths = write_report(data, out, progress=progress.part(0.5, 1.0))
        files = {path.name: hash_file(path) for path in (paths.html, paths.pdf)}
        write_json(out / "report.json", {"format": "stripe-report", "version": 1, "files": files, "made_from": record})
    return paths


def _kept_planes(
    project: Project, captures: Sequence[Capture], states: ProjectStates
) -> tuple[PlaneEvaluation, ...] | None:
    """Give the evaluation there is if it is of all planes as they are; None where they must be evaluated."""
    if not any(c.role == "plane" for c in captures):
        return ()
    planes = (of["evaluate"] for of in states.captures.values())
    if all(state.state == "current" for state in (states.stages["evaluate"], *planes)):
        with suppress(InputError):  # damaged: made anew
            return load_evaluation(project)
    return None


def _states(project: Project, captures: Sequence[Capture] = ()) -> ProjectStates:
    return Graph(project, {c.path: c for c in captures}).of_results()


def _outdated(states: ProjectStates) -> tuple[str, ...]:
    return states.outdated("calibrate") or states.outdated("evaluate")


def outdated_words(project: Project, method: Method | None = None) -> tuple[str, ...]:
    """Say in a sentence each which calibrations, or whether that by a method, do not follow from what is there."""
    if method is not None:
        return Graph(project).of_calibrations([method])
    return _states(project).outdated("calibrate")


def outdated_evaluation(project: Project) -> tuple[str, ...]:
    """Say why the figures of planes do not follow from what is there, or the calibrations that they are by."""
    return _outdated(_states(project))


def outdated_beside(project: Project) -> Callable[[], tuple[str, ...]]:
    """Begin to find that out of all calibrations; give what waits for it."""
    return beside(lambda: outdated_words(project))


def result_tables(project: Project, evaluations: tuple[PlaneEvaluation, ...] = ()) -> str:
    """Tables 1 to 3 of a project's results as text."""
    from core.report import tables, text_table

    return "\n\n".join(text_table(table) for table in tables(_result_data(project, evaluations)))


def table_of_planes(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> str:
    """Table 3 as text."""
    from core.report import ReportData, tables, text_table

    return "\n\n".join(text_table(table) for table in tables(ReportData(project, evaluations=evaluations)))
