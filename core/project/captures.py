"""project.json, testfield.csv, capture.json and picks.json, read with every check and written whole."""

from __future__ import annotations

import marshal
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from core.atomic import atomic_write, write_json
from core.errors import InputError, StripeError
from core.fields import VERSIONS, Fields, read_document, read_table
from core.model import Capture, DeviceSpec, Frame, Note, Project, Rig, ScaleBar, Seed, Subject, Testfield
from core.patterns import (
    Pattern,
    SequenceSpec,
    alike,
    pattern_from_dict,
    pattern_to_dict,
    read_sequence,
    refuse_beyond,
    uses_version_2,
)
from core.project.lock import DOCUMENT_LOCK, lock
from core.project.rigs import bar_to_dict, read_bar, read_rig, rig_to_dict, rig_version
from core.project.unfinished import unfinished_status

VERSION = 1  # written wherever nothing of a later one is used
PATIENCE_S = 30.0  # for another program that is writing project.json
ROLES = ("testfield", "depth", "plane", "object")
_UNKNOWN: tuple[tuple[str, Mapping[str, DeviceSpec]], ...] = (("camera", {}), ("projector", {}))  # no project: any name
_KNOWN_FRAMES: dict[bytes, tuple[tuple[Frame, ...], tuple[Note, ...]]] = {}
_MANY_LINES = 4096, 4096  # where the projector is not known
_MOST_KNOWN = 64
_COLUMNS = ("row", "col", "x_mm", "y_mm", "z_mm", "diameter_mm")


# ------------------------------------------------------------------------------------------------------------- reading
MOST_FRAMES = 10_000  # a light section of every line of a 4K projector, both ways, is 6,000
ENOUGH = 4  # picks that measuring needs
PICKS, DRAFT = "picks.json", "picks-draft.json"


def read_project(folder: Path) -> Project:
    """Read project.json and see that every capture it lists is there."""
    folder = Path(folder)
    fields = read_document(folder / "project.json", "stripe-project")
    captures: dict[object, Path] = {}  # by what tells folders apart, however they are written
    place = str(folder)
    for name in fields.items("captures", []):
        if not isinstance(name, str) or not name:
            raise fields.refuse("captures", name, "list the folders of captures as texts")
        if lacking := not_a_capture(os.path.join(place, name)):
            seen, remedy = f"captures lists {name!r}, {lacking}", "restore that folder or remove its name"
            raise InputError(folder / "project.json", seen, remedy)
        found = os.stat(os.path.join(place, name))
        itself = (found.st_dev, found.st_ino) if found.st_ino else os.path.normpath(name)
        if other := captures.get(itself):
            again = "" if other == folder / name else f"; it is {os.path.relpath(other, folder)!r} too"
            raise fields.refuse("captures", name, f"list every capture once{again}")
        captures[itself] = folder / name
    reference = fields.get("reference")  # other programs may mean something else by it
    scale, decode, shown = fields.optional("scale"), fields.optional("decode"), fields.get("sequence")
    project = Project(
        folder,
        fields.text("name", default=folder.resolve().name),
        read_rig(fields),
        read_bar(scale) if scale else None,
        tuple(captures.values()),
        reference if isinstance(reference, str) else None,
        tuple(map(read_bar, fields.objects("lengths", "lengths, entry", []))),
        None if shown is None else read_sequence(shown, f"{fields.where}: sequence"),
        decode.flag("estimate") if decode else False,
    )
    return replace(project, notes=_misspelt(fields))


def not_a_capture(place: str) -> str:
    """Say what a listed folder lacks to be a capture; any text may be listed."""
    if os.path.isfile(os.path.join(place, "capture.json")):
        return ""
    return "a folder without capture.json" if os.path.isdir(place) else "which is not there"


def _misspelt(*read: Fields) -> tuple[Note, ...]:
    """Say once what was ignored and may be a slip; it is no error, for other programs may add fields of their own."""
    found: dict[tuple[str, str], str] = {}
    for fields in read:
        for where, key, like in fields.misspelt():
            found.setdefault((key, like), where)
    told = ((*slip, Path(where.partition(": ")[0]).name, where.partition(": ")[2]) for slip, where in found.items())
    return tuple(
        Note(f"{file}{', ' if part else ''}{part}: {key!r} is not known and was ignored; is {like!r} meant?", "value")
        for key, like, file, part in told
    )


def find_project(folder: Path) -> Path | None:
    """Look for the project that a capture's folder belongs to, upwards from it."""
    for parent in Path(folder).resolve().parents:
        if (parent / "project.json").is_file():
            return parent
    return None


def read_capture(folder: Path, project: Project | None = None) -> Capture:
    """Read capture.json, the testfield it names and picks.json where there is one; the frames stay on disk.

    Parameters
    ----------
    project : Project, optional
        Where the testfield's path starts; without it the project above the folder, or the folder itself.
    """
    folder = Path(folder)
    path = folder / "capture.json"
    fields = read_document(path, "stripe-capture")
    role = fields.text("role", among=ROLES)
    if fields.get("state") == "taking":
        status = unfinished_status(folder, len(fields.items("planned")))
        raise InputError(path, str(status), "start the same capture again: it goes on where it stopped")
    frames, here = [], str(folder)
    with os.scandir(folder) as entries:  # one look at the folder is quicker than one at each frame
        found = {entry.name: not entry.is_symlink() and entry.is_file() for entry in entries}
    listed, slips = _frames(fields, project)
    for frame in listed:
        place = f"{here}{os.sep}{frame.place}"
        if not found.get(frame.place) and not os.path.isfile(place := os.path.join(here, frame.place)):
            raise InputError(place, "the frame is not there", "record it again, or take it out of capture.json")
        frames.append(Frame(place, frame.pattern, frame.camera, frame.projector, frame.exposure_ms))
    if not frames:
        raise fields.refuse("frames", [], "a capture needs frames: record it again")
    testfield = None
    if role != "plane" and (name := fields.text("testfield", default=None)) is not None:
        if not name.strip():
            raise fields.refuse("testfield", name, "name the file of the board, or leave testfield out")
        root = project.path if project else find_project(folder) or folder
        testfield = read_testfield(root / name)
    seeds, excluded = read_picks(folder / PICKS) if PICKS in found or (folder / PICKS).exists() else ((), ())
    z_mm = fields.real("z_mm") if role == "depth" else None
    angle_deg = fields.real("angle_deg", default=None)
    notes = (*_misspelt(fields), *slips)
    return Capture(folder, role, tuple(frames), testfield, z_mm, angle_deg, seeds, excluded, notes)


def _frames(fields: Fields, project: Project | None) -> tuple[tuple[Frame, ...], tuple[Note, ...]]:
    """Read the list of frames, places from the capture's folder, and notes on it; many captures have the same."""
    items = fields.items("frames")
    if len(items) > MOST_FRAMES:
        raise InputError(fields.where, f"frames lists {len(items)}", f"give a capture at most {MOST_FRAMES} frames")
    devices = (("camera", project.rig.cameras), ("projector", project.rig.projectors)) if project else _UNKNOWN
    try:  # tells 1, 1.0 and true apart, as equality does not
        sizes = [[(n, spec.width, spec.height) for n, spec in known.items()] for _, known in devices]
        key = marshal.dumps([items, sizes], 2)
    except ValueError:
        key = b""
    if key in _KNOWN_FRAMES:
        return _KNOWN_FRAMES[key]
    frames = []
    entries = Fields({"frames": items}, fields.where).tracked().objects("frames", "frame")
    for entry in entries:
        name = str(Path(entry.text("file")))
        pattern = pattern_from_dict(entry.nested("pattern").data, f"{entry.where} ({name})")
        camera, projector = (_device_of(entry, kind, known) for kind, known in devices)
        if project:
            spec = project.rig.projectors[projector]
            refuse_beyond(pattern, (spec.width, spec.height), f"{entry.where} ({name}): pattern")
        frames.append(Frame(name, pattern, camera, projector, entry.real("exposure_ms", above=0.0, default=None)))
    _check_twice(fields, frames, project)
    again = Counter(frames)
    twice = [
        f"capture.json: {f.place} stands {n} times under one pattern: taken once" for f, n in again.items() if n > 1
    ]
    if len(_KNOWN_FRAMES) >= _MOST_KNOWN:
        _KNOWN_FRAMES.clear()
    found = tuple(again), (*_misspelt(*entries), *(Note(text, "value") for text in twice))
    return _KNOWN_FRAMES.setdefault(key, found) if key else found


def _check_twice(fields: Fields, frames: Sequence[Frame], project: Project | None) -> None:
    """Refuse a file under two patterns, unless these are alike on the whole projector."""
    known: dict[str, Frame] = {}
    for frame in frames:
        other = known.setdefault(frame.place, frame)
        spec = project.rig.projectors[frame.projector] if project else None
        lines = (spec.width, spec.height) if spec else _MANY_LINES
        if other is not frame and not alike(other.pattern, frame.pattern, lines):
            raise InputError(fields.where, f"{frame.place} stands under two patterns", "name the frame of each pattern")


def _device_of(entry: Fields, kind: str, known: Mapping[str, DeviceSpec]) -> str:
    """Name of a frame's camera or projector: that given, else the only one, else the one named after its kind."""
    given = entry.get(kind)
    if given is None:
        if kind in known or not known:
            return kind
        if len(known) == 1:
            return next(iter(known))
        raise InputError(entry.where, f"names no {kind}", f'add "{kind}": one of {", ".join(known)}')
    return str(entry.text(kind, among=tuple(known) or None))


def read_picks(path: Path) -> tuple[tuple[Seed, ...], tuple[tuple[int, int], ...]]:
    """Read the targets an operator picked, and those (row, col) that he excluded."""
    fields = read_document(path, "stripe-picks")
    seeds = []
    for seed in fields.objects("seeds", "seed"):
        camera = seed.text("camera", default="")
        seeds.append(Seed(seed.integer("row"), seed.integer("col"), seed.real("u"), seed.real("v"), camera))
    excluded: dict[tuple[int, int], None] = {}
    for i, item in enumerate(fields.items("excluded", [])):
        if not isinstance(item, list) or len(item) != 2:
            raise fields.refuse(f"excluded, entry {i},", item, "give [row, col]")
        target = Fields({"row": item[0], "col": item[1]}, f"{path}: excluded, entry {i}")
        excluded[target.integer("row"), target.integer("col")] = None
    return tuple(seeds), tuple(excluded)


def read_testfield(path: Path) -> Testfield:
    """Read the nominal targets of a board; of many captures that show it, it is one object.

    Raises
    ------
    InputError
        Naming the line: a missing column, a value that is no number, a target twice, an unknown polarity.
    """
    try:
        stat = os.stat(path)
        return _testfield(str(path), (stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino))
    except (OSError, ValueError):
        return _read_testfield(path)


@lru_cache(maxsize=32)
def _testfield(path: str, version: tuple[int, ...]) -> Testfield:
    found = _read_testfield(Path(path))
    for values in (found.row, found.col, found.xyz_mm, found.diameter_mm):
        values.flags.writeable = False  # it is shared
    return found


def _read_testfield(path: Path) -> Testfield:
    rows = read_table(path, _COLUMNS)
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    comments = (line[1:].partition(":") for line in lines if line.startswith("#"))
    told = {key.strip(): value.strip() for key, _, value in comments}
    polarity = told.get("polarity", "white-on-black")
    if polarity not in ("white-on-black", "black-on-white"):
        raise InputError(path, f"polarity is {polarity!r}", 'use "white-on-black" or "black-on-white"')
    seen: dict[tuple[int, int], str] = {}
    for row in rows:
        key = row.integer("row"), row.integer("col")
        if key in seen:
            raise InputError(
                row.where, f"target row {key[0]}, col {key[1]} is there already ({seen[key]})", "remove one of the two"
            )
        seen[key] = row.where.rpartition(": ")[2]
    return Testfield(
        np.array([k[0] for k in seen], np.int64),
        np.array([k[1] for k in seen], np.int64),
        np.array([[row.real(f"{axis}_mm") for axis in "xyz"] for row in rows]),
        np.array([row.real("diameter_mm", above=0.0) for row in rows]),
        polarity,  # type: ignore[arg-type]
        told.get("kind", Testfield.kind),
        told.get("estimator", Testfield.estimator),
        path.name,
    )


# ------------------------------------------------------------------------------------------------------------- writing


def write_project(
    folder: Path,
    name: str,
    camera: DeviceSpec | Mapping[str, DeviceSpec],
    projector: DeviceSpec | Mapping[str, DeviceSpec],
    scale: ScaleBar | None = None,
    captures: Sequence[str] = (),
    lengths: Sequence[ScaleBar] = (),
    sequence: SequenceSpec | None = None,
    **extra: Any,
) -> None:
    """Write project.json.

    `camera` and `projector` are one each, or several by name; `captures` paths from the project; `lengths` distances
    measured beside `scale`; `sequence` what is captured; `extra` further keys (such as "reference").
    """
    rig = Rig(
        {"camera": camera} if isinstance(camera, DeviceSpec) else camera,
        {"projector": projector} if isinstance(projector, DeviceSpec) else projector,
    )
    version = max(rig_version(rig), 2 if lengths or sequence else VERSION)
    data: dict[str, Any] = {"format": "stripe-project", "version": version, "name": name, **rig_to_dict(rig)}
    if scale is not None:
        data["scale"] = bar_to_dict(scale)
    if lengths:
        data["lengths"] = [bar_to_dict(bar) for bar in lengths]
    if sequence:
        data["sequence"] = sequence.data
    write_json(Path(folder) / "project.json", {**data, "captures": list(captures), **extra})


def write_testfield(path: Path, testfield: Testfield, comment: str = "") -> None:
    """Write the nominal targets of a board."""
    lines = [f"# {' '.join(comment.split())}"] if comment else []  # no line of its own may say what a board is
    usual = {"kind": Testfield.kind, "estimator": Testfield.estimator}
    lines += [f"# {key}: {said}" for key, value in usual.items() if (said := getattr(testfield, key)) != value]
    lines += [f"# polarity: {testfield.polarity}", ",".join(_COLUMNS)]
    for row, col, xyz, diameter in zip(
        testfield.row, testfield.col, testfield.xyz_mm, testfield.diameter_mm, strict=True
    ):
        lines.append(",".join([str(row), str(col), *(f"{value:.10g}" for value in (*xyz, diameter))]))
    with atomic_write(Path(path)) as file:
        file.write(("\n".join(lines) + "\n").encode())


def write_picks(path: Path, seeds: Sequence[Seed], excluded: Sequence[tuple[int, int]] = ()) -> None:
    """Write picks.json: the picks, and the targets (row, col) that must not be used in this capture."""
    picks = [
        {"row": s.row, "col": s.col, "u": s.u, "v": s.v, **({"camera": s.camera} if s.camera else {})} for s in seeds
    ]
    version = 2 if any(s.camera for s in seeds) else VERSION
    data: dict[str, Any] = {"format": "stripe-picks", "version": version, "seeds": picks}
    if excluded:
        data["excluded"] = [[row, col] for row, col in excluded]
    write_json(Path(path), data)


def write_capture_json(
    folder: Path,
    subject: Subject,
    frames: Sequence[tuple[str, Pattern]],
    *,
    extra: Mapping[str, Any] | None = None,
    more: Sequence[Mapping[str, Any]] | None = None,
) -> None:
    """Write capture.json for frames (file name and pattern) that are in the folder already.

    `more` says of each frame what version 2 adds: "camera", "projector", "exposure_ms".
    """
    version = 2 if more or uses_version_2([pattern for _, pattern in frames]) else VERSION
    data: dict[str, Any] = {"format": "stripe-capture", "version": version}
    data |= {key: value for key, value in subject.facts.items() if value is not None}
    data["frames"] = [
        {"file": name, **keys, "pattern": pattern_to_dict(pattern)}
        for (name, pattern), keys in zip(frames, more or [{}] * len(frames), strict=True)
    ]
    write_json(Path(folder) / "capture.json", {**data, **(extra or {})})


def add_capture(folder: Path, name: str) -> None:
    """List one more capture (a path from the project) in project.json, leaving all else as it is.

    One program at a time does so: captures that two record at once are both listed.
    """
    path = Path(folder) / "project.json"
    with lock(Path(folder) / DOCUMENT_LOCK, "adding a capture", wait_s=PATIENCE_S):
        fields = read_document(path, "stripe-project")
        names = fields.items("captures", [])
        if name not in names:
            write_json(path, {**fields.data, "captures": [*names, name]})


def may_list(folder: Path, name: str) -> bool:
    """Whether project.json lists a capture, or cannot be read: a write that failed last of all has taken its place."""
    try:
        return name in read_document(Path(folder) / "project.json", "stripe-project").items("captures", [])
    except StripeError:
        return True


def choose_sequence(folder: Path, sequence: SequenceSpec | None) -> None:
    """Keep in project.json what is captured from now on; None leaves it to the projector. All else stays."""
    path = Path(folder) / "project.json"
    with lock(Path(folder) / DOCUMENT_LOCK, "choosing a sequence", wait_s=PATIENCE_S):
        data = dict(read_document(path, "stripe-project").data)
        before = data.pop("sequence", None)
        if sequence is not None:
            data |= {"version": max(VERSIONS), "sequence": sequence.data}
        if data.get("sequence") != before:
            write_json(path, data)


def keep_picks(folder: Path, seeds: Sequence[Seed], excluded: Sequence[tuple[int, int]] = ()) -> None:
    """Keep the picks of a capture, finished or not; the file that no longer holds goes after the other is there.

    They are finished when every camera that has any has enough.
    """
    fewest = min(Counter(seed.camera for seed in seeds).values(), default=0)
    kept, gone = (PICKS, DRAFT) if fewest >= ENOUGH else (DRAFT, PICKS)
    if seeds or excluded:
        write_picks(Path(folder) / kept, seeds, excluded)
    else:
        (Path(folder) / kept).unlink(missing_ok=True)
    (Path(folder) / gone).unlink(missing_ok=True)


def kept_picks(folder: Path) -> tuple[tuple[Seed, ...], tuple[tuple[int, int], ...]]:
    """Give the picks of a capture and the targets it excludes, as they were kept last."""
    there = [path for path in (Path(folder) / PICKS, Path(folder) / DRAFT) if path.exists()]
    return read_picks(max(there, key=lambda path: path.stat().st_mtime_ns)) if there else ((), ())
