"""A grey level over the whole field: what the projector's response is seen by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from core.fields import Fields
from core.patterns.kinds.kind import Array, Kind, Numbers


@dataclass(frozen=True)
class Level:
    """Every line at one level, 0 (black) to 1 (white)."""

    value: float
    kind: ClassVar[str] = "level"


def _read(fields: Fields) -> Level:
    value = fields.real("value")
    if not 0 <= value <= 1:
        raise fields.refuse("value", value, "give a level from 0 (black) to 1 (white)")
    return Level(value)


def _light(pattern: Level, i: Numbers) -> Array:
    return np.full(i.shape, pattern.value)


def _grey(pattern: Level) -> str | None:
    return None if pattern.value in (0, 1) else f"the pattern is a level of {pattern.value:g}: use white and black"


LEVEL = Kind("level", _read, _light, lambda pattern, along: f"a level of {pattern.value:g}", _grey)
