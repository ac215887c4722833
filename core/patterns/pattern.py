"""The kinds of pattern, and how bright each makes every projector line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError

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
    if not isinstance(data, Mapping):
        raise InputError(where, f"pattern is {data!r}", "give an object with a kind")
    fields = _Fields(data, where)
    kind = data.get("kind")
    match kind:
        case "white":
            return White()
        case "black":
            return Black()
        case "gray" | "binary":
            bits = fields.integer("bits", 1, 62)
            inverse = bool(data.get("inverse", False))
            bit, cell = fields.integer("bit", 0, bits - 1), fields.integer("cell", 1, default=1)
            return Code(kind, fields.axis(), bit, bits, cell, inverse)
        case "phase":
            steps = fields.integer("steps", 3)
            step = fields.integer("step", 0, steps - 1)
            profile = data.get("profile", "sine")
            if profile not in ("square", "sine"):
                raise InputError(where, f"profile is {profile!r}", 'use "square" or "sine"')
            shift = fields.real("shift_rad", default=2 * np.pi * step / steps)
            return Phase(fields.axis(), fields.real("period", above=0.0), steps, step, shift, profile)
        case "line":
            return Line(fields.axis(), fields.integer("index", 0), fields.integer("width", 1, default=1))
    raise InputError(where, f"pattern kind is {kind!r}", "use white, black, gray, binary, phase or line")


@dataclass(frozen=True)
class _Fields:
    """The checked reading of a pattern's fields."""

    data: Mapping[str, Any]
    where: str

    def axis(self) -> Axis:
        match self.data.get("axis"):
            case "x":
                return "x"
            case "y":
                return "y"
        raise InputError(self.where, f"axis is {self.data.get('axis')!r}", 'use "x" (columns) or "y" (rows)')

    def integer(self, key: str, least: int, most: int | None = None, default: int | None = None) -> int:
        value = self.data.get(key, default)
        whole = isinstance(value, int | float) and not isinstance(value, bool) and value == int(value or 0)
        if not whole or value < least or (most is not None and value > most):
            span = f"from {least} on" if most is None else f"from {least} to {most}"
            raise InputError(self.where, f"{key} is {value!r}", f"give a whole number {span}")
        return int(value)

    def real(self, key: str, above: float = -np.inf, default: float | None = None) -> float:
        value = self.data.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not above < value < np.inf:
            raise InputError(self.where, f"{key} is {value!r}", f"give a finite number above {above:g}")
        return float(value)
