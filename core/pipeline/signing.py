"""Signing an evaluation off, and withdrawing it."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from core.errors import InputError
from core.fields import text_of
from core.figures import evaluation_figures
from core.model import PlaneEvaluation, Project
from core.pipeline.calibrate import load_calibrations
from core.pipeline.report import outdated_evaluation, parts_of_report
from core.pipeline.runs import SIGN_OFF, current_runs, run_folder
from core.pipeline.signed import withdraw_sign_off
from core.pipeline.tables import kept_evaluation
from core.project import write_json

if TYPE_CHECKING:
    from core.report import Conformity, SignOff
    from core.report.sign_off import Figure


def sign_project(
    project: Project, sign_off: SignOff | None, evaluations: tuple[PlaneEvaluation, ...] | None = None
) -> None:
    """Sign the project's evaluation, or just these figures; without a name a sign-off that is there is withdrawn.

    Raises
    ------
    InputError
        If there is nothing to sign, or a verdict failed or the figures are outdated and `sign_off.despite` does not say
        why they are signed.
    """
    if sign_off is None or not sign_off.operator.strip():
        withdraw_sign_off(project)
        return
    signed = kept_evaluation(project) if evaluations is None else evaluations
    if not signed:
        raise InputError(project.path, "no evaluation to sign", "run `stripe-core evaluate` first")
    outdated = outdated_evaluation(project)
    if outdated and not sign_off.despite.strip():
        remedy = "run `stripe-core update`, or write why you sign all the same (`despite`, in the window the reason)"
        raise InputError("sign-off", f"the evaluation is outdated: {outdated[0]}", remedy)
    if sign_off.despite and not outdated and not failed_verdicts(project, signed):
        sign_off = replace(sign_off, despite="")  # there is nothing that it would be in spite of
    save_sign_off(project, sign_off, signed)


def sign_evaluation(
    project: Project, operator: str, *, tolerance_mm: float | None = None, of: Figure = "rms", **entries: str
) -> tuple[SignOff, Conformity | None]:
    """Sign the project's evaluation today, or on the `date` among the entries; give also what a tolerance says.

    Parameters
    ----------
    tolerance_mm : float, optional
        Judge every plane against it.
    of : {"rms", "max"}
        What the tolerance limits.
    entries : str
        instrument, remark, date (ISO 8601), despite: as in `SignOff`.
    """
    from core.report import SignOff, Tolerance, conformity

    tolerance = None if tolerance_mm is None else Tolerance(tolerance_mm, of)
    day = entries.pop("date", "") or f"{date.today():%Y-%m-%d}"
    signed = SignOff(operator.strip(), date=day, tolerance=tolerance, **entries)
    evaluations = kept_evaluation(project)
    sign_project(project, signed, evaluations)
    return signed, None if tolerance is None else conformity(evaluations, tolerance)


def save_sign_off(project: Project, sign_off: SignOff, evaluations: tuple[PlaneEvaluation, ...]) -> Path:
    """Keep who signed for these figures, with the run they were made by; the figures stay with it.

    So it lapses when others take their place. Signing again for the same changes nothing.
    """
    failed = failed_verdicts(project, evaluations)
    if failed and not sign_off.despite.strip():
        remedy = "see to its cause, or write why you sign all the same (`despite`, in the window the reason)"
        raise InputError("sign-off", f"the verdict failed: {failed[0]}", remedy)
    signed = evaluation_figures(evaluations)["planes"]
    document = {"format": "stripe-sign-off", "version": 1, **asdict(sign_off), "signed": signed}
    path = run_folder(project, max(current_runs(project).values())) / SIGN_OFF
    try:
        same = json.loads(text_of(path)) == json.loads(json.dumps(document))
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
