"""Planning a capture: what it shall record, by the project and by what the projector can show."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from core.errors import InputError, PatternRefusedError
from core.model import Plan, Project, Role, Subject
from core.patterns import Black, Level, Pattern, White, axis_of, brightness, default_sequence, describe, level_of

if TYPE_CHECKING:
    from core.devices import Projector

LONGEST_NAME = 100  # bytes; file systems take 255, and files are named after captures


def make_plan(project: Project, subject: Subject, patterns: Sequence[Pattern] | None = None) -> Plan:
    """Plan a capture of a project; by default the project's sequence, else the reference sequence of its size.

    Raises
    ------
    InputError
        For a name that is no folder name, an unknown role or device, a depth capture without its z, an empty sequence.
    """
    name, role, testfield = subject.name, subject.role, subject.testfield
    where = f"capture {name!r}"
    shaped = name == name.strip() and name.isprintable() and not any(c in name for c in '/\\:*?"<>|')
    size = len(os.fsencode(name))
    if not name or not shaped or name.startswith(".") or size > LONGEST_NAME:
        seen = f"name {name!r}" if size <= LONGEST_NAME else f"a name of {size} bytes"
        remedy = f"use a plain folder name of letters, digits, - and _, {LONGEST_NAME} bytes at most"
        raise InputError("capture", seen, remedy)
    if role not in get_args(Role):
        raise InputError(where, f"role {role!r}", f"use {', '.join(get_args(Role))}")
    if role == "depth" and subject.z_mm is None:
        raise InputError(where, "role depth without z_mm", "give the plate's position along its axis in mm")
    for key, value in (("z_mm", subject.z_mm), ("angle_deg", subject.angle_deg)):
        if value is not None and not np.isfinite(value):
            raise InputError(where, f"{key} is {value}", "give a finite number")
    if role in ("testfield", "depth") and testfield is None and (project.path / "testfield.csv").is_file():
        testfield = "testfield.csv"
    if testfield is not None:
        testfield = _in_project(project, testfield)
    rig = project.rig
    chosen_devices = {"camera": subject.camera or rig.camera_name, "projector": subject.projector or rig.projector_name}
    for kind, known in (("camera", rig.cameras), ("projector", rig.projectors)):
        if chosen_devices[kind] not in known:
            raise InputError(where, f"{kind} {chosen_devices[kind]!r}", f"use {', '.join(known)}")
    shown_by = rig.projectors[chosen_devices["projector"]]
    lines = shown_by.width, shown_by.height
    if patterns is None:
        spec = project.sequence or default_sequence(grey=False)
        patterns = spec.patterns(lines, f"{project.path / 'project.json'}: sequence")
    chosen = tuple(patterns)
    devices = {kind: name for kind, name in chosen_devices.items() if name != kind}
    if not chosen:
        raise InputError(where, "no patterns", "plan at least one")
    return Plan(replace(subject, testfield=testfield), chosen, guards_for(chosen, lines), devices)


def _in_project(project: Project, testfield: str) -> str:
    """Give the path from the project's folder of a testfield that is named from there, or from the working folder."""
    folder, given = project.path.resolve(), Path(testfield).resolve()
    if given.is_file() and given.is_relative_to(folder):
        return given.relative_to(folder).as_posix()
    if (project.path / testfield).is_file():
        return testfield
    remedy = "copy it into the project's folder" if given.is_file() else "give its path from the project's folder"
    raise InputError(project.path / testfield, "no such testfield", remedy)


def sequence_for(project: Project, projector: Projector) -> tuple[Pattern, ...]:
    """Choose what a projector shows: the project's sequence, else its own, else fringes of grey if it can show grey."""
    if project.sequence is not None:
        return project.sequence.patterns(projector.size, f"{project.path / 'project.json'}: sequence")
    return own_sequence(projector)


def own_sequence(projector: Projector) -> tuple[Pattern, ...]:
    """Give the sequence that a projector is made for, else fringes of grey if it can show grey."""
    if projector.sequence is not None:
        return tuple(projector.sequence)
    return default_sequence(projector.refusal(Level(0.5)) is None).patterns(projector.size)


def check_shown(plan: Plan, refusal: Any, projector: str) -> None:
    """See that the projector can show everything before anything is shown."""
    for pattern in plan.shots:
        if reason := refusal(pattern):
            raise PatternRefusedError(projector, f"cannot show {describe(pattern)}", reason)


def guards_for(patterns: Sequence[Pattern], lines: tuple[int, int]) -> tuple[Pattern, ...]:
    """Choose the guards of a sequence: white shows movement across and the lamp, the finest stripes movement in depth.

    Black is added where the sequence has none: what is dark must be known to tell what is bright.
    """

    def changes(pattern: Pattern) -> int:
        line = brightness(pattern, np.arange(lines[axis_of(pattern) == "y"]))
        return int(np.count_nonzero(np.diff(line > 0.5)))

    finest = max(patterns, key=changes)
    guards: list[Pattern] = [White()]
    if changes(finest):
        guards.append(finest)
    if not any(level_of(p) == 0 for p in patterns):
        guards.append(Black())
    return tuple(guards)
