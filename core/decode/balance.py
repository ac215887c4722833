"""The thresholds of codes without inverse frames, where they are not halfway between white and black.

A camera's gamma moves what half the light shows, of all bits alike. A projector may show stripes darker than the white
field - its lamp follows the picture, its lens scatters, its lines are finer than it can show -, each bit by another
part. The sample tells both: blur leaves of fine bits a single level, half the light; of the others, on and off show.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.decode.noise import Noise
from core.decode.sample import FEWEST
from core.decode.tables import Array, AxisTable, Singles, make_rows, sums_of
from core.numerics import quantile_of

BRIGHT = 0.3  # part of the brightest pixels' contrast
AROUND = 0.03  # part of the pixels to either side of the median that tell the middle between on and off
FEW_CELLS = 7  # of a code, as many as alike would be seen as often: of fewer a bit may be on in more than half
SHARP = 0.3  # of half the contrast, by which these differ where the median may be anywhere between on and off
LEVEL = 0.8  # of half the contrast, between the quartiles of what is nearly one level
EDGES = 0.25  # part of the pixels that show neither on nor off, without which a median between these tells nothing
ASKEW = 0.6  # of the way from one quartile to the other, by which these lie askew about the median
OFF, FARTHEST = 0.1, 0.7  # of half the contrast: nearer to the middle a threshold stays; farther is black or white
APART = 0.6  # of half the contrast, by which on and off of a bit differ at least
RANGE, ROUNDS = (0.02, 0.98), 2  # of a bit's levels, halfway in which on and off are first told apart; and then again
SEEN = 0.05  # part of the pixels that must show a level


def balance(table: AxisTable, sample: Singles, noise: Noise) -> AxisTable:
    """Move the thresholds of such a code to the middle between on and off; `sample` is grey values (frames, n)."""
    if table.lift != 0 or not (table.has_threshold and table.has_contrast and table.sign.all()):
        return table
    threshold, contrast, *bits = sums_of(table.rows, sample)
    lit = contrast > 5 * np.sqrt(noise.variance(threshold))
    if lit.sum() < FEWEST:
        return table
    bright = contrast > BRIGHT * quantile_of(contrast[lit], 0.98)  # of dim ones, grey values are as steps
    lit = bright if bright.sum() >= FEWEST else lit
    shown = np.stack(bits)[:, lit] + table.sign[:, None] * threshold[lit]
    middles, swing = _middles(-table.sign[:, None] * shown / contrast[lit])
    if np.abs(middles).max() < OFF:
        return table
    rows = [
        {f: float(v) for f, v in zip(table.rows.column[a:b].tolist(), table.rows.value[a:b], strict=True)}
        for a, b in itertools.pairwise(table.rows.first.tolist())
    ]
    alike = float(middles[-1]) if np.ptp(middles) < OFF else 0.0
    threshold_row, half_contrast, *bit_rows = rows
    moves = (alike, *(table.sign * (middles - alike)))
    for row, move in zip((threshold_row, *bit_rows), moves, strict=True):
        for frame, value in half_contrast.items():
            row[frame] = row.get(frame, 0.0) + float(move) * value
    if len(table.period):  # without phases, too, the bits tell what contrast they have (sample.measure_fading)
        rows[1] = {frame: swing * value for frame, value in half_contrast.items()}
    return table._replace(rows=make_rows(rows))


def _middles(levels: Singles) -> tuple[Array, float]:
    """The level between on and off of every bit, and half of what they differ by in coarse ones.

    0 is halfway between white and black, 1 half their difference. `levels` are (bits, n), the coarsest first. From the
    finest on, that is the median, as long as it is steady; of coarser bits it lies as far from their own on and off as
    that of the last from those of the first of these.
    """
    middles, known = np.zeros(len(levels)), len(levels)
    ordered = np.sort(levels, axis=1)
    bottom, top = (_part(ordered, share)[:, None] for share in RANGE)
    above = (levels > (bottom + top) / 2) & (top - bottom > APART)
    between = np.mean(np.abs(2 * levels - bottom - top) < (top - bottom) / 2, axis=1)  # part that is neither on nor off
    for bit in reversed(range(len(levels))):
        lower, low, high, upper = (_part(ordered[bit], p) for p in (0.25, 0.5 - AROUND, 0.5 + AROUND, 0.75))
        wide = upper - lower > LEVEL and (bit < len(levels) - 1 or between[bit] < EDGES)  # the finest tells a gamma
        askew = abs(lower + upper - low - high) > ASKEW * (upper - lower) > ASKEW * APART  # it is on or off itself
        middle = float(low + high) / 2
        anywhere = high - low > SHARP or abs(middle) > FARTHEST
        half = upper - lower < SHARP and _is_half(middle, ordered[:bit], middles[known : known + 1])
        if wide or askew or anywhere or (not half and _few(above[: bit + 1])):
            break
        middles[bit], known = middle, bit
    told = {bit: found for bit in range(known) if (found := _off_and_on(ordered[bit]))}
    part, swing = 0.5, 1.0
    for bit in reversed(range(known)):
        off, on = told[min(told, key=lambda other: abs(other - bit))] if told else (-1.0, 1.0)
        if bit == known - 1 and known < len(levels):
            part = float(np.clip((middles[known] - off) / (on - off), 0.1, 0.9))
        middles[bit], swing = off + part * (on - off), (on - off) / 2
    return middles, swing


def _off_and_on(levels: Singles) -> tuple[float, float] | None:
    """The two levels of a bit, given in order (n,); None where they are not clearly two, as with a second light.

    Off is dark, too: it is not what blur makes of the only cell seen.
    """
    centre = sum(_part(levels, share) for share in RANGE) / 2
    for _ in range(ROUNDS):
        dark, bright = np.split(levels, [int(np.searchsorted(levels, centre, side="right"))])
        if min(len(dark), len(bright)) < SEEN * len(levels):
            return None
        (low, off, near), (far, on, high) = ([_part(each, p) for p in (0.25, 0.5, 0.75)] for each in (dark, bright))
        centre = (off + on) / 2
    two = max(near - low, high - far) < SHARP and on - off > APART and off < -APART
    return (off, on) if two else None


def _part(ordered: Singles, share: float) -> Any:
    """The value below which a share of those lies that are given in order, (n,) or (b, n)."""
    return ordered[..., round(share * (ordered.shape[-1] - 1))].astype(float)


def _few(above: NDArray[np.bool_]) -> bool:
    """Whether so few cells of these bits (b, n) are seen that the last may be on in more than half of the pixels."""
    cells = np.unique(2.0 ** np.arange(len(above)) @ above, return_counts=True)[1]
    return bool(np.sum(cells) ** 2 < FEW_CELLS * np.sum(cells**2))


def _is_half(level: float, coarser: Singles, finer: Array) -> bool:
    """Whether a bit's single level is half the light, as blur leaves it, and not that of the only cell seen.

    Coarser bits then show more light as well as less, and the next finer one the same half, or a darker one.
    """
    low, high = (_part(coarser, share) for share in (SEEN, 1 - SEEN))
    between = low.min(initial=level) < level - APART / 2 and high.max(initial=level) > level + APART / 2
    return bool(between and np.all((finer - OFF < level) & (level < np.maximum(finer, 0) + OFF)))
