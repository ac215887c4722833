"""What there is to judge, and by what."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from PySide6.QtCore import QCoreApplication

from core.lazy import dataclass
from core.pipeline import METHODS, current_run
from stripe_gui.presenters.evaluate import EvaluationView, angle_text
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.runs import made_at
from stripe_gui.presenters.stages import StageStatus, State
from stripe_gui.presenters.status import graph_of
from stripe_gui.presenters.told import told

translate = QCoreApplication.translate


@dataclass(frozen=True)
class Choice:
    """Something to tick: its name for the program, as the operator reads it, and where it stands."""

    name: str
    title: str
    state: str


def plane_choices(folder: ProjectFolder) -> list[Choice]:
    """List the plane captures with angle and whether they are evaluated as they are now."""
    states = graph_of(folder).states().captures
    words = {
        "current": translate("PlaneTable", "evaluated"),
        "outdated": translate("PlaneTable", "changed since it was evaluated"),
    }
    found = []
    for entry in folder.of_role("plane"):
        state = words.get(states[entry.name]["evaluate"].state, translate("PlaneTable", "not evaluated"))
        found.append(Choice(entry.name, f"{entry.name}   {angle_text(entry.angle_deg)}".rstrip(), state))
    return found


def calibration_choices(folder: ProjectFolder, statuses: Mapping[str, StageStatus]) -> list[Choice]:
    """List the calibrations with date, run, and whether they are out of date."""
    status = statuses.get("calibrate")
    found = []
    for method in METHODS:
        if not folder.result_file(f"{method}.npz").is_file():
            continue
        parts = []
        if (run := current_run(folder.project, method)) is not None:
            parts.append(translate("PlaneTable", "calibrated {when}").format(when=made_at(run)))
            parts.append(translate("PlaneTable", "run {n}").format(n=run.number))
        if status is not None and status.state is State.STALE:
            parts.append(translate("PlaneTable", "out of date: {reason}").format(reason=status.reason))
        else:
            parts.append(translate("PlaneTable", "up to date"))
        found.append(Choice(method, told(method), ", ".join(parts)))
    return found


def is_evaluated(
    folder: ProjectFolder, view: EvaluationView | None, captures: Collection[str], methods: Collection[str]
) -> bool:
    """Say whether the evaluation there is holds just these planes by these methods, as they are now.

    A calibration that is out of date may be judged all the same: its line says so.
    """
    if view is None:
        return False
    made = {(e.capture, e.method) for e in view.every if e.camera is not None}
    return made == {(c, m) for c in captures for m in methods} and graph_of(folder).evaluation_fits
