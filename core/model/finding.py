"""What a check found, in words and figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model.note import Names

Level = Literal["good", "warning", "bad"]
LEVELS: dict[Level, str] = {"bad": "wrong", "warning": "could be better", "good": "good"}  # the worst first
TITLES = {
    "identity": "patterns",
    "modulation": "stripes",
    "exposure": "exposure",
    "saturation": "saturation",
    "lamp": "lamp",
    "movement": "movement",
    "settle": "settle time",
    "linearity": "linearity",
    "focus": "focus",
    "order": "order",
    "orientation": "orientation",
    "visibility": "working depth",
}
PICTURES = {
    "exposure": "white, share of the range",
    "linearity": "half light, seen as",
    "focus": "modulation of the finest stripes",
    "order": "contradiction, white = 1",
    "orientation": "projector column",
}
AXES = {
    "settle": ("delay after the acknowledgement [ms]", "light, white = 1"),
    "linearity": ("light meant", "light seen"),
    "visibility": ("position of the plate [mm]", "modulation [grey values]"),
}


@dataclass(frozen=True)
class Finding:
    """One check's result.

    `level` good: nothing to do; warning: the capture is right but could be better; bad: frames do not show what they
    claim. `shots` are the numbers of the shots concerned, to be taken again where the level is bad. `picture` shows the
    matter over the image, NaN where there is nothing to show; `curve` is a list of points (x, y); `check` says of what.
    `names` is what the text names, see `Note`. In words: `title`, `level_words`, what the picture shows, and the
    curve's `axes`.
    """

    check: str
    level: Level
    text: str
    figures: Mapping[str, float] = field(default_factory=dict)
    shots: tuple[int, ...] = ()
    picture: NDArray[np.float64] | None = field(default=None, compare=False, repr=False)
    curve: tuple[tuple[float, float], ...] = ()
    names: Names = "capture"

    @property
    def title(self) -> str:
        """What was checked."""
        return TITLES.get(self.check, self.check)

    @property
    def level_words(self) -> str:
        """The level in words."""
        return LEVELS[self.level]

    @property
    def picture_label(self) -> str:
        """What the picture's values are."""
        return PICTURES.get(self.check, "")

    @property
    def axes(self) -> tuple[str, str]:
        """Names of the curve's axes, units included."""
        return AXES.get(self.check, ("", ""))

    def as_dict(self) -> dict[str, Any]:
        """Give the finding as capture.json holds it."""
        return {"check": self.check, "level": self.level, "text": self.text, "figures": dict(self.figures)}
