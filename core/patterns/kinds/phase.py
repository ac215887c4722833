"""Phase steps: a wave over the lines, sine or square."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from core.fields import Fields
from core.lazy import dataclass
from core.patterns.kinds.kind import LONGEST, Array, Axis, Kind, Numbers, read_axis

MOST_STEPS = 4096  # of one period: no capture has so many frames


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


def _read(fields: Fields) -> Phase:
    axis, steps = read_axis(fields), fields.integer("steps", 3, MOST_STEPS)
    step = fields.integer("step", 0, steps - 1)
    shift = fields.real("shift_rad", default=2 * np.pi * step / steps)
    profile = fields.text("profile", default="sine", among=("square", "sine"))
    return Phase(axis, fields.real("period", least=2.0), steps, step, shift, profile)


def _light(pattern: Phase, i: Numbers) -> Array:
    cosine = np.cos(2 * np.pi * (i + 0.5) / pattern.period - pattern.shift_rad)
    if pattern.profile == "sine":
        return np.asarray(0.5 + 0.5 * cosine)
    # the sign at an exact zero of the cosine must not hang on its last bit
    return np.asarray(cosine > 1e-12, dtype=np.float64)


def _words(pattern: Phase, along: str) -> str:
    return f"{pattern.profile} step {pattern.step} of {pattern.steps}, period {pattern.period:g} across {along}"


def _grey(pattern: Phase) -> str | None:
    return 'the pattern has profile "sine": use "square"' if pattern.profile == "sine" else None


def _beyond(pattern: Phase, lines: int) -> tuple[str, str] | None:
    if pattern.period <= LONGEST * lines:
        return None
    return f"period is {pattern.period:g} lines, the projector has {lines}", "give the lines of one cycle"


PHASE = Kind("phase", _read, _light, _words, _grey, lambda pattern: pattern.period, _beyond)
