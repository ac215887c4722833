"""What can be asked of a pattern of any kind."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from core.errors import InputError
from core.fields import Fields
from core.patterns.kinds import KINDS, Array, Axis, Pattern, Use

_KNOWN: dict[tuple[Any, ...], Pattern] = {}  # what was read before, by its fields
_MOST_KNOWN = 4096


def brightness(pattern: Pattern, lines: ArrayLike) -> Array:
    """How bright (0 to 1) a pattern makes projector lines, numbered along its axis (u for axis "x", v for axis "y").

    Examples
    --------
    The reference phase pattern, period 4 and shifted by a quarter, and the last Gray bit of cell 2:

    >>> from core.patterns import Code, Phase
    >>> brightness(Phase("x", 4, 4, 0, np.pi / 2, "square"), range(8))
    array([1., 1., 0., 0., 1., 1., 0., 0.])
    >>> brightness(Code("gray", "x", bit=8, bits=9, cell=2), range(8))
    array([0., 0., 1., 1., 1., 1., 0., 0.])
    """
    return KINDS[pattern.kind].light(pattern, np.asarray(lines, dtype=np.int64))


def alike(a: Pattern, b: Pattern, lines: tuple[int, int]) -> bool:
    """Whether two patterns light all columns and all rows of a projector alike."""
    if (axis := axis_of(a)) != axis_of(b):
        return False
    count = max(lines) if axis is None else lines[axis == "y"]
    return np.array_equal(brightness(a, np.arange(count)), brightness(b, np.arange(count)))


def axis_of(pattern: Pattern) -> Axis | None:
    """Give the axis that a pattern varies along; None where it lights the whole field evenly."""
    return getattr(pattern, "axis", None)


def use_of(pattern: Pattern) -> Use:
    """Say what a decoder can do with a pattern's frame (`core.patterns.kinds.Kind.use`)."""
    return KINDS[pattern.kind].use


def level_of(pattern: Pattern) -> float | None:
    """Give the level, 0 (black) to 1 (white), of a pattern that lights the whole field evenly; None for all others.

    Examples
    --------
    >>> from core.patterns import Level, Line, White
    >>> level_of(White()), level_of(Level(0.25)), level_of(Line("x", 7))
    (1.0, 0.25, None)
    """
    return float(brightness(pattern, 0)) if axis_of(pattern) is None else None


def grey_reason(pattern: Pattern) -> str | None:
    """Why a projector of black and white cannot show a pattern, and what to use instead; None if it can."""
    return KINDS[pattern.kind].grey(pattern)


def cycle_lines(pattern: Pattern) -> float | None:
    """Lines in one cycle of a pattern's finest stripes; None where it has no regular ones."""
    return KINDS[pattern.kind].cycle(pattern)


def refuse_beyond(pattern: Pattern, lines: tuple[int, int], where: str) -> None:
    """Refuse a pattern that no projector of so many columns and rows can show; an InputError."""
    found = KINDS[pattern.kind].beyond(pattern, lines[axis_of(pattern) == "y"])
    if found is not None:
        raise InputError(where, found[0], f"{found[1]}, or correct the projector's size in project.json")


def describe(pattern: Pattern) -> str:
    """Name a pattern in words.

    Examples
    --------
    >>> from core.patterns import Code
    >>> describe(Code("gray", "x", 3, 9, 2))
    'gray bit 3 of 9 across columns'
    """
    return KINDS[pattern.kind].words(pattern, "rows" if axis_of(pattern) == "y" else "columns")


def pattern_image(pattern: Pattern, width: int, height: int) -> Array:
    """Give the pattern as a projector of width × height lines shows it, shape (height, width), 0 to 1."""
    if axis_of(pattern) == "y":
        return np.tile(brightness(pattern, np.arange(height))[:, None], (1, width))
    return np.tile(brightness(pattern, np.arange(width)), (height, 1))


def pattern_to_dict(pattern: Pattern) -> dict[str, Any]:
    """Give the pattern as `capture.json` holds it."""
    return {"kind": pattern.kind, **KINDS[pattern.kind].write(pattern)}


def pattern_from_dict(data: object, where: str) -> Pattern:
    """Read a pattern of `capture.json`, the value of its key "pattern"; unknown keys are ignored.

    Examples
    --------
    >>> pattern_from_dict({"kind": "line", "axis": "x", "index": 7, "width": 2}, "capture.json")
    Line(axis='x', index=7, width=2)
    """
    fields = Fields.of(data, where)
    try:  # the captures of a project repeat their patterns; 1, 1.0 and true are equal, but not equally good
        key = tuple(fields.data.items()), tuple(map(type, fields.data.values()))
        known = _KNOWN.get(key)
    except TypeError:  # a list or an object where a pattern has none
        return _read(fields)
    if known is None:
        if len(_KNOWN) >= _MOST_KNOWN:
            _KNOWN.clear()
        known = _KNOWN[key] = _read(fields)
    return known


def _read(fields: Fields) -> Pattern:
    kind: Pattern = KINDS[fields.text("kind", among=tuple(KINDS))].read(fields)
    return kind
