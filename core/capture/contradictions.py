"""Pixels that no projector line explains: what the frames of one axis show, against what their patterns allow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.capture.lookup import dictionary, nearest
from core.numerics import distinct, quantile_of
from core.patterns import Axis, Code, Pattern, Phase, axis_of

Array = NDArray[np.float32]

PIXELS = 600  # of the brightest, looked up
CONTRADICTION = 0.3  # squared distance, white = 1, after the response is taken out; a wrong frame costs 0.5 and more
PER_FRAME = 0.03
FAINT = 0.04  # amplitude of a wave, white = 1, from which it is judged
NO_WAVE = 0.7  # what steps leave of a wave over its amplitude; square waves of few steps leave 0.4
MOST_CELL = 2.0  # rad that half a cell may be of a period, for a phase that runs away to be seen at its ends
LEAST_WAVE = 100  # pixels that tell it
STEADY, RISES = 7.0, 5.5  # sigmas of how fast it does, from line 0 on and within what is seen
GONE = 0.05  # of the pixels at the far end must have left the cell: where lines and pixels beat, phases drift within it
WAVE_SLACK = 0.5  # rad that a phase may lie outside of its code's cell, for blur at the cells' edges


@dataclass(frozen=True)
class Looked:
    """The frames of one axis at the brightest pixels: normalised values (k, n), and what the patterns make possible.

    `inverted` has the values that the same frames would have with bright and dark exchanged.
    """

    shots: tuple[int, ...]
    patterns: tuple[Pattern, ...]
    values: Array
    inverted: Array
    limit: float | Array
    axis: Axis
    lines: int
    across: int  # of the other axis

    @classmethod
    def of(
        cls, shots: tuple[int, ...], patterns: Sequence[Pattern], values: Array, inverted: Array, lines: tuple[int, int]
    ) -> Looked:
        """Frames of one axis; `values` and `inverted` of these (k, n), the projector's columns and rows."""
        axis = axis_of(patterns[0]) or "x"
        limit = max(CONTRADICTION, PER_FRAME * len(shots))
        return cls(shots, tuple(patterns), values, inverted, limit, axis, lines[axis == "y"], lines[axis == "x"])


def contradicting(values: Array, patterns: Sequence[Pattern], looked: Looked, few: int = PIXELS) -> float:
    """Share of pixels that no projector line explains, once the curve of grey values is taken out."""
    some = np.linspace(0, values.shape[1] - 1, min(few, values.shape[1])).astype(int)
    return float(np.mean(unexplained(values[:, some], patterns, looked, 2 if few == PIXELS else 0)[0]))


def unexplained(
    seen: Array, patterns: Sequence[Pattern], looked: Looked, rounds: int = 2
) -> tuple[NDArray[np.bool_], Array]:
    """Which pixels no projector line explains, (n,), and their values with the curve of grey values taken out."""
    possible, _ = looks(tuple(patterns), looked.lines)
    cost, best = nearest(seen, possible)
    straight = seen
    for _ in range(rounds):
        if float(np.mean(cost > looked.limit)) <= 0.02:
            break
        levels, curve = _response(seen, possible[:, best])
        straight = np.interp(seen, curve, levels).astype(np.float32)
        bent_cost, best = nearest(seen, np.interp(possible, levels, curve).astype(np.float32))
        cost = np.minimum(cost, bent_cost)
    return (cost > looked.limit) | _waves_disagree(seen, patterns, looked), straight


@lru_cache(maxsize=96)
def looks(patterns: tuple[Pattern, ...], lines: int) -> tuple[Array, Array]:
    """Give `dictionary` of patterns, remembered: all captures of a project have the same ones."""
    return dictionary(list(patterns), lines)


@lru_cache(maxsize=96)
def _words(patterns: tuple[Pattern, ...], axis: Axis, lines: int) -> int:
    """How many lines or cells the code frames among patterns tell apart."""
    bright = looks(patterns, lines)[0][[isinstance(p, Code) for p in patterns]] > 0.5
    return len(distinct(2.0 ** np.arange(len(bright)) @ bright))


@dataclass(frozen=True)
class Wave:
    """The steps of one period: where they have contrast, whether they make no wave, how far its phase is off the code.

    `off` (n,) is in rad, from the middle of the code's cell; None where no code tells. `most` is half a cell.
    """

    period: float
    strong: NDArray[np.bool_]
    none: NDArray[np.bool_]
    off: NDArray[np.float64] | None
    most: float
    line: NDArray[np.float64]


def waves_of(seen: Array, patterns: Sequence[Pattern], looked: Looked) -> Iterator[Wave]:
    """Give the steps of each period that has three and more, at pixels of values (k, n)."""
    coded = [k for k, p in enumerate(patterns) if isinstance(p, Code)]
    number, cell = np.zeros(seen.shape[1]), 0
    if coded:
        possible, at = looks(tuple(patterns), looked.lines)
        cell = min(p.cell for p in patterns if isinstance(p, Code))
        if _words(tuple(patterns), looked.axis, looked.lines) * cell < looked.lines:
            cell = 0  # a frame was left out for a trial: the others do not tell all cells apart
        number = np.floor((at[nearest(seen[coded], possible[coded])[1]] + 0.25) / max(cell, 1))
    for period in {p.period for p in patterns if isinstance(p, Phase)}:
        steps = [k for k, p in enumerate(patterns) if isinstance(p, Phase) and p.period == period]
        shifts = np.array([p.shift_rad for p in patterns if isinstance(p, Phase) and p.period == period])
        if len(distinct(np.round(np.exp(1j * shifts), 6))) < 3:
            continue
        A = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
        found, *_ = np.linalg.lstsq(A, seen[steps].astype(np.float64), rcond=None)
        amplitude = np.hypot(found[1], found[2])
        rest = np.sqrt(np.mean((seen[steps] - A @ found) ** 2, axis=0))
        line = (number + 0.5) * cell
        phase = np.arctan2(found[2], found[1]) - 2 * np.pi * line / period
        off = np.angle(np.exp(1j * phase)) if cell else None
        strong = (amplitude > FAINT) | (rest > FAINT)
        yield Wave(period, strong, strong & (rest > NO_WAVE * amplitude), off, np.pi * cell / period, line)


def _waves_disagree(seen: Array, patterns: Sequence[Pattern], looked: Looked) -> NDArray[np.bool_]:
    """Where phase steps make no wave, or a phase that the code's cell does not have (fine waves are faint)."""
    bad = np.zeros(seen.shape[1], bool)
    for wave in waves_of(seen, patterns, looked):
        bad |= wave.none
        allowed = wave.most + WAVE_SLACK
        if wave.off is not None and allowed < 0.85 * np.pi:
            bad |= wave.strong & (np.abs(wave.off) > allowed)
    return bad


def runs_away(looked: Looked, waves: Sequence[Wave]) -> str:
    """Say that a phase runs away from the code over the field, and leaves its cells: its period is another."""
    for wave in waves:
        use = wave.strong & ~wave.none
        if wave.off is None or wave.most > MOST_CELL or np.count_nonzero(use) < LEAST_WAVE:
            continue
        off, line = wave.off[use], wave.line[use]
        away = line - line.mean()
        # phases are spread evenly in their cells, wherever these are; a wrong beginning alone is the same everywhere
        slope, rise = (line @ off) / (line @ line), (away @ off) / (away @ away)
        sigma, rise_sigma = (wave.most / np.sqrt(3 * (x @ x)) for x in (line, away))
        far = np.sign(slope) * off[line > quantile_of(line, 2 / 3)]
        gone = np.mean(far > wave.most + WAVE_SLACK)
        if abs(slope) > STEADY * sigma and rise * np.sign(slope) > RISES * rise_sigma and gone > GONE:
            drift = abs(slope) * np.ptp(line) * wave.period / (2 * np.pi)
            period = 1 / (1 / wave.period + slope / (2 * np.pi))
            along = "columns" if looked.axis == "x" else "rows"
            return (
                f"frames across {along}: the phase runs away from the code, by {drift:.1f} lines over the field: "
                f"they fit with a period of {period:.4g} lines, not {wave.period:g}"
            )
    return ""


def _response(seen: Array, expected: Array) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the rising curve by which grey values follow from what is expected: levels, and values there."""
    edges = np.linspace(0, 1, 13)
    bins = np.clip(np.digitize(expected, edges) - 1, 0, 11)
    middle = np.array([float(np.median(seen[bins == b])) if np.any(bins == b) else np.nan for b in range(12)])
    known = np.isfinite(middle)
    if known.sum() < 3:
        return edges, edges
    return ((edges[1:] + edges[:-1]) / 2)[known], np.maximum.accumulate(middle[known])
