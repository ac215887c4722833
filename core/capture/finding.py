"""What a check found, in words and figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Level = Literal["good", "warning", "bad"]


@dataclass(frozen=True)
class Finding:
    """One check's result.

    `level` good: nothing to do; warning: the capture is right but could be better; bad: frames do not show what they
    claim. `shots` are the numbers of the shots concerned, to be taken again where the level is bad.
    """

    check: str
    level: Level
    text: str
    figures: Mapping[str, float] = field(default_factory=dict)
    shots: tuple[int, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Give the finding as capture.json holds it."""
        return {"check": self.check, "level": self.level, "text": self.text, "figures": dict(self.figures)}
