"""What a stage failed with, in the operator's words; the project keeps it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from core.errors import StripeError
from core.pipeline.state import failures
from core.pipeline.state.failures import StageFailure
from core.pipeline.state.graph import Graph
from core.project import read_project
from stripe_gui.presenters.told import told, translate


def describe(error: BaseException, trace: str = "") -> StageFailure:
    """Put an error into the operator's words; anything but our own errors is a fault of the program."""
    if isinstance(error, StripeError):
        happened, remedy = f"{error.where}: {told(error.seen)}", told(error.remedy)
    elif isinstance(error, MemoryError):
        happened = translate("Failures", "out of memory")
        remedy = translate("Failures", "close other programs, or use fewer captures")
    elif isinstance(error, OSError):
        happened = str(error)
        remedy = translate("Failures", "see to the disk and the folder's permissions")
    else:
        text = translate("Failures", "the program met something it was not written for ({kind}: {error})")
        happened = text.format(kind=type(error).__name__, error=error)
        remedy = translate("Failures", "report it with the details; your data are untouched")
    return StageFailure(happened, remedy, trace)


def keep_failure(folder: Path, stage: str, failure: StageFailure) -> None:
    """Remember that a stage failed, until it succeeds or what the stages read changes."""
    failures.keep_failure(folder, stage, replace(failure, read=Graph(read_project(folder)).sign()))
