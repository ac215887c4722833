"""The kinds of pattern, a file each. A new kind is a frozen dataclass, its `Kind`, and its name in `KINDS`."""

from __future__ import annotations

from core.patterns.kinds.code import BINARY, GRAY, Code
from core.patterns.kinds.kind import Array, Axis, Kind, Pattern, Use
from core.patterns.kinds.level import LEVEL, Level
from core.patterns.kinds.line import LINE, Line
from core.patterns.kinds.lines import LINES, Lines
from core.patterns.kinds.phase import PHASE, Phase
from core.patterns.kinds.plain import BLACK, WHITE, Black, White

KINDS: dict[str, Kind] = {
    "white": WHITE,
    "black": BLACK,
    "level": LEVEL,
    "gray": GRAY,
    "binary": BINARY,
    "phase": PHASE,
    "line": LINE,
    "lines": LINES,
}

__all__ = [
    "KINDS", "Array", "Axis", "Black", "Code", "Kind", "Level", "Line", "Lines", "Pattern", "Phase", "Use", "White",
]  # fmt: skip
