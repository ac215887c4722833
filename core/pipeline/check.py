"""Every inconsistency of a project explained, and mended where nothing is lost by it.

What is damaged is set aside into ``results/damaged``, never deleted: the stage that made it makes it anew. Only what
killed programs left behind goes.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from core.atomic import is_leftover, sweep
from core.errors import InputError, StripeError
from core.fields import kept_object, read_document, text_of
from core.lazy import dataclass
from core.model import Capture, Method, Note, PlaneEvaluation, Project, TargetSet, Testfield
from core.patterns import axis_of
from core.pipeline.decode import of_another_projector
from core.pipeline.methods import METHODS, archives_of
from core.pipeline.runs import DELETED, SIGN_OFF, list_runs, read_run, run_folder
from core.progress import SILENT, Progress
from core.project import load_archive, read_capture, read_project, write_json
from core.project.captures import PATIENCE_S, not_a_capture
from core.project.contents import FILE as CONTENTS
from core.project.contents import hash_file
from core.project.images import check_frame
from core.project.lock import DOCUMENT_LOCK, RESULTS_LOCK, holder_of, lock, read_only, writing_results

_OWN = {"targets.npz": TargetSet, "evaluation.npz": PlaneEvaluation}
_DOCUMENTS = ("targets.json", "evaluation.json", "decode.json", "failures.json", "report/report.json", SIGN_OFF)
_GONE = "captures_missing"  # where project.json keeps the names of captures whose folders are not there


@dataclass(frozen=True)
class Inconsistency:
    """Something that does not fit: where, what it is, what is done about it, and whether it was or can be mended."""

    where: str
    seen: str
    remedy: str
    mended: bool = False
    mendable: bool = False

    def __str__(self) -> str:
        how = "mended: " if self.mended else "with --repair: " if self.mendable else ""
        return f"{self.where}: {self.seen}; {how}{self.remedy}"


Finding = tuple[Path, str, str, Callable[[], object] | None]  # where, seen, remedy, and how it is mended


def check_project(folder: Path, repair: bool = False, progress: Progress = SILENT) -> tuple[Inconsistency, ...]:
    """Look for everything in a project's folder that does not fit together; sweep what killed programs left.

    With `repair` what can be mended without loss is. InputError if there is no project.json to be read; BusyError if
    another program is writing there and `repair` is wanted.
    """
    folder = Path(folder)
    read_document(folder / "project.json", "stripe-project")
    found: list[Inconsistency] = []
    # nobody's any more: they go whether asked for or not; where nobody may write they are in nobody's way
    for step in () if read_only(folder) else (_locks, _leftovers):
        found += [_told(finding, folder, True) for finding in list(step(folder, progress))]
    if not repair:
        once = {(item.where, item.seen): item for item in found}
        for item in (_told(finding, folder, False) for step in _STEPS for finding in step(folder, progress)):
            once.setdefault((item.where, item.seen), item)
        return tuple(once.values())
    with writing_results(folder, "check"):
        for step in _STEPS:
            found += [_told(finding, folder, True) for finding in list(step(folder, progress))]
    return tuple(found)


def _told(finding: Finding, folder: Path, repair: bool) -> Inconsistency:
    where, seen, remedy, mend = finding
    mended = False
    if repair and mend is not None:
        try:
            mend()
            mended = True
        except StripeError as error:
            remedy = f"{remedy}; that failed: {error.seen}"
        except OSError as error:
            remedy = f"{remedy}; that failed: {error.strerror or error}"
    with suppress(ValueError):
        where = where.relative_to(folder)
    return Inconsistency(str(where), seen, remedy, mended, mend is not None)


def _locks(folder: Path, progress: Progress) -> Iterator[Finding]:
    for path in (folder / "results" / RESULTS_LOCK, folder / DOCUMENT_LOCK):
        if path.exists() and holder_of(path) is None:
            yield path, "a lock that nobody holds", "removed: it never was in anyone's way", partial(_unlock, path)


def _unlock(path: Path) -> None:
    with lock(path, "check"):
        pass  # it goes with whoever has held it
    if path.exists():
        raise PermissionError(path)


def _leftovers(folder: Path, progress: Progress) -> Iterator[Finding]:
    for root, folders, names in os.walk(folder):
        for name in (*folders, *names):
            path = Path(root, name)
            if is_leftover(path):
                seen = "left by a program that was stopped while it wrote"
                yield path, seen, "removed: the whole file was never there", partial(sweep, path.parent)


def _listed(folder: Path, progress: Progress) -> Iterator[Finding]:
    path = folder / "project.json"
    data = read_document(path, "stripe-project").data
    names = data.get("captures") or []
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        yield path, "captures is no list of texts", "list the folders of captures as texts", None
        return
    for name, count in Counter(names).items():
        if count > 1:
            seen, remedy = f"captures lists {name!r} {count} times", "listed once"
            yield path, seen, remedy, partial(_relist, folder)
        if lacking := not_a_capture(os.path.join(folder, name)):
            seen = f"captures lists {name!r}, {lacking}"
            remedy = f"its name is kept under {_GONE!r} until the folder is restored"
            yield path, seen, remedy, partial(_relist, folder, without=name)
    there = {(folder / name).resolve() for name in names}
    for document in sorted(folder.glob("captures/*/capture.json")):
        if document.parent.resolve() in there:
            continue
        name = document.parent.relative_to(folder).as_posix()
        try:
            read_capture(document.parent)
        except StripeError as error:
            yield document.parent, f"a capture that project.json does not list: {error.seen}", error.remedy, None
            continue
        seen, remedy = "a capture that project.json does not list", "listed; its name may be taken out again"
        yield document.parent, seen, remedy, partial(_relist, folder, new=name)


def _relist(folder: Path, new: str = "", without: str = "") -> None:
    """List every capture once, a new one too, without one that is gone; the name of that is kept."""
    path = folder / "project.json"
    with lock(folder / DOCUMENT_LOCK, "check", wait_s=PATIENCE_S):
        data: dict[str, Any] = dict(read_document(path, "stripe-project").data)
        before = list(data.get("captures") or [])
        data["captures"] = list(dict.fromkeys(name for name in (*before, new) if name and name != without))
        gone = [name for name in (*data.get(_GONE, []), *before) if name not in data["captures"]]
        if gone := list(dict.fromkeys(gone)):
            data[_GONE] = gone
        else:
            data.pop(_GONE, None)
        write_json(path, data)


def _captures(folder: Path, progress: Progress) -> Iterator[Finding]:
    try:
        project = read_project(folder)
    except StripeError as error:
        yield Path(error.where), error.seen, error.remedy, None
        return
    yield from _ignored(folder, project.notes)
    for name, count in Counter(path.name for path in project.captures).items():
        if count > 1:
            yield folder / "project.json", f"{count} captures are called {name!r}", "rename one of the folders", None
    boards: dict[int, Testfield] = {}
    for path in progress.over(project.captures, "looking at {0.name}"):
        try:
            capture = read_capture(path, project)
            yield from _ignored(path, capture.notes)
            if (board := capture.testfield) is not None and id(board) not in boards:
                boards[id(board)] = board
                yield from _of_board(project, path, board)
        except StripeError as error:
            yield _refused(error)
            continue
        for see in (_see_frames, _see_picks, _see_patterns):
            try:
                see(project, capture)
            except StripeError as error:
                yield _refused(error)


def _refused(error: StripeError) -> Finding:
    return Path(error.where.partition(".json: ")[0]), error.seen, error.remedy, None


def _ignored(place: Path, notes: Sequence[Note]) -> Iterator[Finding]:
    for note in notes:
        where, _, told = note.partition(": ")
        seen, _, remedy = told.partition("; ")
        yield place / where, seen, remedy, None


def _of_board(project: Project, place: Path, board: Testfield) -> Iterator[Finding]:
    """What a board's file says that its own targets, or the scale bar, contradict."""
    from core.checks import bar_notes, exchanged_notes

    for note in exchanged_notes(board):
        seen, _, remedy = note.partition(": ")
        yield place / "capture.json", seen, remedy, None
    for note in bar_notes(project.scale, board):
        yield project.path / "project.json", note, "measure both again, and correct the one that is wrong", None


def _see_frames(project: Project, capture: Capture) -> None:
    """Refuse files that are no frames of their cameras."""
    shapes = {name: (spec.height, spec.width) for name, spec in project.rig.cameras.items()}
    for frame in capture.frames:
        check_frame(frame.path, shapes.get(frame.camera))


def _see_picks(project: Project, capture: Capture) -> None:
    """Refuse picks that no measurement would take."""
    for one in capture.series:
        if one.seeds and one.testfield is not None:
            from core.measure import predicted_view

            camera = project.rig.cameras[one.camera]
            predicted_view(one.testfield, camera, one.seeds, str(capture.path / "picks.json"))


def _see_patterns(project: Project, capture: Capture) -> None:
    """Refuse patterns from which no coordinate follows."""
    from core.decode import refuse_patterns

    for one in capture.series:
        projector = project.rig.projectors[one.projector]
        patterns = [frame.pattern for frame in one.frames]
        if any(axis_of(pattern) for pattern in patterns):  # a picture alone is none to be decoded
            try:
                refuse_patterns(patterns, (projector.width, projector.height), str(capture.path))
            except InputError as error:
                raise of_another_projector(error, one, project) or error from None


def _runs(folder: Path, progress: Progress) -> Iterator[Finding]:
    for path in sorted((folder / "results" / "runs").glob("[0-9]*")):
        run = read_run(path)
        if run is None:
            yield path, "a run that cannot be read (run.json)", "set aside", partial(_set_aside, folder, path)
            continue
        for method in run.methods:
            if run.holder(method) != run.number:
                continue
            for name, kind in archives_of(method).items():
                if wrong := _wrong(path / name, kind, run.archives.get(name)):
                    remedy = "the run is set aside; `stripe-core update` calibrates anew"
                    yield path / name, wrong, remedy, partial(_set_aside, folder, path)


def _wrong(path: Path, kind: type, written: str | None) -> str:
    """Say what is wrong with a calibration's archive; nothing if it is whole."""
    if written and path.exists() and hash_file(path) != written:
        return "not as it was written"
    try:
        load_archive(path, kind)
    except StripeError as error:
        return error.seen
    return ""


def _pointer(folder: Path, progress: Progress) -> Iterator[Finding]:
    path = folder / "results" / "current.json"
    if not path.exists():
        return
    try:
        stored = json.loads(text_of(path))
        numbers = {m: int(stored[m]) for m in METHODS if m in stored}
    except (OSError, ValueError, TypeError, OverflowError, RecursionError):
        seen = "the pointer to the runs in use cannot be read"
        yield path, seen, "points to the newest runs", partial(_point, folder)
        return
    try:
        project = read_project(folder)
    except StripeError:
        return  # told already
    for method, number in numbers.items():
        if not _whole(project, method, number):
            seen = f"points to run {number} by the {method} method, which is not there whole"
            yield path, seen, "points to the newest run that is whole, if any", partial(_point, folder)


def _whole(project: Project, method: Method, number: int) -> bool:
    run = read_run(run_folder(project, number))
    if run is None or method not in run.methods:
        return False
    held = run_folder(project, run.holder(method))
    return all((held / name).is_file() for name in archives_of(method))


def _point(folder: Path) -> None:
    """Point to the newest run of every method that is whole; what is whole where it points stays."""
    project = read_project(folder)
    path = folder / "results" / "current.json"
    stored = kept_object(path)
    numbers: dict[str, int] = {}
    for method in METHODS:
        kept = [run.number for run in list_runs(project) if _whole(project, method, run.number)]
        if isinstance(stored.get(method), int) and _whole(project, method, stored[method]):
            numbers[method] = stored[method]
        elif kept:
            numbers[method] = kept[-1]
    write_json(path, numbers)


def _results(folder: Path, progress: Progress) -> Iterator[Finding]:
    results = folder / "results"
    for name, kind in _OWN.items():
        path = results / name
        if path.exists():
            try:
                load_archive(path, tuple, kind)
            except StripeError as error:
                remedy = "set aside; `stripe-core update` makes it anew"
                yield path, error.seen, remedy, partial(_set_aside, folder, path)
    documents = [results / name for name in _DOCUMENTS]
    documents += [*results.glob("points/*.json"), *results.glob(f"runs/[0-9]*/{SIGN_OFF}"), results / CONTENTS]
    documents += [*results.glob(f"runs/[0-9]*/{DELETED}")]
    for path in documents:
        if not path.exists():
            continue
        try:
            if not isinstance(json.loads(text_of(path)), dict):
                raise ValueError("no object")
        except (OSError, ValueError, RecursionError) as error:
            seen = f"damaged ({error})"
            yield path, seen, "set aside; `stripe-core update` makes it anew", partial(_set_aside, folder, path)


_STEPS = (_listed, _captures, _runs, _pointer, _results)


def _set_aside(folder: Path, path: Path) -> None:
    """Move what is damaged to where nothing reads it."""
    if not path.exists():
        return
    place = folder / "results" / "damaged"
    place.mkdir(exist_ok=True)
    name = "-".join(path.relative_to(folder / "results").parts)
    target, k = place / name, 1
    while target.exists():
        target, k = place / f"{name}.{k}", k + 1
    path.rename(target)
