"""What captures say they show against what project.json says of the projector: its lines, and its response."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from core.errors import listed
from core.model import Array, Capture, Concern, DeviceSpec, Floats, TargetSet
from core.numerics import median_of
from core.patterns import Code

End = tuple[int, float] | None  # a line, and where in the image it lies

SECTIONS = 80  # rows and columns in which the end of the light is looked for
DARK_PX = 4  # beyond it
OFTEN = 0.3  # of the sections must end at the same line
BEYOND = 0.01  # of the pixels may lie there by mistake
SHORT, LEAST = 0.01, 6  # of the lines, and so many: sine fringes fade by blur and end 5 lines early
CURVED = 0.1  # of full light, by which a response is unlike another; captures tell theirs to a few hundredths
APART = 0.01  # of the image, that its end must have moved from one scene to the other


def light_end(lines: Floats) -> End:
    """Find the highest line of the light, where that is seen, and where in the image, over its size.

    A border at one line in many rows or columns, with nothing beyond, may also be that of an object along stripes.
    """
    found = []
    for values in (lines, lines[:, ::-1], lines.T, lines.T[:, ::-1]):
        some = values[:: max(1, len(values) // SECTIONS)]
        valid = np.isfinite(some)
        end = valid.copy()
        for k in range(1, DARK_PX + 1):
            end[:, :-k] &= ~valid[:, k:]
        end[:, : DARK_PX + 1] = end[:, -DARK_PX:] = False
        rows, columns = np.nonzero(end)
        rises = some[rows, columns] > some[rows, columns - DARK_PX]  # NaN does not
        at, columns = some[rows, columns][rises], columns[rises]
        if not len(at):
            continue
        count = np.bincount(np.maximum(at, 0).astype(int))
        line = int(np.argmax(np.convolve(count, [1, 1], "valid"))) if len(count) > 1 else 0
        own = (at >= line) & (at < line + 2)
        if own.sum() > OFTEN * len(some) and np.mean(some[valid] > line + 3) < BEYOND:
            found.append((int(own.sum()), line + 1, median_of(columns[own]) / some.shape[1]))
    return max(found)[1:] if found else None


def end_notes(ends: Mapping[str, Sequence[End]], projector: DeviceSpec, name: str = "projector") -> dict[str, str]:
    """Say of captures whose light ends early, at one line in different scenes, that project.json has more lines.

    Parameters
    ----------
    ends : mapping
        By capture, `light_end` of u and of v, as one camera saw them.
    name : str
        The projector's in project.json.
    """
    notes: dict[str, str] = {}
    for axis, word, lines in ((0, "width", projector.width), (1, "height", projector.height)):
        known = [(capture, end) for capture, both in ends.items() if (end := both[axis]) is not None]
        for (a, (line, at)), (b, (other, place)) in combinations(known, 2):
            if (
                abs(line - other) < 2
                and abs(at - place) > APART
                and max(line, other) < lines - 1 - max(LEAST, SHORT * lines)
            ):
                text = (
                    f"the projector's light ends at line {line} along {'xy'[axis]}, {word} is {lines}: correct {word} "
                    f"of {name} in project.json, unless something cuts its light off"
                )
                notes |= {a: text, b: text}
    return notes


def code_concerns(captures: Sequence[Capture], projectors: Mapping[str, DeviceSpec]) -> list[Concern]:
    """Compare the numbers that the codes can tell with the lines that project.json gives their projector."""
    short: dict[tuple[str, int, int], dict[str, None]] = {}
    for series in (series for capture in captures for series in capture.series if series.projector in projectors):
        projector = projectors[series.projector]
        name = series.name if len(projectors) == 1 else f"{series.name} by {series.projector}"
        for axis, lines in (("x", projector.width), ("y", projector.height)):
            codes = [f.pattern for f in series.frames if isinstance(f.pattern, Code) and f.pattern.axis == axis]
            if not codes:
                continue
            told = max(code.cell << code.bits for code in codes)
            # one code may serve both axes
            if told < lines or told >= 2 * max(projector.width, projector.height) + 2 * codes[0].cell:
                short.setdefault((axis, told, lines), {})[name] = None
    concerns = []
    for (axis, told, lines), names in ((key, list(named)) for key, named in short.items()):
        word = "width" if axis == "x" else "height"
        shown = listed(names, 3)
        if told < lines:
            text = f"the code along {axis} tells {told} lines apart, the projector's {word} is {lines} ({shown})"
        else:
            text = f"the code along {axis} has room for {told} lines, the projector's {word} is only {lines} ({shown})"
        text += f": correct {word} in project.json or the bits and cell of the patterns"
        concerns.append(Concern("doubtful", text))
    return concerns


def response_concerns(sets: Sequence[TargetSet], projectors: Mapping[str, DeviceSpec]) -> list[Concern]:
    """Find projectors whose `response` has its columns exchanged, by the curve that captures of sine fringes show.

    That may be straight, where the levels were chosen by the response, or bent twice.
    """
    concerns = []
    at = np.linspace(0.1, 0.9, 9)
    for name, spec in projectors.items():
        seen = [_curve(t.response, at) for t in sets if t.projector == name and t.response is not None]
        given = np.array(spec.response).reshape(-1, 2)
        if not seen or len(given) < 3 or (np.diff(given, axis=0) <= 0).any():
            continue
        found, said, turned = np.median(seen, axis=0), _curve(given, at), _curve(given[:, ::-1], at)
        curves = said, at, turned, _curve(given[:, ::-1], turned)
        as_said, straight, *as_turned = (float(np.abs(found - curve).max()) for curve in curves)
        if min(as_turned) < 0.5 * min(as_said, straight) and as_said > CURVED:
            text = (
                f"{name}: by its response in project.json, level 0.5 gives {said[4]:.2f} of the light, by the captures "
                f"{found[4]:.2f}: are its columns exchanged? Give [level, light]"
            )
            concerns.append(Concern("doubtful", text))
    return concerns


def _curve(pairs: Array, at: Array) -> Array:
    """Light at levels, from pairs (k, 2), both as shares of their range."""
    level, light = ((column - column[0]) / (column[-1] - column[0]) for column in pairs.T)
    return np.interp(at, level, light)
