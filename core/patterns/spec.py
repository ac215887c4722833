"""A sequence as data: a preset with options, or a list of patterns; read from JSON or a command's argument."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import field
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Any

from core.errors import InputError
from core.fields import Fields, text_of
from core.lazy import dataclass
from core.patterns.kinds import Lines, Pattern
from core.patterns.pattern import grey_reason, pattern_from_dict, pattern_to_dict, refuse_beyond
from core.patterns.presets import PRESETS, Size


@dataclass(frozen=True)
class SequenceSpec:
    """What a projector of any size is to show, one pattern after the other."""

    preset: str | None = None  #: a name of `core.patterns.PRESETS`; None for a list
    #: of the preset, as they were given; what is not given has the preset's default
    options: Mapping[str, Any] = field(default_factory=dict)
    listed: tuple[Pattern, ...] = ()  #: of a list
    files: tuple[str, ...] = ()  #: the frames' names where a capture.json was read that gives them
    #: whose these frames are, camera and projector; empty where it does not say
    devices: tuple[tuple[str, str], ...] = ()
    exposures_ms: tuple[float | None, ...] = ()  #: of these frames; empty where nothing was read of them

    def patterns(self, lines: Size, where: str = "sequence") -> tuple[Pattern, ...]:
        """Give the patterns for a projector of so many columns and rows; a list made for another size is an InputError.

        Examples
        --------
        >>> len(SequenceSpec("paper").patterns((640, 640)))
        28
        """
        if self.preset is not None:
            return _made(self.preset, json.dumps(dict(self.options), sort_keys=True), lines)
        for i, pattern in enumerate(self.listed):
            refuse_beyond(pattern, lines, f"{where}: pattern {i}")
        return self.listed

    @property
    def data(self) -> Any:
        """What project.json holds."""
        if self.preset is not None:
            return {"preset": self.preset, **self.options}
        return [pattern_to_dict(pattern) for pattern in self.listed]

    @property
    def words(self) -> str:
        """Its name for messages."""
        more = ", ".join(f"{key} {value}" for key, value in self.options.items())
        return f"{len(self.listed)} listed patterns" if self.preset is None else f"{self.preset}{more and f' ({more})'}"


_USUAL: dict[str, tuple[Any, ...]] = {"steps": (4, 3, 0, 5, 6, 8, 12), "plain": (False,), "axes": ("x", "y")}


def like(spec: SequenceSpec, lines: Size, count: int) -> str | None:
    """Give the argument of a sequence like this one, by one or two usual options, that has so many patterns.

    Examples
    --------
    >>> like(SequenceSpec("gray-inverse"), (1024, 1024), 42)
    'gray-inverse:steps=0'
    """
    if spec.preset is None:
        return None
    known = PRESETS[spec.preset].options
    changes = [{key: v} for key in known for v in _USUAL.get(key, ()) if spec.options.get(key) != v]
    for more in [*changes, *({**a, **b} for a, b in combinations(changes, 2))]:
        options = {**spec.options, **more}
        with suppress(InputError):  # not every preset has all values
            if len(SequenceSpec(spec.preset, options).patterns(lines)) == count:
                return f"{spec.preset}:" + ",".join(f"{key}={str(v).lower()}" for key, v in options.items())
    return None


def default_sequence(grey: bool) -> SequenceSpec:
    """Give the sequence of a projector that nobody chose one for: sine fringes where it can show grey."""
    return SequenceSpec("gray-sine" if grey else "paper")


def shows_grey(patterns: tuple[Pattern, ...]) -> bool:
    """Say whether patterns need a projector of grey values."""
    return any(grey_reason(pattern) for pattern in patterns)


@lru_cache(maxsize=32)
def _made(preset: str, options: str, lines: Size) -> tuple[Pattern, ...]:
    chosen, fields = PRESETS[preset], Fields(json.loads(options), preset)
    return tuple(chosen.make(lines, {key: read(fields, key) for key, read in chosen.options.items()}))


def read_sequence(data: object, where: str) -> SequenceSpec:
    """Read what project.json holds under "sequence".

    Examples
    --------
    >>> read_sequence({"preset": "gray-sine", "steps": 8}, "project.json: sequence").words
    'gray-sine (steps 8)'
    """
    if isinstance(data, list):
        if not data:
            raise InputError(where, "an empty list", "give at least one pattern, or a preset")
        return SequenceSpec(listed=tuple(pattern_from_dict(p, f"{where}: pattern {i}") for i, p in enumerate(data)))
    if isinstance(data, str):
        data = {"preset": data}
    fields = Fields.of(data, where)
    name = fields.text("preset", among=tuple(PRESETS))
    options = {key: value for key, value in fields.data.items() if key != "preset"}
    known = PRESETS[name].options
    for key in options:
        if key not in known:
            raise InputError(where, f"the preset {name} has no option {key!r}", f"use {', '.join(known)}")
    for key, read in known.items():
        read(fields, key)
    return SequenceSpec(name, options)


def parse_sequence(text: str, where: str = "--sequence") -> SequenceSpec:
    """Read a sequence as a command's argument gives it.

    It is a preset's name, with options as in ``gray-sine:period=24,steps=8``; what project.json may hold, as JSON; or a
    file of that, a capture.json or a project.json.

    Examples
    --------
    >>> parse_sequence("gray-sine:period=24,axes=x").patterns((64, 48))[-3]
    Phase(axis='x', period=24.0, steps=4, step=3, shift_rad=4.71238898038469, profile='sine')
    """
    text = text.strip()
    if text.startswith(("[", "{")):
        return read_sequence(_json(text, where), where)
    name, _, rest = text.partition(":")
    if name in PRESETS:
        options: dict[str, Any] = {}
        for item in re.split(r",(?![^\[]*\])", rest) if rest else []:
            key, equals, value = item.partition("=")
            if not equals:
                raise InputError(where, f"{item!r} after {name}", "give options as in gray-sine:period=24,steps=8")
            if (key := key.strip()) in options:
                raise InputError(where, f"{key!r} after {name} twice", "give every option once")
            options[key] = _value(value.strip())
        return read_sequence({"preset": name, **options}, where)
    if os.path.exists(text) or text.endswith(".json"):
        return read_sequence_file(Path(text))
    known = ", ".join(PRESETS)
    raise InputError(where, f"no preset or file {text!r}", f"use {known}, or a JSON file of patterns")


def read_sequence_file(path: Path) -> SequenceSpec:
    """Read a sequence from a JSON file: a list or preset, a capture.json with the frames' names, or a project.json."""
    if path.is_dir():
        path = path / "capture.json"
    try:
        data = _json(text_of(path), str(path))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise InputError(
            path, f"cannot be read ({reason})", "give a JSON file of patterns or a preset's name"
        ) from error
    if isinstance(data, dict) and "frames" in data:
        fields = Fields(data, str(path))
        entries = [Fields.of(item, f"{path}: frame {i}") for i, item in enumerate(fields.items("frames"))]
        listed = tuple(pattern_from_dict(e.data.get("pattern"), e.where) for e in entries)
        names = tuple(e.text("file") for e in entries if e.data.get("file") is not None)
        if not listed:
            raise InputError(path, "lists no frames", "give a capture.json with frames")
        devices = tuple((e.text("camera", default=""), e.text("projector", default="")) for e in entries)
        exposures = tuple(e.real("exposure_ms", above=0.0, default=None) for e in entries)
        files = names if len(names) == len(listed) else ()
        return SequenceSpec(listed=listed, files=files, devices=devices, exposures_ms=exposures)
    if isinstance(data, dict) and "sequence" in data:
        return read_sequence(data["sequence"], f"{path}: sequence")
    return read_sequence(data, str(path))


def _json(text: str, where: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(where, f"not JSON ({error})", "give a list of patterns or an object with a preset") from error


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def uses_version_2(patterns: tuple[Pattern, ...] | list[Pattern]) -> bool:
    """Say whether a capture of these patterns needs version 2 of the format."""
    return any(pattern.kind in ("level", Lines.kind) for pattern in patterns)
