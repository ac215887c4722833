"""What every stage reads, by content: the record that its result carries and that says later whether it is current.

A record is plain JSON in five parts, each there where the stage reads such a thing:

    methods   the version of every method that had a part, from `METHOD_VERSIONS`
    rig       values of project.json, by dotted names such as "camera.width" or "scale.length_mm"
    options   what was chosen
    captures  by capture: "frames" (a hash for each file), "patterns", "picks", "board", and values such as "z_mm"
    results   hashes of earlier results

Files count by their content (`core.project.contents`), everything that was read from a document by its value: neither
times nor places, nor a comment in a table, nor the sources of the program count. A change of a method that gives other
figures raises its number here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from operator import attrgetter
from typing import Any

import numpy as np

from core.model import Capture, Frame, Project, Testfield
from core.pipeline.method import CalibrationMethod
from core.pipeline.options import CalibrateOptions
from core.project.contents import Contents, Look, contents_of, hash_value

Record = dict[str, Any]

# raise a number with every change after which the same frames give other figures; results of before are then outdated
METHOD_VERSIONS = {"decode": 118, "measure": 46, "calibrate": 42, "reconstruct": 13, "evaluate": 20, "report": 1}

_NOT_THE_RIG = ("path", "name", "rig", "captures", "reference", "sequence", "notes")  # fields of a project
_NOT_IN_FRAMES = (
    "pitch_mm",
    "nominal_c_mm",
    "r0_mm",
    "interior",
    "interior_sigma",
)  # what decoding need not know of a device
_READ_APART = ("path", "frames", "testfield", "seeds", "excluded", "role", "angle_deg", "z_mm", "notes")  # of a capture


def versions(*stages: str) -> dict[str, int]:
    """Give the versions of some methods."""
    return {stage: METHOD_VERSIONS[stage] for stage in stages}


def rig_values(project: Project) -> dict[str, Any]:
    """Give everything that a project says of its rig, by dotted names."""
    known = _last[0] if _last else (None, {})
    if known[0] is project:
        return dict(known[1])
    values: dict[str, Any] = {}
    for kind, devices in (("cameras", project.rig.cameras), ("projectors", project.rig.projectors)):
        for name, spec in devices.items():
            values |= _flat(name if name == kind[:-1] else f"{kind}.{name}", spec)
    for field in fields(project):
        if field.name not in _NOT_THE_RIG:
            values |= _flat(field.name, getattr(project, field.name))
    _last[:] = [(project, values)]  # as one: other threads may ask for another
    return dict(values)


_last: list[tuple[Any, dict[str, Any]]] = []  # the project asked for last and its values: every capture asks


def decoded_from(project: Project, capture: Capture, contents: Contents | Look | None = None) -> Record:
    """Record what the coordinates of one capture follow from: its frames, their patterns, the devices' sizes."""
    contents = contents or contents_of(project.path)
    return {
        "methods": versions("decode"),
        "rig": _frame_values(rig_values(project)),
        "captures": {capture.name: _shown(capture, contents)},
    }


def measured_from(project: Project, capture: Capture, side: str, contents: Contents | Look | None = None) -> Record:
    """Record what the targets of one capture follow from: what decoding reads, picks, board and rig."""
    contents = contents or contents_of(project.path)
    return {
        "methods": versions("decode", "measure"),
        "rig": _unscaled(rig_values(project)),
        "captures": {capture.name: {**_shown(capture, contents), **_picked(capture), "side": side}},
    }


def calibrated_from(
    project: Project,
    method: CalibrationMethod,
    captures: Sequence[Capture],
    options: CalibrateOptions,
    side: str,
    contents: Contents | Look | None = None,
    read: Mapping[str, Record] | None = None,
) -> Record:
    """Record what a calibration follows from: the captures it used, the rig, the scale and what was chosen.

    `read` are the records of calibrations by other methods that it takes into account.
    """
    contents = contents or contents_of(project.path)
    contents.learn(frame.place for capture in captures for frame in capture.frames)
    rig = rig_values(project)
    used: Record = {}
    for capture in captures:
        used[capture.name] = {**_shown(capture, contents), **_picked(capture), "side": side}
        if capture.z_mm is not None:
            used[capture.name]["z_mm"] = capture.z_mm
    return {
        "methods": versions("decode", "measure", "calibrate"),
        "rig": rig if method.scaled else _unscaled(rig),
        "options": {name: _plain(value) for name in method.options if (value := getattr(options, name)) != ""},
        "captures": used,
        **({"results": {f"{name} calibration": hash_value(record) for name, record in read.items()}} if read else {}),
    }


def evaluated_from(
    project: Project,
    planes: Iterable[Capture],
    calibrations: Mapping[str, str | None],
    chosen: tuple[Sequence[str] | None, Sequence[str] | None] = (None, None),
    contents: Contents | Look | None = None,
) -> Record:
    """Record what deviations follow from: the planes' frames and angles, hashes of the calibrations, the choice."""
    contents = contents or contents_of(project.path)
    return {
        "methods": versions("decode", "reconstruct", "evaluate"),
        "rig": _frame_values(rig_values(project)),
        "options": {"captures": _plain(chosen[0]), "methods": _plain(chosen[1])},
        "captures": {c.name: {**_shown(c, contents), "angle_deg": c.angle_deg} for c in planes},
        "results": dict(calibrations),
    }


def reconstructed_from(
    project: Project, capture: Capture, calibrations: Mapping[str, str | None], contents: Contents | Look | None = None
) -> Record:
    """Record what the points of one capture follow from."""
    return {
        **decoded_from(project, capture, contents),
        "methods": versions("decode", "reconstruct"),
        "results": dict(calibrations),
    }


def part_decoded(record: Mapping[str, Any], name: str) -> Record | None:
    """Take out of a record what the decoding of one of its captures followed from; None where it had no part."""
    try:
        shown = record["captures"][name]
        return {
            "methods": {"decode": record["methods"]["decode"]},
            "rig": _frame_values(record["rig"]),
            "captures": {name: {key: value for key, value in shown.items() if key not in _MEASURED}},
        }
    except (KeyError, TypeError, AttributeError):
        return None


_MEASURED = ("picks", "board", "side", "z_mm", "angle_deg")


def _frame_values(rig: Mapping[str, Any]) -> dict[str, Any]:
    """What decoding knows of a rig."""
    return {k: v for k, v in _unscaled(rig).items() if not any(part in _NOT_IN_FRAMES for part in k.split("."))}


def _unscaled(rig: Mapping[str, Any]) -> dict[str, Any]:
    """A rig without its known lengths."""
    return {key: value for key, value in rig.items() if not key.startswith(("scale.", "lengths."))}


def _shown(capture: Capture, contents: Contents | Look) -> Record:
    """Record the frames of a capture by their content, and what each was meant to show."""
    start = len(str(capture.path)) + 1
    names = [frame.place for frame in capture.frames]
    hashes = {name[start:]: contents.of(name) for name in names}
    meant = tuple((name[start:], *_of_frame(frame)) for name, frame in zip(names, capture.frames, strict=True))
    record: Record = {"frames": hashes, "patterns": _meant_hash(meant)}
    for field in fields(capture):  # whatever else a capture may come to say
        if field.name not in _READ_APART:
            record[field.name] = _plain(getattr(capture, field.name))
    return record


def _picked(capture: Capture) -> Record:
    """Record the picks of a capture and its board."""
    seeds = [[getattr(s, f.name) for f in fields(s)] for s in capture.seeds]
    picks = hash_value([seeds, sorted(map(list, capture.excluded))]) if seeds or capture.excluded else None
    return {"picks": picks, "board": None if capture.testfield is None else board_hash(capture.testfield)}


# fields that older boards lack, and what they meant
_SAID_LATER = {"kind": Testfield.kind, "estimator": Testfield.estimator}
_boards: dict[int, tuple[Testfield, str]] = {}  # by identity: many captures share a board


def board_hash(board: Testfield) -> str:
    """Hash the targets of a board: a comment in its table changes none, nor does the table's name."""
    known = _boards.get(id(board))
    if known is None or known[0] is not board:
        named = {field.name: getattr(board, field.name) for field in fields(board) if field.name != "file"}
        values = [v for name, v in named.items() if name not in _SAID_LATER or v != _SAID_LATER[name]]
        sign = hash_value([v.tolist() if isinstance(v, np.ndarray) else _plain(v) for v in values])
        known = _boards[id(board)] = board, sign
        while len(_boards) > 64:
            del _boards[next(iter(_boards))]
    return known[1]


_of_frame = attrgetter(*(field.name for field in fields(Frame) if field.name != "place"))


@lru_cache(maxsize=256)
def _meant_hash(meant: tuple[tuple[Any, ...], ...]) -> str:
    """Hash what frames were meant to show: a name, its pattern, and what else a frame says; many captures share it."""
    return hash_value({name: [repr(pattern), *map(str, more)] for name, pattern, *more in meant})


def _flat(name: str, value: Any) -> dict[str, Any]:
    return dict(_leaves(name, value))


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from _leaves(f"{name}.{field.name}", getattr(value, field.name))
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(f"{name}.{key}", item)
    elif isinstance(value, tuple | list) and any(is_dataclass(item) for item in value):
        for i, item in enumerate(value):
            yield from _leaves(f"{name}.{i}", item)
    elif value is not None and value != ():
        yield name, _plain(value)


def _plain(value: Any) -> Any:
    """Give a value as JSON gives it back."""
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return hash_value(value.tolist())
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value) and not isinstance(value, type):
        return _flat("", value)
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # JSON has no infinity
    if isinstance(value, str | int | float | bool | None):
        return value
    return str(value)


def reported_from(project: Project, results: Mapping[str, str | None]) -> Record:
    """Record what a report tells of: the project, and hashes of its results."""
    told = {"name": project.name, "reference": project.reference, "captures": len(project.captures)}
    return {
        "methods": versions("report"),
        "rig": {**rig_values(project), **{key: value for key, value in told.items() if value is not None}},
        "results": dict(results),
    }
