"""What this program wrote into a folder that people may use too, so that it replaces that and nothing else.

A small file lists what was written, with a hash each. What is not listed, or is not as it was written, belongs to
somebody: it is neither replaced nor deleted, but named.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from core import atomic
from core.atomic import PART, write_json
from core.errors import BusyError, InputError, StripeError, listed
from core.fields import kept_object
from core.project.contents import FILE as CONTENTS
from core.project.contents import contents_of, hash_file
from core.project.lock import DOCUMENT_LOCK, RESULTS_LOCK, lock

FILE = ".stripe-made.json"
_SCRATCH = {FILE, f"{FILE}.lock", CONTENTS, DOCUMENT_LOCK, RESULTS_LOCK}  # the program's own memory: nobody misses it
_MOST_NAMED = 3
_HASHES: dict[tuple[int, ...], str | None] = {}


def read_made(folder: Path) -> dict[str, Any]:
    """Read what is listed of a folder, and which of it users `named`; nothing where no list can be read."""
    stored = kept_object(Path(folder) / FILE)
    files, named = stored.get("files"), stored.get("named")
    if not isinstance(files, dict):
        return {"files": {}, "named": []}
    names = [*map(str, named)] if isinstance(named, list) else []
    return {**stored, "files": {k: str(v) for k, v in files.items()}, "named": names}


def note_made(folder: Path, facts: Mapping[str, Any]) -> None:
    """List every file that is in a folder and below it, with facts of its making."""
    contents = contents_of(folder)
    paths = [path for path in _files(folder) if path.name not in _SCRATCH]
    contents.learn(paths)
    files = {_name(path, folder): contents.of(path) for path in paths}
    write_json(Path(folder) / FILE, {"format": "stripe-made", "version": 1, **facts, "files": files})
    contents.keep()


def foreign(folder: Path, own: Collection[str] = ()) -> list[str]:
    """Name the files below a folder that are not listed, or not as they were written; `own` are the program's too."""
    made, found = read_made(folder), []
    for path in _files(folder):
        name = _name(path, folder)
        if path.name in _SCRATCH or name in own or (path.name.startswith(".") and path.name.endswith(PART)):
            continue
        if not _is_own(made, name, path):
            found.append(name)
    return sorted(found)


def remove_made(folder: Path, own: Collection[str] = ()) -> None:
    """Remove what this program wrote into a folder, if there is nothing else.

    An InputError names what somebody added or changed; nothing has been removed then.
    """
    others = foreign(folder, own)
    if others:
        raise InputError(
            folder,
            f"holds what was added or changed since: {listed(others, _MOST_NAMED)}",
            "choose a new or empty folder, or move these away",
        )
    for path in _files(folder):
        path.unlink(missing_ok=True)
    for root, _, _ in os.walk(folder, topdown=False):
        if Path(root) != Path(folder):
            with suppress(OSError):
                os.rmdir(root)


def claim(path: Path) -> None:
    """See that a file may be written where a user said: nothing is there, or what was written so and nobody changed.

    What this program keeps in a project is not replaced, but for the report.
    """
    try:
        if not os.path.isfile(path) or not os.path.getsize(path):
            return
    except OSError:
        return
    path = Path(os.path.realpath(path))
    made = read_made(path.parent)
    if among_results(path, "report"):
        return
    if path.name not in made["named"] or not _is_own(made, path.name, path):
        seen = "is there already, and not as this program wrote it"
        raise InputError(path, seen, "give another name, or move that file away")


def among_results(path: Path, *within: str) -> bool:
    """Whether a place lies among the results of a project, in a folder of them if that is named."""
    path = Path(os.path.realpath(path))
    project = next((p for p in path.parents if (p / "project.json").is_file()), None)
    return project is not None and path.is_relative_to(project.joinpath("results", *within))


@contextmanager
def guarding(out: Path, *, beside: bool = False) -> Iterator[None]:
    """Write into a place that a user named: replace there only what this program wrote and nobody changed.

    With `beside` that holds for what is written beside a file, too. What is about to take its place is listed before it
    does, beside what it replaces, so that a kill at any moment leaves a file that is listed.
    """
    out = Path(os.path.realpath(out))
    written: dict[Path, set[str]] = {}

    def concerns(path: Path) -> bool:
        return path.name != FILE and (path == out or out in path.parents or (beside and path.parent == out.parent))

    def before(path: Path) -> None:
        if concerns(path) and path.name not in written.get(path.parent, ()):
            claim(path)

    def placing(path: Path, part: Path) -> None:
        if concerns(path):
            written.setdefault(path.parent, set()).add(path.name)
            with suppress(InputError, BusyError):  # but where the disk is full, what cannot be listed is not written
                _add(path.parent, {path.name}, part)

    hooks, atomic.hooks = atomic.hooks, (before, placing)
    try:
        yield
    finally:
        atomic.hooks = hooks
        for folder, names in written.items():
            if not folder.is_dir():  # the work failed and took it away again
                continue
            with suppress(StripeError, OSError):
                _add(folder, names)


def _add(folder: Path, names: set[str], part: Path | None = None) -> None:
    """List what was written, or, as `part`, what is about to be."""
    with lock(folder / f"{FILE}.lock", "listing what was written", wait_s=5.0):
        made = read_made(folder)
        files = {name: value for name, value in made["files"].items() if name in names or (folder / name).exists()}
        before = {name: value for name, value in _replaced(made).items() if name not in names}
        replaced = {name: value for name, value in before.items() if _hash(folder / name) != files.get(name)}
        for name in sorted(names):
            if part is not None:
                replaced[name], files[name] = files.get(name, ""), _hash(part)
            elif (folder / name).is_file():
                files[name] = _hash(folder / name)
        named = sorted({*made["named"], *names} & files.keys())
        facts = {"format": "stripe-made", "version": 1, **made, "files": files, "named": named, "replaced": replaced}
        write_json(folder / FILE, facts)


def _replaced(made: Mapping[str, Any]) -> dict[str, str]:
    """What the files hold that were about to be replaced when a program was stopped."""
    stored = made.get("replaced")
    return {str(k): str(v) for k, v in stored.items()} if isinstance(stored, dict) else {}


def _is_own(made: Mapping[str, Any], name: str, path: Path) -> bool:
    """Whether a file is as this program wrote it."""
    return _hash(path) in (made["files"].get(name), _replaced(made).get(name))


def _hash(path: Path) -> str | None:
    """Hash a file, but not again where it only got another name: what was written is listed before and after that."""
    with suppress(OSError):
        stat = os.stat(path)
        key = stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns
        if key not in _HASHES:
            _HASHES[key] = hash_file(path)
        return _HASHES[key]
    return None


def _files(folder: Path) -> list[Path]:
    return [Path(root) / name for root, _, names in os.walk(folder) for name in names]


def _name(path: Path, folder: Path) -> str:
    return path.relative_to(folder).as_posix()
