"""What a check found, in words and figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Level = Literal["good", "warning", "bad"]


@dataclass(frozen=True)
class Finding:
    """One check's result.

    `level` good: nothing to do; warning: the capture is right but could be better; bad: frames do not show what they
    claim. `shots` are the numbers of the shots concerned, to be taken again where the level is bad. `picture` shows the
    matter over the image, NaN where there is nothing to show; `curve` is a list of points (x, y); `check` says of what.
    """

    check: str
    level: Level
    text: str
    figures: Mapping[str, float] = field(default_factory=dict)
    shots: tuple[int, ...] = ()
    picture: NDArray[np.float64] | None = field(default=None, compare=False, repr=False)
    curve: tuple[tuple[float, float], ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Give the finding as capture.json holds it."""
        return {"check": self.check, "level": self.level, "text": self.text, "figures": dict(self.figures)}
