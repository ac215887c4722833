"""The kinds of pattern, and how bright each makes every projector line."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.fields import Fields

Axis = Literal["x", "y"]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class White:
    """Every line on."""

    kind: ClassVar[str] = "white"


@dataclass(frozen=True)
class Black:
    """Every line off."""

    kind: ClassVar[str] = "black"


@dataclass(frozen=True)
class Code:
    """One bit of a Gray or plain binary code: line i carries number ``i // cell``; bit 0 is the most significant."""

    kind: Literal["gray", "binary"]
    axis: Axis
    bit: int
    bits: int
    cell: int = 1
    inverse: bool = False


@dataclass(frozen=True)
class Phase:
    """One of N phase steps: a cosine of `period` lines shifted by `shift_rad`, or the square wave of its sign."""

    axis: Axis
    period: float
    steps: int
    step: int
    shift_rad: float
    profile: Literal["square", "sine"] = "sine"
    kind: ClassVar[str] = "phase"


@dataclass(frozen=True)
class Line:
    """Light sectioning: the `width` lines from `index` on are lit, all others dark."""

    axis: Axis
    index: int
    width: int = 1
    kind: ClassVar[str] = "line"


Pattern = White | Black | Code | Phase | Line

_KNOWN: dict[tuple[Any, ...], Pattern] = {}  # what was read before, by its fields
_MOST_KNOWN = 4096


def brightness(pattern: Pattern, lines: ArrayLike) -> Array:
    """How bright (0 to 1) a pattern makes projector lines.

    Parameters
    ----------
    pattern : Pattern
    lines : array-like of int
        Line numbers i along the pattern's axis (u for axis "x", v for axis "y").

    Returns
    -------
    brightness : array, same shape

    Examples
    --------
    The reference phase pattern, period 4 and shifted by a quarter, and the last Gray bit of cell 2:

    >>> brightness(Phase("x", 4, 4, 0, np.pi / 2, "square"), range(8))
    array([1., 1., 0., 0., 1., 1., 0., 0.])
    >>> brightness(Code("gray", "x", bit=8, bits=9, cell=2), range(8))
    array([0., 0., 1., 1., 1., 1., 0., 0.])
    """
    i = np.asarray(lines, dtype=np.int64)
    match pattern:
        case White():
            return np.ones(i.shape)
        case Black():
            return np.zeros(i.shape)
        case Code():
            k = i // pattern.cell
            number = k ^ (k >> 1) if pattern.kind == "gray" else k
            on = (number >> (pattern.bits - 1 - pattern.bit)) & 1
            return np.asarray(on ^ pattern.inverse, dtype=np.float64)
        case Phase():
            cosine = np.cos(2 * np.pi * (i + 0.5) / pattern.period - pattern.shift_rad)
            if pattern.profile == "sine":
                return np.asarray(0.5 + 0.5 * cosine)
            # the sign at an exact zero of the cosine must not hang on its last bit
            return np.asarray(cosine > 1e-12, dtype=np.float64)
        case Line():
            return np.asarray((i >= pattern.index) & (i < pattern.index + pattern.width), dtype=np.float64)


def pattern_image(pattern: Pattern, width: int, height: int) -> Array:
    """Give the pattern as a projector of width × height lines shows it, shape (height, width), 0 to 1."""
    if isinstance(pattern, White | Black):
        return np.full((height, width), brightness(pattern, 0))
    if pattern.axis == "x":
        return np.tile(brightness(pattern, np.arange(width)), (height, 1))
    return np.tile(brightness(pattern, np.arange(height))[:, None], (1, width))


def pattern_to_dict(pattern: Pattern) -> dict[str, Any]:
    """Give the pattern as `capture.json` holds it."""
    return {"kind": pattern.kind, **asdict(pattern)}


def pattern_from_dict(data: object, where: str) -> Pattern:
    """Read a pattern of `capture.json`; unknown keys are ignored.

    Parameters
    ----------
    data : object
        The value of the key "pattern".
    where : str
        The file and field, for the message.

    Raises
    ------
    InputError
        Naming the field, the value and what is allowed.

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
    kind = fields.text("kind", among=("white", "black", "gray", "binary", "phase", "line"))
    if kind == "white":
        return White()
    if kind == "black":
        return Black()
    axis = fields.text("axis", among=("x", "y"))
    if kind == "line":
        return Line(axis, fields.integer("index", 0), fields.integer("width", 1, default=1))
    if kind == "phase":
        steps = fields.integer("steps", 3)
        step = fields.integer("step", 0, steps - 1)
        shift = fields.real("shift_rad", default=2 * np.pi * step / steps)
        profile = fields.text("profile", default="sine", among=("square", "sine"))
        return Phase(axis, fields.real("period", above=0.0), steps, step, shift, profile)
    bits = fields.integer("bits", 1, 62)
    bit, cell = fields.integer("bit", 0, bits - 1), fields.integer("cell", 1, default=1)
    return Code(kind, axis, bit, bits, cell, fields.flag("inverse"))
