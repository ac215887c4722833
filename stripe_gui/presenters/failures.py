"""What a stage failed with, kept in the project until the stage succeeds or what it reads has changed."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from PySide6.QtCore import QCoreApplication

from core.errors import StripeError
from core.project import write_json

translate = QCoreApplication.translate


@dataclass(frozen=True)
class StageFailure:
    """A failed run: what happened, what to do, the details, and when."""

    happened: str
    remedy: str
    details: str
    at_ns: int


def describe(error: BaseException, trace: str = "") -> StageFailure:
    """Put an error into the operator's words; anything but our own errors is a fault of the program."""
    if isinstance(error, StripeError):
        happened, remedy = f"{error.where}: {error.seen}", error.remedy
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
    return StageFailure(happened, remedy, trace, time.time_ns())


def read_failures(folder: Path) -> dict[str, StageFailure]:
    """Give the failures by stage; a file that cannot be read counts as none."""
    try:
        stored = json.loads(_file(folder).read_text(encoding="utf-8"))
        return {stage: StageFailure(**entry) for stage, entry in stored.items()}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def keep_failure(folder: Path, stage: str, failure: StageFailure) -> None:
    """Remember that a stage failed."""
    _write(folder, {**read_failures(folder), stage: failure})


def clear_failure(folder: Path, stage: str) -> None:
    """Forget a stage's failure."""
    kept = read_failures(folder)
    if kept.pop(stage, None) is not None:
        _write(folder, kept)


def _file(folder: Path) -> Path:
    return folder / "results" / "failures.json"


def _write(folder: Path, failures: dict[str, StageFailure]) -> None:
    write_json(_file(folder), {stage: asdict(failure) for stage, failure in failures.items()})
