"""Whether an order that was found from the images is the only one that they allow.

Another order shows the same images on other lines. Where every line is seen beside its neighbours, these can only be
moved along or mirrored: lines k + c or c - k. So all other orders are known, and the patterns tell whether one of them
shows the same set of images on the lines that were seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.model import PhaseMap
from core.numerics import median_of, quantile_of
from core.patterns import Axis, Code, Pattern, Phase, axis_of, brightness

NEAR, STEP = 2.5, 0.1  # times the usual step from pixel to pixel: what is farther is no neighbour; what is none at all
LINKS, SHARE = 3, 0.2  # pairs of pixels that join two neighbouring lines at least, and of the usual number of them
ENDS = 0.01  # of the pixels, whose lines may be wrong
ALIKE = 0.05  # mean squared difference, white = 1, of images that blur and noise may not tell apart
MOST_LINES = 400  # that are compared
REMEDY = "order the files by name, or by a list that says what each shows"


def prove(patterns: Sequence[Pattern], phase: PhaseMap, lines: tuple[int, int], where: str) -> list[str]:
    """Refuse an order that may not be the only one; say how many pixels it decodes, and what was assumed.

    `phase` is what the frames decode to in that order, `lines` the projector's columns and rows.
    """
    mirrored = []
    axes: tuple[Axis, ...] = ("x", "y")
    for axis, along in zip(axes, ("columns", "rows"), strict=True):
        own = [p for p in patterns if axis_of(p) == axis]
        if not own:
            continue
        at = phase.u if axis == "x" else phase.v
        low, high, torn = linked(at, _finest(own))
        if torn is not None:
            seen = f"no order of the images is sure: in the likeliest, {along} about {torn:.0f} have no neighbours"
            raise InputError(where, seen, REMEDY)
        count = lines[axis == "y"]
        shifts, mirrors = others(own, count, max(0, ceil(low)), min(count - 1, int(high)))
        if shifts:
            seen = (
                f"no order of the images is sure: {along} {low:.0f} to {high:.0f} are seen, and another order shows "
                f"the same images {abs(shifts[0])} {along} farther"
            )
            raise InputError(where, seen, REMEDY)
        mirrored += [along] if mirrors else []
    maps = [each for each in (phase.u, phase.v) if np.isfinite(each).any()]
    told = [f"in this order {np.isfinite(maps).all(axis=0).mean():.1%} of the pixels decode"]
    if mirrored:
        told.append(
            f"another order shows {' and '.join(mirrored)} the other way round: the projector was taken to stand "
            "upright in the camera's image"
        )
    return told


def linked(at: NDArray[np.float32], finest: float) -> tuple[float, float, float | None]:
    """First and last line that are seen in a map (H, W) of lines, and where neighbouring lines are not neighbours."""
    lows, highs, usual = [], [], 0.0
    for a, b in ((at[:, :-1], at[:, 1:]), (at[:-1], at[1:])):
        both = np.isfinite(a) & np.isfinite(b)
        lows.append(np.minimum(a, b)[both])
        highs.append(np.maximum(a, b)[both])
        steps = highs[-1] - lows[-1]
        steps = steps[steps > STEP * finest]
        usual = max(usual, median_of(steps) if len(steps) else 0.0)  # across the lines, not along them
    low, high = np.concatenate(lows), np.concatenate(highs)
    if not len(low):
        return 0.0, 0.0, 0.0
    first, last = quantile_of(low, ENDS), quantile_of(high, 1 - ENDS)
    edges = np.arange(first + finest / 2, last - finest / 2, finest)
    if len(edges) < 2:
        return first, last, first
    close = high - low < max(NEAR * usual, 1.5 * finest)
    begin, end = (np.bincount(np.searchsorted(edges, each[close]), minlength=len(edges) + 1) for each in (low, high))
    links = np.cumsum(begin - end)[: len(edges)]
    weak = np.flatnonzero(links < max(LINKS, SHARE * median_of(links)))
    return first, last, float(edges[weak[0]]) if len(weak) else None


def others(patterns: Sequence[Pattern], count: int, low: int, high: int) -> tuple[list[int], list[int]]:
    """Lines by which other orders move the images of lines `low` to `high`, and the sums of lines that they exchange.

    `count` is the number of the projector's lines.
    """
    shown = np.array([brightness(p, np.arange(count)) for p in patterns], np.float64)
    seen = np.unique(np.linspace(low, high, min(high - low + 1, MOST_LINES)).astype(int))
    image = shown[:, seen]
    power = np.mean(image**2, axis=1)

    def same(lines: NDArray[np.int64]) -> bool:
        """Whether the same set of images is seen on other lines, and some of them under other patterns."""
        other = shown[:, lines]
        alike = power[:, None] + np.mean(other**2, axis=1) - 2 * image @ other.T / len(seen) < ALIKE
        return bool(alike.any(axis=0).all() and alike.any(axis=1).all() and not alike.diagonal().all())

    shifts = [c for c in range(-low, count - high) if c and same(seen + c)]
    mirrors = [c for c in range(high, count + low) if same(c - seen)]
    return shifts, mirrors


def _finest(patterns: Sequence[Pattern]) -> float:
    """The smallest step, in lines, that patterns tell apart in a pixel."""
    if any(isinstance(p, Phase) for p in patterns):
        return 1.0
    return float(min((p.cell for p in patterns if isinstance(p, Code)), default=1))
