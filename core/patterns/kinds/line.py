"""Light sectioning: a line at a time."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from core.fields import Fields
from core.lazy import dataclass
from core.patterns.kinds.kind import Array, Axis, Kind, Numbers, read_axis


@dataclass(frozen=True)
class Line:
    """Light sectioning: the `width` lines from `index` on are lit, all others dark."""

    axis: Axis
    index: int
    width: int = 1
    kind: ClassVar[str] = "line"


def _read(fields: Fields) -> Line:
    return Line(read_axis(fields), fields.integer("index", 0), fields.integer("width", 1, default=1))


def _light(pattern: Line, i: Numbers) -> Array:
    return np.asarray((i >= pattern.index) & (i < pattern.index + pattern.width), dtype=np.float64)


def _beyond(pattern: Line, lines: int) -> tuple[str, str] | None:
    if pattern.index >= lines:
        return f"index is {pattern.index}, the projector has {lines} lines", f"give a line from 0 to {lines - 1}"
    if pattern.width > lines:
        return f"width is {pattern.width}, the projector has {lines} lines", "give the lines that are lit"
    return None


LINE = Kind("section", _read, _light, lambda pattern, along: f"line {pattern.index} of the {along}", beyond=_beyond)
