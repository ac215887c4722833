"""Who signed for which figures: what lies with the runs in use, and whether it is of just these figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.errors import InputError
from core.fields import Fields, text_of
from core.figures import evaluation_figures
from core.model import PlaneEvaluation, Project
from core.pipeline.folders import result_path
from core.pipeline.runs import SIGN_OFF, current_runs, run_folder
from core.project.archive import read_head
from core.project.contents import hash_value

if TYPE_CHECKING:
    from core.report import SignOff


def withdraw_sign_off(project: Project) -> bool:
    """Take the sign-off of the calibrations in use back, and say whether there was one."""
    signed = [path for path in _sign_offs(project) if path.exists()]
    for path in signed:
        path.unlink(missing_ok=True)
    return bool(signed)


def _sign_offs(project: Project) -> list[Path]:
    """Where a sign-off can lie: with the runs in use."""
    numbers = sorted(set(current_runs(project).values()), reverse=True)
    return [run_folder(project, number) / SIGN_OFF for number in numbers]


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
            fields = Fields.of(json.loads(text_of(path)), str(path))
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
