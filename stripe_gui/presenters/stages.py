"""The seven stages and their states in the operator's words; without the core, so that the window appears early."""

from __future__ import annotations

from enum import Enum

from core.lazy import dataclass
from stripe_gui.presenters.told import translate

STAGES = ("capture", "decode", "measure", "calibrate", "reconstruct", "evaluate", "report")


class State(Enum):
    """Where a stage stands."""

    DONE = "done"
    STALE = "stale"
    TODO = "todo"
    FAILED = "failed"


@dataclass(frozen=True)
class StageStatus:
    """One stage: its state and why, in a sentence."""

    state: State
    reason: str


def stage_name(stage: str) -> str:
    """Give the stage's word in the operator's language."""
    return {
        "capture": translate("Stages", "Capture"),
        "decode": translate("Stages", "Decode"),
        "measure": translate("Stages", "Measure"),
        "calibrate": translate("Stages", "Calibrate"),
        "reconstruct": translate("Stages", "Reconstruct"),
        "evaluate": translate("Stages", "Evaluate"),
        "report": translate("Stages", "Report"),
    }[stage]


def state_word(state: State) -> str:
    """Give the state's word in the operator's language."""
    return {
        State.DONE: translate("Stages", "done"),
        State.STALE: translate("Stages", "out of date"),
        State.TODO: translate("Stages", "to do"),
        State.FAILED: translate("Stages", "failed"),
    }[state]
