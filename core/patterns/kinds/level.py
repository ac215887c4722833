"""A grey level over the whole field: what the projector's response is seen by."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from core.fields import Fields
from core.lazy import dataclass
from core.patterns.kinds.kind import Kind


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


LEVEL = Kind(
    "level",
    _read,
    lambda pattern, i: np.full(i.shape, pattern.value),
    lambda p, _: f"a level of {p.value:g}",
    lambda p: None if p.value in (0, 1) else f"the pattern is a level of {p.value:g}: use white and black",
)
