"""The seven stages of a project in the operator's words: done, out of date, to do, or failed with the reason.

The core alone knows the states (`core.pipeline.state.graph`); here they get words, and capturing, which the operator
does himself, a line of its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from core.model import Method
from core.pipeline import METHODS
from core.pipeline.state.failures import read_failures
from core.pipeline.state.graph import Graph
from core.pipeline.state.states import ProjectStates
from core.progress import SILENT, Progress
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.stages import StageStatus, State
from stripe_gui.presenters.told import told, translate

MOST_CAUSES = 2  # told of many
_STATES = {"current": State.DONE, "outdated": State.STALE, "absent": State.TODO, "failed": State.FAILED}


def stage_statuses(folder: ProjectFolder, progress: Progress = SILENT) -> dict[str, StageStatus]:
    """Give the state of every stage, from the core."""
    folder.look_again()
    progress(0.1, folder.path.name)
    return statuses_of(folder, graph_of(folder).states())


def graph_of(folder: ProjectFolder) -> Graph:
    """Let the core look at a project whose captures are read already."""
    read = {e.folder: e.capture or e.error for e in folder.captures()}
    return Graph(folder.project, {path: found for path, found in read.items() if found is not None})


def statuses_of(folder: ProjectFolder, states: ProjectStates) -> dict[str, StageStatus]:
    """Put states into words."""
    failures = read_failures(folder.path)
    found = {"capture": _capture(folder)}
    for stage, state in states.stages.items():
        each = [of[stage] for of in states.captures.values() if stage in of]
        reason = causes(state.because) or _done_words(stage, len(each))
        if stage == "calibrate" and state.state == "current":
            reason = ", ".join(map(told, methods_of(folder)))
        if state.state == "failed" and stage in failures:
            reason = failures[stage].happened
        found[stage] = StageStatus(_STATES[state.state], reason)
    return found


def causes(because: Sequence[str]) -> str:
    """Sum up why something is out of date: each cause once, whichever stages hand it on, the first two of many.

    Examples
    --------
    >>> causes(["calibrate is outdated: the scale was 1, is 2", "the scale was 1, is 2", "measure is outdated: a; b"])
    'the scale was 1, is 2; a; and 1 more'
    >>> causes(["calibrate is outdated: a", "evaluate is outdated: a calibration it takes into account is outdated: a"])
    'a'
    """
    each = [part for text in because for part in text.split("; ")]
    found = list(dict.fromkeys(re.sub(r"^([^:]+ is outdated: )+", "", part) for part in each))
    more = translate("Stages", "and {n} more").format(n=len(found) - MOST_CAUSES)
    return "; ".join([*map(told, found[:MOST_CAUSES]), *([more] if len(found) > MOST_CAUSES else [])])


def _done_words(stage: str, count: int) -> str:
    return {
        "decode": translate("Stages", "{n} captures decoded"),
        "measure": translate("Stages", "targets of {n} captures"),
        "reconstruct": translate("Stages", "points of {n} captures"),
        "evaluate": translate("Stages", "{n} planes"),
        "report": translate("Stages", "HTML and PDF"),
    }.get(stage, "").format(n=count)


def methods_of(folder: ProjectFolder) -> list[Method]:
    """Give the methods that the project has a calibration of."""
    return [m for m in METHODS if folder.result_file(f"{m}.npz").exists()]


def _capture(folder: ProjectFolder) -> StageStatus:
    entries = folder.captures()
    error = next((e.error for e in entries if e.error), None)
    if error is not None:
        return StageStatus(State.FAILED, str(error))
    if not entries:
        return StageStatus(State.TODO, translate("Stages", "no captures yet"))
    return StageStatus(State.DONE, translate("Stages", "{n} captures").format(n=len(entries)))


def device_name(device: str) -> str:
    """Give a device's name in the operator's language, as a heading."""
    names = {"camera": translate("Stages", "Camera"), "projector": translate("Stages", "Projector")}
    return names.get(device, device)
