"""White and black: the whole field on or off."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from core.lazy import dataclass
from core.patterns.kinds.kind import Kind


@dataclass(frozen=True)
class White:
    """Every line on."""

    kind: ClassVar[str] = "white"


@dataclass(frozen=True)
class Black:
    """Every line off."""

    kind: ClassVar[str] = "black"


WHITE = Kind("level", lambda fields: White(), lambda pattern, i: np.ones(i.shape), lambda pattern, along: "white")
BLACK = Kind("level", lambda fields: Black(), lambda pattern, i: np.zeros(i.shape), lambda pattern, along: "black")
