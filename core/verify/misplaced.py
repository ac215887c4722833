"""Frames of a code or phase steps that were exchanged, or are of another moment, on objects of any form.

From one cell of a Gray code to the next one bit changes. If it stands for another, the coordinate jumps to a far cell
whose word differs by one bit, all along that line; steps of depth join any words. Steps of square waves may be
exchanged so that every cell keeps its word: then the coordinate runs backwards in each. Of many steps, neighbours that
were exchanged bend the coordinate by little; the wave that the others make tells which.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

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
FEWEST_STEPS = 5  # of a period: fewer leave too little beside the wave
HARMONICS = (8, 12)  # steps from which a second and a third harmonic are no misfit
TOLD_APART = 7  # steps from which no other pair makes the same wave, backwards
# of the misfit, that two steps in each other's place leave: exchanged ones to 0.23 (sine), to 0.9 (square), sound
# ones from 1.1, in light that flickers from 0.69
LEFT = 0.65
ODD_STEP = 0.1  # of its misfit, also without what more or less light explains of it: the others' without an odd step


def exchanged_frames(patterns: Sequence[Pattern], maps: Sequence[tuple[Axis, Map, str]]) -> list[Finding]:
    """Find frames that stand for each other; `maps` are decoded coordinates (H, W) and what they count."""
    found = []
    for axis, values, along in maps:
        codes = [p for p in patterns if isinstance(p, Code) and p.axis == axis]
        if len({(p.cell, p.kind) for p in codes}) != 1:
            continue
        cell, stepped = codes[0].cell, any(isinstance(p, Phase) and p.axis == axis for p in patterns)
        ways = _both_ways(values, cell)
        share = _odd_cells(ways, cell) if codes[0].kind == "gray" else 0.0
        if share > ODD:
            text = f"{along} jump to and fro at {share:.0%} of the code's cells: two of its frames were exchanged"
            found.append(Finding("order", "bad", text, {"odd": share}, names="mistake"))
        elif stepped and (share := _backwards(ways, cell)) > BACKWARDS:
            text = f"{along} run backwards in {share:.0%} of the code's cells: two phase steps were exchanged"
            found.append(Finding("order", "bad", text, {"backwards": share}, names="mistake"))
    return found


def _both_ways(values: Map, cell: int) -> list[tuple[Map, Map]]:
    """Some rows of a map, and some columns as rows, and the code's cells they lie in."""
    ways = [np.ascontiguousarray(some[:: -(-len(some) // ROWS)]) for some in (values, values.T)]
    return [(some, np.floor((some + 0.5) / cell)) for some in ways]  # a tenth of the time of some // cell


def _usual(steps: Map) -> float:
    """The median of some steps' sizes; 0 without any."""
    some = np.abs(steps[:, ::THIN])
    some = some[np.isfinite(some)]
    return median_of(some) if len(some) else 0.0


def _odd_cells(ways: Sequence[tuple[Map, Map]], cell: int) -> float:
    """Share of the cells that are left by jumps to a word of one other bit more often than not."""
    jumps = np.zeros(0, np.int64)
    for image, those in ways:
        away = image[:, APART:] - image[:, :-APART]
        far = np.abs(away) > cell + 4 * _usual(away)  # which NaN is not
        first, second = (np.maximum(each[far], 0).astype(np.int64) for each in (those[:, :-APART], those[:, APART:]))
        word = (first ^ first >> 1) ^ (second ^ second >> 1)
        jumps = np.append(jumps, first[word & (word - 1) == 0])
    if len(jumps) <= ODD_CELLS * LEAST / 2:
        return 0.0  # as of sound captures: too few for so many cells
    pairs = [(those[:, :-APART], those[:, APART:]) for _, those in ways]
    left = np.concatenate([a[(a != b) & np.isfinite(a) & np.isfinite(b)] for a, b in pairs])
    count = np.bincount(np.maximum(left, 0).astype(np.int64))
    odd = np.bincount(jumps, minlength=len(count)) > 0.5 * count
    judged = count >= LEAST
    number = int(np.count_nonzero(odd & judged))
    return number / int(judged.sum()) if number >= ODD_CELLS and judged.sum() >= FEWEST else 0.0


def _backwards(ways: Sequence[tuple[Map, Map]], cell: int) -> float:
    """Share of neighbours in a cell between which the coordinate falls where it rises over some cells, or reverse."""
    seen = []
    for image, those in ways:
        step = np.diff(image)
        usual = _usual(step)
        if usual > 0 and image.shape[1] >= 3 * LEAST_REACH:
            reach = int(np.clip(round(STEADY[1] * cell / usual), LEAST_REACH, image.shape[1] // 3))
            rise = image[:, reach:] - image[:, :-reach]
            seen.append((step[:, : rise.shape[1]], rise, those[:, :-reach] == those[:, 1 : 1 - reach]))

    def told(step: Map, rise: Map, inside: NDArray[np.bool_]) -> int:
        size = np.abs(rise)
        use = inside & (size > STEADY[0] * cell) & (size < STEADY[2] * cell) & (np.abs(step) > SURE_LINES)
        return int(np.count_nonzero(use))

    against = 0
    for step, rise, inside in seen:
        falls = step * rise < 0
        against += told(step[falls], rise[falls], inside[falls])
    if against <= BACKWARDS * PAIRS:
        return 0.0  # as of sound captures, without a look at all pixels
    count = sum(told(*each) for each in seen)
    return against / count if count >= PAIRS else 0.0


def exchanged_steps(patterns: Sequence[Pattern], grey: Map, lit: NDArray[np.bool_], saturation: float) -> list[Finding]:
    """Find two phase steps of a period that make a wave in each other's place only.

    `grey` (frames, n) counts where `lit` (n,) and below `saturation`.
    """
    found = []
    for axis, own, shifts, seen in _many_steps(patterns, grey, lit, saturation):
        left, *pair = _likelier(shifts, seen)
        if left < LEFT:
            shots = tuple(own[step] for step in pair) if len(own) >= TOLD_APART else ()
            which = "frames {} and {}".format(*shots) if shots else "two phase steps"
            along = "columns" if axis == "x" else "rows"
            text = f"frames across {along} contradict each other: {which} were exchanged"
            found.append(Finding("identity", "bad", text, {}, shots, names="mistake"))
    return found


def odd_steps(patterns: Sequence[Pattern], grey: Map, lit: NDArray[np.bool_], saturation: float) -> list[Finding]:
    """Find a phase step without which the others of its period make waves, and that differs by more than light."""
    found = []
    for _, own, shifts, seen in _many_steps(patterns, grey, lit, saturation):
        if len(own) >= TOLD_APART and (step := _odd(shifts, seen)) is not None:
            why = "it is of another capture, or something moved or flickered in part; record again"
            text = f"frame {own[step]} does not fit the other steps of its period: {why}"
            found.append(Finding("movement", "bad", text, {}, (own[step],)))
    return found


def steps_of_periods(patterns: Sequence[Pattern]) -> list[tuple[Axis, list[int], NDArray[np.float64]]]:
    """Axis, numbers and shifts of the phase steps of every period."""
    steps: dict[tuple[Axis, float], dict[int, float]] = {}
    for k, p in enumerate(patterns):
        if isinstance(p, Phase):
            steps.setdefault((p.axis, p.period), {})[k] = p.shift_rad
    return [(axis, list(own), np.array(list(own.values()))) for (axis, _), own in steps.items()]


def _many_steps(
    patterns: Sequence[Pattern], grey: Map, lit: NDArray[np.bool_], saturation: float
) -> Iterator[tuple[Axis, list[int], NDArray[np.float64], Map]]:
    """Axis, numbers, shifts and grey values (steps, n) of every period that has steps enough."""
    for axis, own, shifts in steps_of_periods(patterns):
        if len(own) >= FEWEST_STEPS:
            seen = grey[own]
            seen = seen[:, lit & (seen.max(axis=0) < saturation)]
            if seen.shape[1] >= PAIRS:
                yield axis, own, shifts, seen


def _likelier(shifts: NDArray[np.float64], seen: Map) -> tuple[float, int, int]:
    """The two steps that fit best in each other's place, and the part of the misfit to waves that is left then.

    It is a trace of the covariance of frames over all pixels, `seen` (frames, n), which exchanges reorder.
    """
    beside, seen = _beside(shifts), seen - seen.mean(axis=0)
    seen /= np.maximum(np.linalg.norm(seen, axis=0), 1e-9)
    covariance = seen @ seen.T
    misfit = []
    pairs = list(combinations(range(len(shifts)), 2))
    for i, k in [(0, 0), *pairs]:
        order = np.arange(len(shifts))
        order[[i, k]] = order[[k, i]]
        misfit.append(float(np.sum(beside @ covariance[np.ix_(order, order)] * beside)))
    best = int(np.argmin(misfit[1:]))
    return misfit[1 + best] / max(misfit[0], 1e-9), *pairs[best]


def _waves(shifts: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """What steps may show: offset, wave and as many harmonics as they can tell from exchanges."""
    orders = range(1, 2 + sum(len(shifts) >= n for n in HARMONICS))
    return [np.ones_like(shifts), *(turn(h * shifts) for h in orders for turn in (np.cos, np.sin))]


def _beside(shifts: NDArray[np.float64], *also: NDArray[np.float64]) -> NDArray[np.float64]:
    """What steps show beside a wave, its harmonics and `also` (frames,): orthonormal rows of the frames' values."""
    waves = np.stack([*_waves(shifts), *also])
    return np.asarray(np.linalg.svd(waves)[2][np.linalg.matrix_rank(waves, 1e-6) :])


def _odd(shifts: NDArray[np.float64], seen: Map) -> int | None:
    """The step without which the others make waves, if it differs from theirs by more than more or less light."""
    covariance = seen @ seen.T
    whole, *without = (
        float(np.sum(beside @ covariance * beside))
        for beside in (_beside(shifts), *(_beside(shifts, row) for row in np.eye(len(shifts))))
    )
    step = int(np.argmin(without))
    if without[step] > ODD_STEP * whole:
        return None
    others = np.arange(len(shifts)) != step
    waves = np.stack(_waves(shifts))
    offset, *wave = np.linalg.lstsq(waves[:, others].T, seen[others], rcond=None)[0]
    light = np.stack([offset, waves[1:, step] @ wave, np.ones_like(offset)])
    off = seen[step] - offset - light[1]
    rest = off - np.linalg.lstsq(light.T, off, rcond=None)[0] @ light
    return step if without[step] < ODD_STEP * (rest @ rest) else None
