"""What a stage failed with, kept in the project until the stage succeeds or what the stages read has changed."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from core.fields import kept_object
from core.lazy import dataclass
from core.project import write_json


@dataclass(frozen=True)
class StageFailure:
    """A failed run: what happened, what to do, the details, and a sign of everything the stages read at the time."""

    happened: str
    remedy: str
    details: str = ""
    read: str = ""


def read_failures(folder: Path) -> dict[str, StageFailure]:
    """Give the failures by stage; a file that cannot be read counts as none."""
    names = ("happened", "remedy", "details", "read")
    return {
        stage: StageFailure(**{name: str(entry.get(name, "")) for name in names})
        for stage, entry in kept_object(_file(folder)).items()
        if isinstance(entry, dict)
    }


def keep_failure(folder: Path, stage: str, failure: StageFailure) -> None:
    """Remember that a stage failed."""
    _write(folder, {**read_failures(folder), stage: failure})


def clear_failure(folder: Path, stage: str) -> None:
    """Forget a stage's failure."""
    kept = read_failures(folder)
    if kept.pop(stage, None) is not None:
        _write(folder, kept)


def _file(folder: Path) -> Path:
    return Path(folder) / "results" / "failures.json"


def _write(folder: Path, failures: dict[str, StageFailure]) -> None:
    write_json(_file(folder), {stage: asdict(failure) for stage, failure in failures.items()})
