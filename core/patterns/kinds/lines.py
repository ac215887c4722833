"""Any lines: every line's brightness by itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from core.fields import Fields
from core.lazy import dataclass
from core.patterns.kinds.kind import Array, Axis, Kind, Numbers, read_axis


@dataclass(frozen=True)
class Lines:
    """One entry a line: a text of 0 and 1, or levels from 0 to 1; what lies beyond is dark.

    Examples
    --------
    >>> Lines.of("x", [0, 1, 1, 0])
    Lines(axis='x', values='0110')
    """

    axis: Axis
    values: str | tuple[float, ...]
    kind: ClassVar[str] = "lines"

    @staticmethod
    def of(axis: Axis, levels: Iterable[float]) -> Lines:
        """Make the pattern from levels, as a text where all are 0 or 1."""
        values = tuple(float(value) for value in levels)
        plain = all(value in (0, 1) for value in values)
        return Lines(axis, "".join(str(int(value)) for value in values) if plain else values)


def _read(fields: Fields) -> Lines:
    axis, values = read_axis(fields), fields.data.get("values")
    if isinstance(values, str):
        if not values or set(values) - {"0", "1"}:
            raise fields.refuse("values", values, 'give one 0 or 1 a line, as in "0110", or a list of levels')
        return Lines(axis, values)
    levels = [Fields({"values": v}, f"{fields.where}: line {i}").real("values")
              for i, v in enumerate(fields.items("values"))]  # fmt: skip
    wrong = [i for i, level in enumerate(levels) if not 0 <= level <= 1]
    if wrong or not levels:
        seen = f"values[{wrong[0]}]" if wrong else "values"
        raise fields.refuse(seen, levels[wrong[0]] if wrong else [], "give every line a level from 0 to 1")
    return Lines.of(axis, levels)


def _light(pattern: Lines, i: Numbers) -> Array:
    text = isinstance(pattern.values, str)
    known = np.frombuffer(pattern.values.encode(), np.uint8) - 48.0 if text else np.array(pattern.values)  # type: ignore[union-attr]
    inside = (i >= 0) & (i < len(known))
    return np.where(inside, known[np.clip(i, 0, len(known) - 1)], 0.0)


def _words(pattern: Lines, along: str) -> str:
    shown = pattern.values if isinstance(pattern.values, str) else "".join(str(round(v)) for v in pattern.values)
    return f"word {shown[:12]}{'…' * (len(shown) > 12)} across {along}"


def _grey(pattern: Lines) -> str | None:
    return None if isinstance(pattern.values, str) else "the pattern has lines between black and white: use 0 and 1"


def _beyond(pattern: Lines, lines: int) -> tuple[str, str] | None:
    if len(pattern.values) == lines:
        return None
    return f"values has {len(pattern.values)} entries, the projector {lines} lines", "give one entry for every line"


def _write(pattern: Lines) -> dict[str, Any]:
    values = pattern.values if isinstance(pattern.values, str) else list(pattern.values)
    return {"axis": pattern.axis, "values": values}


LINES = Kind("word", _read, _light, _words, _grey, beyond=_beyond, write=_write)
