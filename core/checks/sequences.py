"""What captures say they show: the code against the projector's lines."""

from __future__ import annotations

from collections.abc import Sequence

from core.checks.concern import Concern
from core.model import Capture, DeviceSpec
from core.patterns import Code


def code_concerns(captures: Sequence[Capture], projector: DeviceSpec) -> list[Concern]:
    """Compare the numbers that the codes can tell with the lines that project.json gives the projector."""
    short: dict[tuple[str, int, int], list[str]] = {}
    for capture in captures:
        for axis, lines in (("x", projector.width), ("y", projector.height)):
            codes = [f.pattern for f in capture.frames if isinstance(f.pattern, Code) and f.pattern.axis == axis]
            if not codes:
                continue
            told = max(code.cell << code.bits for code in codes)
            # one code may serve both axes
            if told < lines or told >= 2 * max(projector.width, projector.height) + 2 * codes[0].cell:
                short.setdefault((axis, told, lines), []).append(capture.name)
    concerns = []
    for (axis, told, lines), names in short.items():
        word = "width" if axis == "x" else "height"
        shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        if told < lines:
            text = f"the code along {axis} tells {told} lines apart, the projector's {word} is {lines} ({shown})"
        else:
            text = f"the code along {axis} has room for {told} lines, the projector's {word} is only {lines} ({shown})"
        text += f": correct {word} in project.json or the bits and cell of the patterns"
        concerns.append(Concern("doubtful", text))
    return concerns
