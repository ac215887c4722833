"""The period that phases have: by how much they turn from edge to edge of a code.

Light by a second way, a response or blur bend phases to and fro, alike in every cell or here and there. Over many edges
they leave the frequency. With a period that is far off, coordinates are wrong by parts of it and contradict bits of the
code only near its edges, as such light makes them do.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array
from core.numerics import distinct, median_of
from core.patterns import Pattern, Phase
from core.verify.edges import Edges

Turns = NDArray[np.complex128]

PIXELS = 2000  # at edges along rows, and along columns, that are looked at
LEAST, FEWEST = 8, 5  # pixels that tell an edge; such edges
NEAR, STEP = 10, 0.1  # steps, and turns over the field, by which rates near the one described are tried
EVEN, SAME = 0.8, 0.7  # mean of phases at the edges as unit vectors, at their rate; of that, at one that is no other


@dataclass(frozen=True)
class Turning:
    """Edges by their `key`, how far phases there lag behind, in lines of their period, and whether it is another one.

    What is `far` has lost a turn or more over the field.
    """

    key: NDArray[np.int64]
    off: Array
    far: bool


def turning(
    patterns: Sequence[Pattern], images: Sequence[NDArray], ways: Sequence[Edges], steps: Sequence[int], cell: int
) -> Turning | None:
    """Follow the phases of `steps` from edge to edge of the code; None where they do not turn evenly."""
    wave = patterns[steps[0]]
    assert isinstance(wave, Phase)
    thin = [slice(None, None, max(1, len(edges.row) // PIXELS)) for edges in ways]
    weights = _wave(patterns, steps)
    turns = [_at(weights, images, edges, some, steps) for edges, some in zip(ways, thin, strict=True)]
    keys = [edges.key[some] for edges, some in zip(ways, thin, strict=True)]
    key, turn = _means(np.concatenate(keys), np.concatenate(turns))
    if len(key) < FEWEST:
        return None
    line, rising, declared = key // 2, key % 2 > 0, 1 / wave.period
    step = STEP / max(float(np.ptp(line)), 1.0)

    def back(rates: Array) -> Turns:
        return np.asarray(turn * np.exp(-2j * pi * np.multiply.outer(rates, line)))

    def likeliest(rates: Array) -> tuple[float, float]:
        """How evenly phases turn, 0 to 1, at most, and at which rate."""
        left = back(rates)
        told = (np.abs(left @ rising) + np.abs(left @ ~rising)) / len(line)
        return float(told.max()), float(rates[np.argmax(told)])

    near, rate = likeliest(np.asarray(declared + step * np.arange(-NEAR, NEAR + 1)))
    at_end = abs(rate - declared) > (NEAR - 0.5) * step
    if far := at_end or near < SAME:
        even, rate = likeliest(np.asarray(np.arange(-0.5 / cell, 0.5 / cell, step)))
        between = _rate(weights, images, ways, steps) if even > EVEN and (at_end or near < SAME * even) else None
        if between is None:
            return None
        rate += np.round((between - rate) * cell) / cell  # edges are whole cells apart
        rate, turn = abs(rate), turn if rate > 0 else np.conj(turn)
    left = back(np.array([rate]))[0]
    for way in (rising, ~rising) if far else ():  # where turns begin is another question
        left[way] *= np.conj(left[way].sum())
    return Turning(key, wave.period * (np.angle(left) / (2 * pi) + (rate - declared) * line), far)


def _means(key: NDArray[np.int64], turn: Turns) -> tuple[NDArray[np.int64], Turns]:
    """Edges that have pixels enough, and the mean of their phases as unit vectors."""
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    mean = np.add.reduceat((turn / np.maximum(np.abs(turn), 1e-9))[order], first) if len(key) else turn
    use = np.diff(first, append=len(key)) >= LEAST
    return key[order][first][use], np.asarray(mean / np.maximum(np.abs(mean), 1e-9), np.complex128)[use]


def _wave(patterns: Sequence[Pattern], steps: Sequence[int]) -> Turns:
    """By what grey values of the steps count in the phase as a complex number."""
    shifts = np.array([p.shift_rad for k in steps if isinstance(p := patterns[k], Phase)])
    terms = np.linalg.pinv(np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1))
    return np.asarray(terms[1] + 1j * terms[2])


def _at(weights: Turns, images: Sequence[NDArray], edges: Edges, some: slice, steps: Sequence[int]) -> Turns:
    """Phases at some of the edges, as complex numbers."""
    row, column, part = edges.row[some], edges.column[some], edges.part[some]
    found = np.zeros(len(row), np.complex128)
    for weight, k in zip(weights, steps, strict=True):
        image = images[k].T if edges.turned else images[k]
        first, second = (image[row, column + side].astype(np.float64) for side in (0, 1))
        found += weight * (first + part * (second - first))
    return found


def _rate(weights: Turns, images: Sequence[NDArray], ways: Sequence[Edges], steps: Sequence[int]) -> float | None:
    """Turns per line between neighbouring edges, by the phases of all pixels between."""
    rates = [np.zeros(0)]
    for edges in ways:
        rows = distinct(edges.row)
        own = np.searchsorted(rows, edges.row)
        phase = np.zeros((len(rows), images[0].shape[not edges.turned]), np.complex128)
        for weight, k in zip(weights, steps, strict=True):
            phase += weight * (images[k].T if edges.turned else images[k])[rows]
        turns = np.cumsum(np.angle(phase[:, 1:] * np.conj(phase[:, :-1])), axis=1) / (2 * pi)
        turns = np.pad(turns, ((0, 0), (1, 0)))
        order = np.lexsort((edges.column, edges.row))
        own, column, line = own[order], edges.column[order], edges.line[order]
        away = np.diff(line)
        beside = (np.diff(own) == 0) & (away != 0)
        first, second = turns[own[:-1], column[:-1]], turns[own[1:], column[1:]]
        rates.append((second - first)[beside] / away[beside])
    found = np.concatenate(rates)
    return median_of(found) if len(found) >= LEAST else None
