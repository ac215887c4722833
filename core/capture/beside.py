"""Phase steps that begin wrongly by less than a cell: the phase stands beside the edges of the code, alike all over.

Nothing contradicts itself then, and every coordinate is off by as much. A response of the light moves rising and
falling edges apart, by the same to either side.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.capture.contradictions import Looked, Wave
from core.model import Array
from core.numerics import erf
from core.patterns import Code, Phase, brightness

BLURS_LINES = 0.2, 0.4, 0.8, 1.4
REACH, STEP = 1.5, 0.05  # lines to either side that are tried
LONGER = 1.9  # cells that a period must be
LEAST = 15  # pixels at rising, and at falling edges
FILLED, CROWDED = 0.4, 0.4  # of their even share that each line of a cell has; mean of the places within a line
BESIDE = 0.25  # lines; edges of sound captures of three rigs lie within 0.05, half a line is the usual mistake
PLACES = np.linspace(-6, 6, 601)  # blurs
PASSED = (1 + erf(PLACES / np.sqrt(2))) / 2
ALIKE = 0.15  # lines by which the halves of the field may differ


def beside_code(looked: Looked, waves: Sequence[Wave]) -> str:
    """Say by how much the phase of a period stands beside the code, where that is the same all over."""
    codes = [(p, seen) for p, seen in zip(looked.patterns, looked.values, strict=True) if isinstance(p, Code)]
    if not codes:
        return ""
    cell = min(p.cell for p, _ in codes)
    shown = np.array([brightness(p, np.arange(looked.lines)) for p, _ in codes])
    values = np.array([seen for _, seen in codes], np.float64)
    stepped = {p.period for p in looked.patterns if isinstance(p, Phase) and p.profile != "sine"}  # phases crowd
    for wave in waves:
        # of a shorter period a phase near an edge may be the next one's
        if wave.off is None or wave.period in stepped or wave.period < LONGER * cell:
            continue
        line = wave.line + wave.off * wave.period / (2 * np.pi)
        edge = np.round(line / cell).astype(int) * cell
        use = wave.strong & ~wave.none & (edge > 0) & (edge < looked.lines)
        if np.count_nonzero(use) < 4 * LEAST:
            continue
        line, edge, seen = line[use], edge[use], values[:, use]
        halves = line < np.median(line), line >= np.median(line)
        if not all(_spread(line[half], cell) for half in halves):
            continue
        off = np.array([[_off(way, line, edge, seen, shown, half) for way in (1, -1)] for half in halves]).mean(axis=1)
        middle = np.array([line[half].mean() for half in halves])
        along, most = "columns" if looked.axis == "x" else "rows", min(REACH - ALIKE, cell / 2)
        text = f"frames across {along}: the phase of period {wave.period:g} stands "
        beside, slope = float(off.mean()), float(np.diff(off)[0] / max(np.diff(middle)[0], 1.0))
        turned, drifting = abs(off[1] - off[0]), abs(off[0] - slope * middle[0])  # left by this, and by another period
        if turned < min(ALIKE, drifting) and BESIDE < abs(beside) < most:
            way = "before" if beside < 0 else "behind"
            turn = f"{abs(beside) * 360 / wave.period:.3g}° {'later' if beside < 0 else 'earlier'}"
            return (
                f"{text}{abs(beside):.2f} lines {way} the edges of the code, all over: they fit if the phase steps "
                f"begin {turn}: shift_rad"
            )
    return ""


def _spread(line: Array, cell: int) -> bool:
    """Whether pixels see all places of a cell; where they beat with the lines it is a few, and edges are not seen."""
    of_line = np.bincount(np.floor(line % cell).astype(int) % cell, minlength=cell)
    crowding = abs(np.exp(2j * np.pi * line).mean())
    return bool(of_line.min() * cell > FILLED * len(line) and crowding < CROWDED)


def _edge(away: Array) -> Array:
    """What a blurred edge of unit step passes, by the distance from it in blurs; looked up, as its pixels are many."""
    return np.interp(away, PLACES, PASSED)


def _off(way: int, line: Array, edge: NDArray[np.intp], seen: Array, shown: Array, half: NDArray[np.bool_]) -> float:
    """Where rising (1) or falling (-1) edges lie by the phase, lines from where the code has them; NaN if unknown."""
    code, pixel = np.nonzero((way * (shown[:, edge] - shown[:, edge - 1]) > 0.9) & half)
    if len(code) < LEAST:
        return float("nan")
    value = seen[code, pixel] if way > 0 else 1 - seen[code, pixel]
    away = (line - edge)[pixel]
    tried = np.arange(-REACH, REACH + STEP / 2, STEP)
    cost = [np.abs(_edge((away - tried[:, None]) / blur) - value).mean(axis=1) for blur in BLURS_LINES]
    return float(tried[np.unravel_index(np.argmin(cost), np.shape(cost))[1]])
