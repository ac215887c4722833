"""Gray and plain binary code: one bit a frame."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from core.fields import Fields
from core.lazy import dataclass
from core.patterns.kinds.kind import LONGEST, Array, Axis, Kind, Numbers, read_axis


@dataclass(frozen=True)
class Code:
    """One bit of a Gray or plain binary code: line i carries number ``i // cell``; bit 0 is the most significant."""

    kind: Literal["gray", "binary"]
    axis: Axis
    bit: int
    bits: int
    cell: int = 1
    inverse: bool = False


def _reader(kind: Literal["gray", "binary"]) -> Any:
    def read(fields: Fields) -> Code:
        axis, bits = read_axis(fields), fields.integer("bits", 1, 62)
        bit, cell = fields.integer("bit", 0, bits - 1), fields.integer("cell", 1, default=1)
        return Code(kind, axis, bit, bits, cell, fields.flag("inverse"))

    return read


def _light(pattern: Code, i: Numbers) -> Array:
    k = i // pattern.cell
    number = k ^ (k >> 1) if pattern.kind == "gray" else k
    on = (number >> (pattern.bits - 1 - pattern.bit)) & 1
    return np.asarray(on ^ pattern.inverse, dtype=np.float64)


def _words(pattern: Code, along: str) -> str:
    return f"{'inverse ' * pattern.inverse}{pattern.kind} bit {pattern.bit} of {pattern.bits} across {along}"


def _write(pattern: Code) -> dict[str, Any]:
    return {key: value for key, value in asdict(pattern).items() if key != "kind"}


def _beyond(pattern: Code, lines: int) -> tuple[str, str] | None:
    if pattern.cell <= LONGEST * lines:
        return None
    return f"cell is {pattern.cell} lines, the projector has {lines}", "give the lines that share a number"


GRAY = Kind("code", _reader("gray"), _light, _words, cycle=lambda p: 4.0 * p.cell, beyond=_beyond, write=_write)
BINARY = Kind("code", _reader("binary"), _light, _words, cycle=lambda p: 4.0 * p.cell, beyond=_beyond, write=_write)
