"""Phase steps that stand for others: exchanged, of another moment, or of the stripes that another shows.

Of many steps, neighbours that were exchanged bend the coordinate by little; the wave that the others make tells which.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from core.model import Plan
from core.model.finding import Finding
from core.numerics import median_of, quantile_of, scattered
from core.patterns import Axis, Pattern, Phase
from core.verify.pixels import LEAST_LIT
from core.verify.quality import BRIGHT, Sampled

Map = NDArray[np.floating]

PIXELS = 200  # that tell
FEWEST_STEPS = 5  # of a period: fewer leave too little beside the wave
HARMONICS = (8, 12)  # steps from which a second and a third harmonic are no misfit
TOLD_APART = 7  # steps from which no other pair makes the same wave, backwards
# of the misfit, that two steps in each other's place leave: exchanged ones to 0.23 (sine), to 0.9 (square), sound
# ones from 1.1, in light that flickers from 0.69
LEFT = 0.65
ODD_STEP = 0.1  # of its misfit, also without what more or less light explains of it: the others' without an odd step
ALL_ROUND = 0.3  # mean of phases as unit vectors: some periods are seen
DOUBLED, FAR, THIN = 0.03, 0.05, 8000  # of squared differences, those that are none; 1 - cos of shifts apart; pixels


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


def doubled_steps(plan: Plan, images: Sequence[NDArray], sampled: Sampled) -> list[Finding]:
    """Find steps that differ by hardly more than noise, where others of their period differ as their shifts say.

    Where one is saturated its neighbour may be, too, and they are alike.
    """
    # a grid may beat with the lines
    row, column = (scattered(n, THIN, k) for k, n in enumerate(images[0].shape))
    at = row * images[0].shape[1] + column
    for _, own, shifts in (period for period in steps_of_periods(plan.shots) if len(period[1]) >= 3):
        grey = np.array([images[k].ravel()[at] for k in own], np.float64)
        swing = np.ptp(grey, axis=0)
        striped = swing > max(BRIGHT * quantile_of(swing, 0.97), 5 * sampled.noise)
        grey = grey[:, striped & (grey.max(axis=0) < sampled.full)]
        wave = np.array([1, 1j]) @ (np.stack([np.cos(shifts), np.sin(shifts)]) @ (grey - grey.mean(axis=0)))
        if grey.shape[1] < LEAST_LIT or abs(np.mean(wave / np.maximum(np.abs(wave), 1e-9))) > ALL_ROUND:
            continue  # less than a period is seen
        pairs = [(i, k, 1 - np.cos(shifts[i] - shifts[k])) for i, k in combinations(range(len(own)), 2)]
        if not (pairs := [pair for pair in pairs if pair[2] > FAR]):
            continue
        squares = [float(np.dot(away := grey[i] - grey[k], away)) / len(away) for i, k, _ in pairs]
        ratios = [square / meant for square, (*_, meant) in zip(squares, pairs, strict=True)]
        at_least = int(np.argmin(ratios))
        least, usual = ratios[at_least], median_of(ratios)
        if least < DOUBLED * usual and squares[at_least] < DOUBLED * median_of(squares):
            first, second = (own[n] for n in pairs[at_least][:2])
            text = (
                f"frames {first} and {second} show the same stripes: they differ by {(least / usual) ** 0.5:.0%} of "
                "what their shifts make; one stands for the other, or the projector did not change: record it again"
            )
            return [Finding("identity", "bad", text, shots=(first, second), names="value")]
    return []


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
            if seen.shape[1] >= PIXELS:
                yield axis, own, shifts, seen


def _likelier(shifts: NDArray[np.float64], seen: Map) -> tuple[float, int, int]:
    """The two steps that fit best in each other's place, and the part of the misfit to waves that is left then.

    It is a trace of the covariance of frames over all pixels, `seen` (frames, n), which exchanges reorder.
    """
    beside, seen = beside_waves(shifts), seen - seen.mean(axis=0)
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


def beside_waves(shifts: NDArray[np.float64], *also: NDArray[np.float64]) -> NDArray[np.float64]:
    """What steps show beside a wave, its harmonics and `also` (frames,): orthonormal rows of the frames' values."""
    waves = np.stack([*_waves(shifts), *also])
    return np.asarray(np.linalg.svd(waves)[2][np.linalg.matrix_rank(waves, 1e-6) :])


def _odd(shifts: NDArray[np.float64], seen: Map) -> int | None:
    """The step without which the others make waves, if it differs from theirs by more than more or less light."""
    covariance = seen @ seen.T
    whole, *without = (
        float(np.sum(beside @ covariance * beside))
        for beside in (beside_waves(shifts), *(beside_waves(shifts, row) for row in np.eye(len(shifts))))
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
