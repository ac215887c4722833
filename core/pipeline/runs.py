"""Kept runs: every calibration stays with its options and figures, can be compared and made the current one again.

``results/runs/0004/`` holds ``run.json`` and the archives of one run; ``results/`` itself those in use, and
``current.json`` there names the run of each. Archives in both places are one file with two names where the disk can do
that, and a depth calibration that was not computed anew shares its file with the run before. So a run costs what its
adjustment needs (0.6 MB for 40 stations), and one with a new depth calibration 24 bytes a pixel more. Beyond
`MOST_RUNS` the oldest that are not in use go.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from core.errors import InputError
from core.model import Figures, Method, Project
from core.pipeline.folders import result_path
from core.pipeline.options import CalibrateOptions
from core.project import atomic_write, save_archive, write_json

MOST_RUNS = 20
ARCHIVES: dict[Method, tuple[str, ...]] = {
    "photogrammetric": ("photogrammetric.npz", "adjustment.npz"),
    "polynomial": ("polynomial.npz",),
}
_FORMAT = {"format": "stripe-run", "version": 1}


@dataclass(frozen=True)
class Run:
    """One calibration as it was made.

    Attributes
    ----------
    number : int
    made_at : str
        When it ended, ISO 8601 with the offset of the zone.
    read_ns : int
        When it began to read its captures, as files tell times: what was written later did not take part.
    options : CalibrateOptions
    captures : mapping
        Names of the captures used by each method.
    excluded : mapping
        Targets that an operator had excluded, (row, col) each, by capture.
    made_from : mapping
        What each method's result follows from, see `core.pipeline.freshness`.
    figures : dict
        As `calibrate --json` writes them.
    name : str
        What an operator called it.
    """

    number: int
    made_at: str
    read_ns: int
    options: CalibrateOptions
    captures: Mapping[Method, tuple[str, ...]]
    excluded: Mapping[str, tuple[tuple[int, int], ...]]
    made_from: Mapping[Method, str]
    figures: Figures = field(repr=False)
    name: str = ""

    @property
    def methods(self) -> tuple[Method, ...]:
        """The methods it calibrated by."""
        return tuple(method for method in ARCHIVES if method in self.captures)


def now() -> str:
    """Give the time in the zone of this machine, to the second."""
    return datetime.now(UTC).astimezone().isoformat(timespec="seconds")


def keep_run(project: Project, run: Run, archives: Mapping[str, object]) -> Run:
    """Keep a run under the next free number and make it the current one.

    Parameters
    ----------
    project : Project
    run : Run
        Its number is given here.
    archives : mapping
        By file name, what to write, or the path of an archive that holds it already.
    """
    root = result_path(project, "runs")
    taken = [*(r.number for r in list_runs(project)), *current_runs(project).values()]
    part = root / f".{os.getpid()}.part"
    try:
        for name, value in archives.items():
            if isinstance(value, Path):
                _share(value, part / name)
            else:
                save_archive(part / name, value)
        number = max(taken, default=0) + 1
        while True:
            run = replace(run, number=number)
            write_json(part / "run.json", _to_dict(run))
            try:
                part.rename(_folder(project, number))
                break
            except OSError:
                if not _folder(project, number).exists():
                    raise
                number += 1  # another program was quicker
    finally:
        shutil.rmtree(part, ignore_errors=True)
    make_current(project, run)
    for old in list_runs(project)[:-MOST_RUNS]:
        if old.number not in current_runs(project).values():
            delete_run(project, old)
    return run


def list_runs(project: Project) -> tuple[Run, ...]:
    """Give the kept runs, the oldest first; one that cannot be read is left out."""
    found = []
    for path in result_path(project, "runs").glob("[0-9]*/run.json"):
        with suppress(OSError, ValueError, TypeError, KeyError, AttributeError):
            found.append(_from_dict(json.loads(path.read_text(encoding="utf-8"))))
    return tuple(sorted(found, key=lambda run: run.number))


def current_runs(project: Project) -> dict[Method, int]:
    """Give the number of the run that each calibration in use came from, where that is known."""
    try:
        stored = json.loads(result_path(project, "current.json").read_text(encoding="utf-8"))
        return {m: int(stored[m]) for m in ARCHIVES if m in stored and result_path(project, f"{m}.npz").exists()}
    except (OSError, ValueError, TypeError):
        return {}


def current_run(project: Project, method: Method) -> Run | None:
    """Give the run that the calibration in use came from, if it is kept."""
    number = current_runs(project).get(method)
    path = _folder(project, number or 0) / "run.json"
    try:
        return _from_dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def make_current(project: Project, run: Run) -> None:
    """Put a kept run's calibrations in use; later stages then count as out of date.

    A method that the run did not calibrate by stays as it is.

    Raises
    ------
    InputError
        If one of its archives is missing; nothing is changed then.
    """
    files = [_folder(project, run.number) / name for method in run.methods for name in ARCHIVES[method]]
    for file in files:
        if not file.is_file():
            raise InputError(file, "not there", "choose another run, or calibrate again")
    for file in files:
        os.utime(file)
        _share(file, result_path(project, file.name))
    numbers = {**current_runs(project), **dict.fromkeys(run.methods, run.number)}
    write_json(result_path(project, "current.json"), numbers)


def rename_run(project: Project, run: Run, name: str) -> Run:
    """Give a kept run a name of the operator's."""
    renamed = replace(run, name=name.strip())
    write_json(_folder(project, run.number) / "run.json", _to_dict(renamed))
    return renamed


def delete_run(project: Project, run: Run) -> None:
    """Delete a kept run.

    Raises
    ------
    InputError
        If a calibration in use came from it.
    """
    folder = _folder(project, run.number)
    if run.number in current_runs(project).values():
        raise InputError(folder, "is in use", "make another run the current one first")
    (folder / "run.json").unlink(missing_ok=True)  # first: what is half deleted is no run
    shutil.rmtree(folder, ignore_errors=True)


def _folder(project: Project, number: int) -> Path:
    return result_path(project, "runs") / f"{number:04d}"


def _share(source: Path, target: Path) -> None:
    """Give a file a second name, atomically; on a disk that cannot, copy it."""
    target.parent.mkdir(parents=True, exist_ok=True)
    link = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        link.unlink(missing_ok=True)
        link.hardlink_to(source)
        link.replace(target)  # where both are the same file already, this does nothing
    except OSError:
        with source.open("rb") as original, atomic_write(target) as copy:
            shutil.copyfileobj(original, copy)
    finally:
        link.unlink(missing_ok=True)


def _to_dict(run: Run) -> dict[str, Any]:
    values = {f.name: getattr(run, f.name) for f in fields(run)}
    return {**_FORMAT, **values, "options": asdict(run.options)}


def _from_dict(data: dict[str, Any]) -> Run:
    options: dict[str, Any] = {
        f.name: data["options"][f.name] for f in fields(CalibrateOptions) if f.name in data["options"]
    }
    for name in {"without", "hold"} & set(options):
        options[name] = tuple(options[name])
    captures: dict[Method, list[str]] = data["captures"]
    signs: dict[Method, str] = data["made_from"]
    return Run(
        number=int(data["number"]),
        made_at=str(data["made_at"]),
        read_ns=int(data["read_ns"]),
        options=CalibrateOptions(**options),
        captures={m: tuple(captures[m]) for m in ARCHIVES if m in captures},
        excluded={str(c): tuple((int(r), int(k)) for r, k in pairs) for c, pairs in data["excluded"].items()},
        made_from={m: signs[m] for m in ARCHIVES if m in signs},
        figures=dict(data["figures"]),
        name=str(data.get("name", "")),
    )
