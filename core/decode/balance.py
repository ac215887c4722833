"""The thresholds of codes without inverse frames, where they are not halfway between white and black.

A camera's gamma moves what half the light shows, of all bits alike. A projector may show stripes darker than the white
field - its lamp follows the picture, its lens scatters, its lines are finer than it can show -, each bit by another
part. The sample tells both: blur leaves of fine bits a single level, half the light; of the others, on and off show.
"""

from __future__ import annotations

import itertools

import numpy as np

from core.decode.noise import Noise
from core.decode.sample import FEWEST
from core.decode.tables import Array, AxisTable, Singles, make_rows, sums_of

BRIGHT = 0.3  # part of the brightest pixels' contrast
AROUND = 0.03  # part of the pixels to either side of the median that tell the middle between on and off
FEW_CELLS = 7  # of a code, as many as alike would be seen as often: of fewer a bit may be on in more than half
SHARP = 0.3  # of half the contrast, by which these differ where the median may be anywhere between on and off
LEVEL = 0.8  # of half the contrast, between the quartiles of what is nearly one level
EDGES = 0.25  # part of the pixels that show neither on nor off, without which a median between these tells nothing
ASKEW = 0.8  # of the way from one quartile to the other, by which these lie askew about the median
OFF, FARTHEST = 0.1, 0.7  # of half the contrast: nearer to the middle a threshold stays; farther is black or white
APART = 0.6  # of half the contrast, by which on and off of a bit differ at least
SEEN = 0.05  # part of the pixels that must show a level


def balance(table: AxisTable, sample: Singles, noise: Noise) -> AxisTable:
    """Move the thresholds of such a code to the middle between on and off; `sample` is grey values (frames, n)."""
    if table.lift != 0 or not (table.has_threshold and table.has_contrast and table.sign.all()):
        return table
    threshold, contrast, *bits = sums_of(table.rows, sample)
    lit = contrast > 5 * np.sqrt(noise.variance(threshold))
    if lit.sum() < FEWEST:
        return table
    bright = contrast > BRIGHT * np.quantile(contrast[lit], 0.98)  # of dim ones, grey values are as steps
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
    for number, move in enumerate((alike, *(table.sign * (middles - alike)))):
        row = rows[number + (number > 0)]
        for frame, value in rows[1].items():
            row[frame] = row.get(frame, 0.0) + float(move) * value
    if len(table.period):  # without phases, too, the bits tell what contrast they have (sample.measure_fading)
        rows[1] = {frame: swing * value for frame, value in rows[1].items()}
    return table._replace(rows=make_rows(rows))


def _middles(levels: Singles) -> tuple[Array, float]:
    """The level between on and off of every bit, and half of what they differ by in coarse ones.

    0 is halfway between white and black, 1 half their difference. `levels` are (bits, n), the coarsest first. From the
    finest on, that is the median, as long as it is steady; of coarser bits it lies as far from their own on and off as
    that of the last from those of the first of these.
    """
    middles, known = np.zeros(len(levels)), len(levels)
    for bit in reversed(range(len(levels))):
        lower, low, high, upper = np.quantile(levels[bit], (0.25, 0.5 - AROUND, 0.5 + AROUND, 0.75))
        between = np.mean(np.abs(levels[bit]) < 0.5)  # where many are, the finest tells what a gamma does
        wide = upper - lower > LEVEL and (bit < len(levels) - 1 or between < EDGES)
        askew = abs(lower + upper - low - high) > ASKEW * (upper - lower) > ASKEW * APART  # it is on or off itself
        middle = float(low + high) / 2
        anywhere = high - low > SHARP or abs(middle) > FARTHEST
        half = upper - lower < SHARP and _is_half(middle, levels[:bit], middles[known : known + 1])
        if wide or askew or anywhere or (not half and _few(levels[: bit + 1])):
            break
        middles[bit], known = middle, bit
    off, on, told = -1.0, 1.0, known == len(levels)
    part = 0.5 if told else (middles[known] - off) / (on - off)
    for bit in reversed(range(known)):
        centre = (off + on) / 2
        dark, bright = levels[bit][levels[bit] <= centre], levels[bit][levels[bit] > centre]
        if min(len(dark), len(bright)) > SEEN * len(levels[bit]):
            (low, dim, near), (far, light, high) = (np.quantile(each, (0.25, 0.5, 0.75)) for each in (dark, bright))
            # no light by a second way among them, and off is dark: nor what blur makes of the only cell seen
            if max(near - low, high - far) < SHARP and light - dim > APART and dim < -APART:
                off, on = float(dim), float(light)
                if not told:
                    part, told = float(np.clip((middles[known] - off) / (on - off), 0.1, 0.9)), True
        middles[bit] = off + part * (on - off)
    return middles, (on - off) / 2


def _few(levels: Singles) -> bool:
    """Whether so few cells of these bits are seen that the last may be on in more than half of the pixels."""
    cells = np.unique(2.0 ** np.arange(len(levels)) @ (levels > 0), return_counts=True)[1]
    return bool(np.sum(cells) ** 2 < FEW_CELLS * np.sum(cells**2))


def _is_half(level: float, coarser: Singles, finer: Array) -> bool:
    """Whether a bit's single level is half the light, as blur leaves it, and not that of the only cell seen.

    Coarser bits then show more light as well as less, and the next finer one the same half, or a darker one.
    """
    low, high = np.quantile(coarser, (SEEN, 1 - SEEN), axis=1)
    between = low.min(initial=level) < level - APART / 2 and high.max(initial=level) > level + APART / 2
    return bool(between and np.all((finer - OFF < level) & (level < np.maximum(finer, 0) + OFF)))
