"""Frames that were exchanged, told by the coordinates decoded of them, on objects of any form.

From one cell of a Gray code to the next one bit changes. If it stands for another, the coordinate jumps to a far cell
whose word differs by one bit, all along that line; steps of depth join any words. Steps of square waves may be
exchanged so that every cell keeps its word: then the coordinate runs backwards in each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.compiling import njit
from core.model.finding import Finding
from core.numerics import median_of
from core.patterns import Axis, Code, Pattern, Phase

Map = NDArray[np.floating]

ROWS = 300  # of a map that are looked at, at most
THIN = 5  # one pixel of so many tells a median
APART = 2  # px between the pixels that are compared: the one on the edge may be invalid
LEAST = 12  # transitions by which a cell is judged
FEWEST = 8  # cells that tell something
ODD, ODD_CELLS = 0.03, 3  # of the cells may be left by jumps; bits that hardly matter make 0.06, sound captures none
# cells, least, meant and most, by which the coordinate rises where its way in a cell is looked at
STEADY = 1.5, 2.5, 4.0
SURE_LINES = 0.15  # a smaller step in a cell is noise
LEAST_REACH = 3  # pixels over which a coordinate rises
PAIRS, BACKWARDS = 200, 0.5  # pixels; of them. Sound maps have below 0.01, exchanged steps 0.9


class Coded(NamedTuple):
    """A decoded axis with a code: what it counts, lines of a cell, whether there are steps, and what is looked at.

    `ways` are some rows of its map, and some columns as rows, and the code's cells they lie in. Of the `judged` cells
    of a Gray code `odd` ones are left by jumps to a word of one other bit more often than not.
    """

    along: str
    cell: int
    stepped: bool
    ways: list[tuple[Map, Map]]
    odd: int
    judged: int


def coded_axes(patterns: Sequence[Pattern], maps: Sequence[tuple[Axis, Map, str]]) -> list[Coded]:
    """Look at the axes that have one code; `maps` are decoded coordinates (H, W) and what they count."""
    found = []
    for axis, values, along in maps:
        codes = [p for p in patterns if isinstance(p, Code) and p.axis == axis]
        if len({(p.cell, p.kind) for p in codes}) != 1:
            continue
        cell, stepped = codes[0].cell, any(isinstance(p, Phase) and p.axis == axis for p in patterns)
        ways = _both_ways(values, cell)
        odd = _odd_cells(ways, cell) if codes[0].kind == "gray" else (0, 0)
        found.append(Coded(along, cell, stepped, ways, *odd))
    return found


def exchanged_frames(coded: Sequence[Coded]) -> list[Finding]:
    """Find frames that stand for each other."""
    found = []
    for each in coded:
        share = each.odd / max(each.judged, 1)
        if each.odd >= ODD_CELLS and each.judged >= FEWEST and share > ODD:
            text = f"{each.along} jump to and fro at {share:.0%} of the code's cells: two of its frames were exchanged"
            found.append(Finding("order", "bad", text, {"odd": share}, names="mistake"))
        elif each.stepped and (share := _backwards(each.ways, each.cell)) > BACKWARDS:
            text = f"{each.along} run backwards in {share:.0%} of the code's cells: two phase steps were exchanged"
            found.append(Finding("order", "bad", text, {"backwards": share}, names="mistake"))
    return found


def _both_ways(values: Map, cell: int) -> list[tuple[Map, Map]]:
    """Some rows of a map, and some columns as rows, and the code's cells they lie in."""
    ways = [np.ascontiguousarray(some[:: -(-len(some) // ROWS)]) for some in (values, values.T)]
    return [(some, np.floor((some + 0.5) / cell)) for some in ways]  # a tenth of the time of some // cell


def _usual(image: Map, apart: int) -> float:
    """The median size of some steps between pixels that are so far apart in a row; 0 without any."""
    some = np.abs(image[:, apart::THIN] - image[:, :-apart:THIN])
    some = some[np.isfinite(some)]
    return median_of(some) if len(some) else 0.0


def _odd_cells(ways: Sequence[tuple[Map, Map]], cell: int) -> tuple[int, int]:
    """How many cells are left by jumps to a word of one other bit more often than not, of how many."""
    jumps = np.zeros(0, np.int64)
    for image, those in ways:
        away = image[:, APART:] - image[:, :-APART]
        far = np.abs(away) > cell + 4 * _usual(image, APART)  # which NaN is not
        first, second = (np.maximum(each[far], 0).astype(np.int64) for each in (those[:, :-APART], those[:, APART:]))
        word = (first ^ first >> 1) ^ (second ^ second >> 1)
        jumps = np.append(jumps, first[word & (word - 1) == 0])
    left_by = np.bincount(jumps, minlength=1)
    if left_by.max() <= LEAST / 2:
        return 0, 0  # as of sound captures, without a look at all pixels
    pairs = [(those[:, :-APART], those[:, APART:]) for _, those in ways]
    left = np.concatenate([a[(a != b) & np.isfinite(a) & np.isfinite(b)] for a, b in pairs])
    count = np.bincount(np.maximum(left, 0).astype(np.int64))
    judged = count >= LEAST
    odd = judged & (np.pad(left_by, (0, len(count) - len(left_by))) > 0.5 * count)
    return int(np.count_nonzero(odd)), int(np.count_nonzero(judged))


def _backwards(ways: Sequence[tuple[Map, Map]], cell: int) -> float:
    """Share of neighbours in a cell between which the coordinate falls where it rises over some cells, or reverse."""
    against, count = 0, 0
    for image, those in ways:
        usual = _usual(image, 1)
        if usual > 0 and image.shape[1] >= 3 * LEAST_REACH:
            reach = int(np.clip(round(STEADY[1] * cell / usual), LEAST_REACH, image.shape[1] // 3))
            some = _steps(image, those, reach, STEADY[0] * cell, STEADY[2] * cell, SURE_LINES)
            against, count = against + some[0], count + some[1]
    return against / count if against > BACKWARDS * PAIRS and count >= PAIRS else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _steps(
    image: Map, those: Map, reach: int, least: float, most: float, sure: float
) -> tuple[int, int]:  # pragma: no cover  compiled
    """Steps in a cell that are `sure` where the coordinate rises by `least` to `most` within `reach` pixels: those
    against that, and all."""
    against, count = 0, 0
    for row in range(image.shape[0]):
        for at in range(image.shape[1] - reach):
            step, rise = image[row, at + 1] - image[row, at], image[row, at + reach] - image[row, at]
            if least < abs(rise) < most and abs(step) > sure and those[row, at] == those[row, at + 1]:
                against += step * rise < 0
                count += 1
    return against, count
