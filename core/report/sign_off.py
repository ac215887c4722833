"""Who answers for the figures: operator, instrument and date, and whether the planes stay within a tolerance."""

from __future__ import annotations

from typing import Literal

from core.digits import fixed
from core.lazy import dataclass
from core.model import PlaneEvaluation
from core.report.data import SignOff, Tolerance, plane_name, side_by_side
from core.report.table import Cell, Table

Figure = Literal["rms", "max"]
FIGURES: dict[Figure, str] = {"rms": "r.m.s. deviation", "max": "largest deviation"}
MOST_NAMED = 4  # planes beyond the tolerance that the statement names


@dataclass(frozen=True)
class Conformity:
    """Whether the planes stay within the tolerance, and the sentence that says so."""

    passed: bool
    text: str


def conformity(evaluations: tuple[PlaneEvaluation, ...], tolerance: Tolerance) -> Conformity:
    """Compare every plane by every method with the tolerance; equal to it is within it.

    Examples
    --------
    >>> conformity((), Tolerance(0.05)).passed
    False
    """
    name, limit = FIGURES[tolerance.of], f"{tolerance.limit_mm:g} mm"
    if not evaluations:
        return Conformity(False, f"Not passed: no plane was evaluated against the tolerance of {limit} ({name}).")
    ordered = side_by_side(evaluations)
    beyond = [e for e in ordered if not _figure(e, tolerance.of) <= tolerance.limit_mm]
    if not beyond:
        worst = max(ordered, key=lambda e: _figure(e, tolerance.of))
        return Conformity(
            True,
            f"Passed: the {name} of every plane by every method stays within the tolerance of {limit}; the greatest is "
            f"{_named(worst, tolerance.of, evaluations)}.",
        )
    beyond.sort(key=lambda e: -_figure(e, tolerance.of))
    told = "; ".join(_named(e, tolerance.of, evaluations) for e in beyond[:MOST_NAMED])
    more = f"; and {len(beyond) - MOST_NAMED} more" if len(beyond) > MOST_NAMED else ""
    return Conformity(
        False,
        f"Failed: the {name} exceeds the tolerance of {limit} in {len(beyond)} of {len(ordered)} evaluations: "
        f"{told}{more}.",
    )


def sign_off_table(sign_off: SignOff, evaluations: tuple[PlaneEvaluation, ...]) -> Table:
    """The sign-off as a table with a line for the signature."""
    rows: list[tuple[Cell, ...]] = [("operator", sign_off.operator)]
    rows += [(name, text) for name, text in (("instrument", sign_off.instrument), ("date", sign_off.date)) if text]
    if sign_off.tolerance is not None:
        rows.append(("tolerance", f"{sign_off.tolerance.limit_mm:g} mm, {FIGURES[sign_off.tolerance.of]}"))
        rows.append(("result", conformity(evaluations, sign_off.tolerance).text))
    if sign_off.despite:
        rows.append(("signed despite a failed verdict", sign_off.despite))
    if sign_off.remark:
        rows.append(("remark", sign_off.remark))
    rows.append(("signature", "_" * 40))
    note = "Signed for the figures of Table 3 as they stand in this report."
    return Table("Sign-off of the plane-table", ("item", "entry"), tuple(rows), (note,))


def sign_off_sentence(sign_off: SignOff, evaluations: tuple[PlaneEvaluation, ...]) -> str:
    """Who signed when, and whether the planes conform, for the summary."""
    when = f" on {sign_off.date}" if sign_off.date else ""
    text = f"Signed off by {sign_off.operator}{when}."
    if sign_off.despite:
        text += f" Signed despite a failed verdict, because: {sign_off.despite}"
    return f"{text} {conformity(evaluations, sign_off.tolerance).text}" if sign_off.tolerance is not None else text


def _figure(evaluation: PlaneEvaluation, which: Figure) -> float:
    return evaluation.rms_mm if which == "rms" else evaluation.max_mm


def _named(evaluation: PlaneEvaluation, which: Figure, evaluations: tuple[PlaneEvaluation, ...]) -> str:
    return f"{fixed(_figure(evaluation, which), 4)} mm, {plane_name(evaluation, evaluations)} {evaluation.method}"
