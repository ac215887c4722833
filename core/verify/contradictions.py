"""Pixels that no projector line explains: what the frames of one axis show, against what their patterns allow."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.numerics import distinct, spaced
from core.patterns import Axis, Code, Pattern, Phase, axis_of
from core.verify.lookup import dictionary, nearest_within

Array = NDArray[np.float32]

PIXELS = 600  # of the brightest, looked up
CONTRADICTION = 0.3  # squared distance, white = 1, after the response is taken out; a wrong frame costs 0.5 and more
PER_FRAME = 0.03
FAINT = 0.04  # amplitude of a wave, white = 1, from which it is judged
NO_WAVE = 0.7  # what steps leave of a wave over its amplitude; square waves of few steps leave 0.4
FEW_PIXELS = 0.02  # share of them that may be anything
SOFT, LEFT = (4.0, 6.0, 9.0, 13.0, 18.0), 0.75  # lines of blur; part of a cell
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
    at: NDArray[np.intp]  # rows and columns of the pixels in the image, (2, n)

    @classmethod
    def of(
        cls,
        shots: tuple[int, ...],
        patterns: Sequence[Pattern],
        values: Array,
        inverted: Array,
        lines: tuple[int, int],
        at: NDArray[np.intp],
    ) -> Looked:
        """Frames of one axis; `values` and `inverted` of these (k, n), the projector's lines, pixels (2, n)."""
        axis = axis_of(patterns[0]) or "x"
        limit = max(CONTRADICTION, PER_FRAME * len(shots))
        return cls(shots, tuple(patterns), values, inverted, limit, axis, lines[axis == "y"], lines[axis == "x"], at)


def contradicting(values: Array, patterns: Sequence[Pattern], looked: Looked, few: int = PIXELS) -> float:
    """Share of pixels that no projector line explains, once the curve of grey values is taken out."""
    some = spaced(values.shape[1], few)
    return float(np.mean(unexplained(values[:, some], patterns, looked, 2 if few == PIXELS else 0)[0]))


def unexplained(
    seen: Array, patterns: Sequence[Pattern], looked: Looked, rounds: int = 2
) -> tuple[NDArray[np.bool_], Array]:
    """Which pixels no projector line explains, (n,), and their values with the curve of grey values taken out."""
    possible, _ = looks(tuple(patterns), looked.lines)
    cost, best = nearest_within(seen, possible, looked.limit)
    soft = _softer(tuple(patterns), looked.lines) if float(np.mean(cost > looked.limit)) > FEW_PIXELS else None
    if soft is not None:
        possible = soft
        soft_cost, best = nearest_within(seen, possible, looked.limit)
        cost = np.minimum(cost, soft_cost)
    straight = seen
    for _ in range(rounds):
        if float(np.mean(cost > looked.limit)) <= FEW_PIXELS:
            break
        levels, curve = _response(seen, possible[:, best])
        straight = np.interp(seen, curve, levels).astype(np.float32)
        bent = np.interp(possible, levels, curve).astype(np.float32)
        bent_cost, best = nearest_within(seen, bent, looked.limit)
        cost = np.minimum(cost, bent_cost)
    return (cost > looked.limit) | _waves_disagree(seen, patterns, looked), straight


@lru_cache(maxsize=96)
def looks(patterns: tuple[Pattern, ...], lines: int) -> tuple[Array, Array]:
    """Give `dictionary` of patterns, remembered: all captures of a project have the same ones."""
    return dictionary(list(patterns), lines)


@lru_cache(maxsize=8)
def _softer(patterns: tuple[Pattern, ...], lines: int) -> Array | None:
    """Give `dictionary` of blurs beyond the usual that leave something of a code's finest bits; None without any."""
    finest = min((p.cell for p in patterns if isinstance(p, Code)), default=0)
    blurs = tuple(blur for blur in SOFT if blur <= LEFT * finest)
    return dictionary(list(patterns), lines, blurs)[0] if blurs else None


@lru_cache(maxsize=96)
def _words(patterns: tuple[Pattern, ...], lines: int) -> int:
    """How many lines or cells the code frames among patterns tell apart."""
    bright = looks(patterns, lines)[0][[isinstance(p, Code) for p in patterns]] > 0.5
    return len(distinct(2.0 ** np.arange(len(bright)) @ bright))


def _waves_disagree(seen: Array, patterns: Sequence[Pattern], looked: Looked) -> NDArray[np.bool_]:
    """Where phase steps make no wave, or a phase that the code's cell does not have (fine waves are faint)."""
    bad = np.zeros(seen.shape[1], bool)
    coded = [k for k, p in enumerate(patterns) if isinstance(p, Code)]
    number, cell = np.zeros(seen.shape[1]), 0
    if coded:
        possible, at = looks(tuple(patterns), looked.lines)
        cell = min(p.cell for p in patterns if isinstance(p, Code))
        if _words(tuple(patterns), looked.lines) * cell < looked.lines:
            cell = 0  # a frame was left out for a trial: the others do not tell all cells apart
        best = nearest_within(seen[coded], possible[coded], looked.limit)[1]
        number = np.floor((at[best] + 0.25) / max(cell, 1))
    for period in {p.period for p in patterns if isinstance(p, Phase)}:
        steps = [k for k, p in enumerate(patterns) if isinstance(p, Phase) and p.period == period]
        shifts = np.array([p.shift_rad for p in patterns if isinstance(p, Phase) and p.period == period])
        if len(distinct(np.round(np.exp(1j * shifts), 6))) < 3:
            continue
        A = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
        found, *_ = np.linalg.lstsq(A, seen[steps].astype(np.float64), rcond=None)
        amplitude = np.hypot(found[1], found[2])
        rest = np.sqrt(np.mean((seen[steps] - A @ found) ** 2, axis=0))
        strong = (amplitude > FAINT) | (rest > FAINT)
        bad |= strong & (rest > NO_WAVE * amplitude)
        phase = np.arctan2(found[2], found[1]) - 2 * np.pi * (number + 0.5) * cell / period
        allowed = np.pi * cell / period + WAVE_SLACK
        if cell and allowed < 0.85 * np.pi:
            bad |= strong & (np.abs(np.angle(np.exp(1j * phase))) > allowed)
    return bad


def _response(seen: Array, expected: Array) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the rising curve by which grey values follow from what is expected: levels, and values there."""
    edges = np.linspace(0, 1, 13)
    bins = np.clip(np.digitize(expected, edges) - 1, 0, 11)
    middle = np.array([float(np.median(seen[bins == b])) if np.any(bins == b) else np.nan for b in range(12)])
    known = np.isfinite(middle)
    if known.sum() < 3:
        return edges, edges
    return ((edges[1:] + edges[:-1]) / 2)[known], np.maximum.accumulate(middle[known])
