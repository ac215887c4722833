"""Signing an evaluation off, and withdrawing it."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from typing import TYPE_CHECKING

from core.errors import InputError
from core.model import PlaneEvaluation, Project
from core.pipeline.report import failed_verdicts, save_sign_off, withdraw_sign_off
from core.pipeline.tables import kept_evaluation

if TYPE_CHECKING:
    from core.report import SignOff, Verdict
    from core.report.sign_off import Figure


def sign_project(
    project: Project, sign_off: SignOff | None, evaluations: tuple[PlaneEvaluation, ...] | None = None
) -> None:
    """Sign the project's evaluation, or just these figures; without a name a sign-off that is there is withdrawn.

    Raises
    ------
    InputError
        If there is nothing to sign, or a verdict failed and `sign_off.despite` does not say why it is signed.
    """
    if sign_off is None or not sign_off.operator.strip():
        withdraw_sign_off(project)
        return
    signed = kept_evaluation(project) if evaluations is None else evaluations
    if not signed:
        raise InputError(project.path, "no evaluation to sign", "run `stripe-core evaluate` first")
    if sign_off.despite and not failed_verdicts(project, signed):
        sign_off = replace(sign_off, despite="")  # nothing failed that it would be in spite of
    save_sign_off(project, sign_off, signed)


def sign_evaluation(
    project: Project, operator: str, *, tolerance_mm: float | None = None, of: Figure = "rms", **entries: str
) -> tuple[SignOff, Verdict | None]:
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
    from core.report import SignOff, Tolerance, verdict

    tolerance = None if tolerance_mm is None else Tolerance(tolerance_mm, of)
    day = entries.pop("date", "") or f"{date.today():%Y-%m-%d}"
    signed = SignOff(operator.strip(), date=day, tolerance=tolerance, **entries)
    evaluations = kept_evaluation(project)
    sign_project(project, signed, evaluations)
    return signed, None if tolerance is None else verdict(evaluations, tolerance)
