"""Kept runs: every calibration stays with its options and figures, can be compared and made the current one again.

``results/runs/0004/`` holds the archives of one run, what they were made from and their figures; it appears whole and
is never changed. ``results/current.json`` is the one pointer: it names the run in use of every method, and is replaced
in one step. Readers go through it (`calibration_file`). A calibration that was not computed anew stays where it is: the
run names the one that holds it. So a run costs what was computed: 0.6 MB for the adjustment of 40 stations, 24 bytes a
pixel for a depth calibration. Beyond `MOST_RUNS` the oldest go that are not in use, named, signed or needed by another.

An operator's name for a run and his sign-off lie in the run's folder, in files of their own.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from core.atomic import flush_folder, make_folder, part_prefix
from core.errors import InputError, StripeError
from core.fields import kept_object, text_of
from core.geometry import LENSES, rotation_vector_from_matrix
from core.lazy import dataclass
from core.model import Figures, Method, Project
from core.pipeline.folders import result_path
from core.pipeline.methods import METHODS, archives_of
from core.pipeline.options import CalibrateOptions
from core.pipeline.state.inputs import Record
from core.project import save_archive, write_json
from core.project.contents import contents_of, hash_file
from core.project.lock import writing_results

MOST_RUNS = 20
NAME, SIGN_OFF, DELETED = "name.json", "sign-off.json", "deleted.json"  # what people add to a run
_FORMAT = {"format": "stripe-run", "version": 2}
_UNREADABLE = (OSError, ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError)


@dataclass(frozen=True)
class Run:
    """One calibration as it was made."""

    number: int
    made_at: str  #: when it ended, ISO 8601 with the offset of the zone
    options: CalibrateOptions
    captures: Mapping[Method, tuple[str, ...]]  #: names of the captures used by each method
    #: targets that an operator had excluded, (row, col) each, by capture
    excluded: Mapping[str, tuple[tuple[int, int], ...]]
    #: what each method's result follows from, see `core.pipeline.state.inputs`
    made_from: Mapping[Method, Record]
    figures: Figures = field(repr=False)  #: as `calibrate --json` writes them
    #: number of the run that holds a method's archives, where that is another one
    held_by: Mapping[Method, int] = field(default_factory=dict)
    archives: Mapping[str, str] = field(default_factory=dict)  #: hashes of its own archives, by file name
    name: str = ""  #: what an operator called it

    @property
    def methods(self) -> tuple[Method, ...]:
        """The methods it calibrated by."""
        return tuple(method for method in METHODS if method in self.captures)

    def holder(self, method: Method) -> int:
        """Give the number of the run in whose folder a method's archives lie."""
        return self.held_by.get(method, self.number)


def now() -> str:
    """Give the time in the zone of this machine, to the second."""
    return datetime.now(UTC).astimezone().isoformat(timespec="seconds")


def keep_run(project: Project, run: Run, archives: Mapping[str, object]) -> Run:
    """Keep a run, with its archives by file name, under the next free number and make it the current one.

    Its folder appears whole, then the pointer is turned to it: what stops this leaves the old state or the new one.
    Archives of a method that another run holds are not written. BusyError if another program writes into the project.
    """
    with writing_results(project.path, "calibrate"):
        root = result_path(project, "runs")
        make_folder(root)
        known = list_runs(project)
        folders = [int(path.name) for path in root.glob("[0-9]*") if path.name.isdigit()]
        number = max((0, *folders, *current_runs(project).values())) + 1
        part = root / f"{part_prefix(f'{number:04d}')}part"
        try:
            shutil.rmtree(part, ignore_errors=True)
            for name, value in archives.items():
                save_archive(part / name, value)
            hashes = {name: hash_file(part / name) or "" for name in archives}
            run = replace(run, number=number, archives=hashes)
            values = {f.name: getattr(run, f.name) for f in fields(run) if f.name != "name"}
            write_json(part / "run.json", {**_FORMAT, **values, "options": asdict(run.options)})
            if run.name:
                write_json(part / NAME, {"name": run.name})
            part.rename(run_folder(project, number))
            flush_folder(root)
        except StripeError as error:  # of a folder that nobody will find
            raise type(error)(root, error.seen, error.remedy) from error
        finally:
            shutil.rmtree(part, ignore_errors=True)
        make_current(project, run)
        _prune(project, (*known, run))
    return run


def _prune(project: Project, runs: tuple[Run, ...]) -> None:
    """Delete the oldest runs beyond `MOST_RUNS`; what people named or signed, and what is needed, stays."""
    needed = set(current_runs(project).values())
    for run in runs[-MOST_RUNS:]:
        needed |= {run.number, *run.held_by.values()}
    for run in runs[:-MOST_RUNS]:
        if run.name or (run_folder(project, run.number) / SIGN_OFF).exists() or run.number in needed:
            needed |= {run.number, *run.held_by.values()}
    for run in runs:
        if run.number not in needed:
            _remove(project, run)


def list_runs(project: Project) -> tuple[Run, ...]:
    """Give the kept runs, the oldest first; one that cannot be read is left out."""
    folders = result_path(project, "runs").glob("[0-9]*")
    found = [read_run(path) for path in folders if not (path / DELETED).exists()]
    return tuple(sorted((run for run in found if run is not None), key=lambda run: run.number))


def read_run(folder: Path) -> Run | None:
    """Read a kept run; None where there is none that can be read."""
    try:
        run = _from_dict(json.loads(text_of(folder / "run.json")))
    except _UNREADABLE:
        return None
    name = kept_object(folder / NAME).get("name")
    return run if name is None else replace(run, name=str(name))


def current_runs(project: Project) -> dict[Method, int]:
    """Give the number of the run that each calibration in use came from, where that is known."""
    pointer = _pointer(project)
    return {m: number for m, number in pointer.items() if archive_of(project, m, f"{m}.npz", number) is not None}


def current_run(project: Project, method: Method) -> Run | None:
    """Give the run that the calibration in use came from, if it is kept."""
    number = current_runs(project).get(method)
    return None if number is None else read_run(run_folder(project, number))


def calibration_file(project: Project, name: str) -> Path | None:
    """Give the archive in use of a name, such as "photogrammetric.npz"; None where there is none."""
    method = next((m for m in METHODS if name in archives_of(m)), None)
    number = None if method is None else _pointer(project).get(method)
    return None if method is None or number is None else archive_of(project, method, name, number)


def calibration_hashes(project: Project, methods: Iterable[Method] | None = None) -> dict[str, str | None]:
    """Give the hash of each calibration in use, under the words that name it; those that are not there are left out."""
    contents = contents_of(project.path)
    files = {method: calibration_file(project, f"{method}.npz") for method in (METHODS if methods is None else methods)}
    return {f"{method} calibration": contents.of(file) for method, file in files.items() if file is not None}


def _pointer(project: Project) -> dict[Method, int]:
    stored = kept_object(result_path(project, "current.json"))
    return {m: stored[m] for m in METHODS if isinstance(stored.get(m), int)}


def archive_of(project: Project, method: Method, name: str, number: int) -> Path | None:
    """Give an archive of a run, wherever it lies."""
    folder = run_folder(project, number)
    if not (path := folder / name).is_file():
        run = read_run(folder)
        path = run_folder(project, run.holder(method)) / name if run is not None else path
    return path if os.path.lexists(path) else None  # a pipe or a loose link is told where it is read


def make_current(project: Project, run: Run) -> None:
    """Put a kept run's calibrations in use; later stages then count as outdated.

    A method that the run did not calibrate by stays as it is.

    Raises
    ------
    InputError
        If one of its archives is missing; nothing is changed then.
    BusyError
        If another program writes into the project.
    """
    with writing_results(project.path, "calibrate"):
        for method in run.methods:
            folder = run_folder(project, run.holder(method))
            for name in archives_of(method):
                if not (folder / name).is_file():
                    raise InputError(folder / name, "not there", "choose another run, or calibrate again")
        numbers = {**current_runs(project), **dict.fromkeys(run.methods, run.number)}
        write_json(result_path(project, "current.json"), numbers)


def rename_run(project: Project, run: Run, name: str) -> Run:
    """Give a kept run a name of the operator's."""
    renamed = replace(run, name=name.strip())
    write_json(run_folder(project, run.number) / NAME, {"name": renamed.name})
    return renamed


def delete_run(project: Project, run: Run) -> None:
    """Delete a kept run.

    Raises
    ------
    InputError
        If a calibration in use came from it.
    BusyError
        If another program writes into the project.
    """
    folder = run_folder(project, run.number)
    with writing_results(project.path, "calibrate"):
        if run.number in current_runs(project).values():
            raise InputError(folder, "is in use", "make another run the current one first")
        write_json(folder / DELETED, {"deleted": now()})
        kept = list_runs(project)
        for other in map(read_run, sorted(result_path(project, "runs").glob("[0-9]*"))):
            # its folder goes once the depth calibration in it is no other run's
            if other is not None and other not in kept and all(other.number not in k.held_by.values() for k in kept):
                _remove(project, other)


def _remove(project: Project, run: Run) -> None:
    folder = run_folder(project, run.number)
    gone = folder.with_name(f"{part_prefix(folder.name)}part")
    with suppress(OSError):
        folder.rename(gone)  # in one step: what is half deleted is no run
        flush_folder(folder.parent)
    shutil.rmtree(gone, ignore_errors=True)


def run_folder(project: Project, number: int) -> Path:
    """Where a kept run lies."""
    return result_path(project, "runs") / f"{number:04d}"


def _from_dict(data: dict[str, Any]) -> Run:
    options: dict[str, Any] = {
        f.name: data["options"][f.name] for f in fields(CalibrateOptions) if f.name in data["options"]
    }
    for name in {"without", "hold"} & set(options):
        options[name] = tuple(options[name])
    captures: dict[Method, list[str]] = data["captures"]
    records: dict[Method, Any] = data["made_from"]
    holders: dict[Method, int] = data["held_by"]
    return Run(
        number=int(data["number"]),
        made_at=str(data["made_at"]),
        options=CalibrateOptions(**options),
        captures={m: tuple(captures[m]) for m in METHODS if m in captures},
        excluded={str(c): tuple((int(r), int(k)) for r, k in pairs) for c, pairs in data["excluded"].items()},
        made_from={m: dict(records[m]) for m in METHODS if isinstance(records.get(m), dict)},
        figures=dict(data["figures"]),
        held_by={m: int(holders[m]) for m in METHODS if m in holders},
        archives={str(name): str(value) for name, value in data["archives"].items()},
    )


@dataclass(frozen=True)
class Difference:
    """One parameter in two runs.

    `first` and `second` are (value, sigma) in `unit`, sigma 0 where it was held. `in_sigmas` is the difference, second
    minus first, over the greater of both sigmas: not a test, since the runs share observations, but a measure of what a
    change was worth. It is None where neither run estimated the parameter or they are not comparable.
    """

    name: str
    unit: str
    first: tuple[float, float]
    second: tuple[float, float]
    difference: float
    in_sigmas: float | None


def compare_runs(first: Run, second: Run) -> tuple[Difference, ...]:
    """Compare the calibrations of devices in two runs, parameter by parameter; empty if one has none.

    The turn of the projector between the runs is given about the camera's axes: its components in the first run are
    zero by definition.
    """
    for method in first.figures.keys() & second.figures.keys():
        if all({"devices", "orientations"} <= run.figures[method].keys() for run in (first, second)):
            return _of_devices(first.figures[method], second.figures[method])
    return ()


def _of_devices(a: dict[str, Any], b: dict[str, Any]) -> tuple[Difference, ...]:
    found = []
    for device, one in a["devices"].items():
        other, lens = b["devices"].get(device), LENSES[one["model"]]
        if other is None or other["model"] != lens.name:
            continue
        same_zero = np.isclose(one.get("r0_mm", 0.0), other.get("r0_mm", 0.0), rtol=1e-9)
        for name, key, unit in zip(lens.names, lens.keys, lens.units, strict=True):
            values = [(float(d[key]["value"]), float(d[key]["sigma"])) for d in (one, other)]
            found.append(_difference(f"{device} {name}", unit, values[0], values[1], bool(same_zero)))
    both = {n: (o, b["orientations"].get(n, {})) for n, o in a["orientations"].items()}
    for device, (one, other) in both.items():
        if one["from"] == other.get("from"):
            found += _relative(one, other, f"{device} " if len(both) > 1 else "")
    return tuple(found)


def _relative(a: dict[str, Any], b: dict[str, Any], of: str) -> list[Difference]:
    """Differences of a device's relative orientations; the shift and turn of its frame."""
    turn = rotation_vector_from_matrix(np.array(b["rotation"]) @ np.array(a["rotation"]).T)
    found = []
    for i, axis in enumerate("XYZ"):
        sigmas = [1e3 * _sigma(run, "rotation_sigma_rad", i) for run in (a, b)]
        found.append(_difference(f"{of}turn about {axis}", "mrad", (0.0, sigmas[0]), (1e3 * float(turn[i]), sigmas[1])))
    for i, axis in enumerate("XYZ"):
        one, other = ((float(run["translation_mm"][i]), _sigma(run, "translation_sigma_mm", i)) for run in (a, b))
        found.append(_difference(f"{of}shift {axis}", "mm", one, other))
    return found


def _sigma(run: dict[str, Any], key: str, axis: int) -> float:
    return float(run[key][axis] or 0.0)


def _difference(
    name: str, unit: str, first: tuple[float, float], second: tuple[float, float], comparable: bool = True
) -> Difference:
    difference, sigma = second[0] - first[0], max(first[1], second[1])
    return Difference(name, unit, first, second, difference, difference / sigma if sigma > 0 and comparable else None)
