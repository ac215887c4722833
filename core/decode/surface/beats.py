"""Fringes whose amplitude beats over the field: light by a second way, where neighbouring periods tell places.

Light of part p from d lines away makes a fringe of period P weaker or stronger by ``p cos(2 pi d / P)`` and turns it by
``p sin(2 pi d / P)``. Periods that are nearly alike turn alike, so they hardly contradict each other however much they
are bent. But their amplitude, as a part of the contrast of white and black, goes up and down as d changes over the
field, and what little they contradict each other goes along: ``p sin(2 pi d / P) - p sin(2 pi d / P')`` is nearly
``p cos(2 pi d / P)`` times a slowly changing factor. Blur, scattering and what is shiny change the amplitude alone,
harmonics the phases by ``sin(n phi)`` and the amplitude by ``cos(n phi)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.decode.pairs import FEWEST, Pairs
from core.decode.tables import Singles

EVIDENT = 3.5  # standard deviations by noise from which periods contradict each other
SEVERAL = 0.05  # part of the tiles where they must
# square of the correlation: where gamma, texture and JPEG made both change, in 6 captures, its median was up to 0.29
ALIKE = 0.3
SLIGHT = 0.02  # of the direct light, from which there is anything to tell: noise alone gave up to 0.015
EVEN = 0.1  # of the light: pairs that differ by more lie at an edge of texture
BEST = 0.95  # quantile over the tiles that is the amplitude in direct light
BINS = 16  # of a turn, in which harmonics that the steps confuse with the first change the amplitude `steps` times
TINY = 1e-12


def beating(
    pairs: Pairs,
    known: NDArray[np.bool_],
    amplitude: Singles,
    light: Singles,
    contrary: Singles,
    turns: Singles,
    steps: int,
) -> Singles | None:
    """Find how much light of tiles of the image comes by a second way, as a part of what comes straight.

    Parameters
    ----------
    pairs : Pairs
        The pixels (n,) that all the arrays are of.
    known : bool (n,)
        Which of them may be used.
    amplitude, light : float32 (n,)
        Of the finest fringes, and half the contrast of white and black, in grey values.
    contrary : float32 (n,)
        Difference of two periods' coordinates, in its standard deviations.
    turns : float32 (n,)
        Phase of the finest fringes, of so many `steps`.

    Returns
    -------
    part : float32 (TILES, TILES), optional
        None where nothing is shown.
    """
    known = known & (light > 0)  # where white is darker than black frames are not what they claim
    one, other = pairs.split(light)
    both = np.logical_and(*pairs.split(known)) & (np.abs(one - other) < EVEN * (one + other))
    enough = pairs.around(both) >= FEWEST
    x, a, b = (np.where(known, each, 0) for each in (contrary, amplitude, light))
    one, other = pairs.split(x)
    product = one * other * both
    evident = enough & (pairs.around(product) > EVIDENT * np.sqrt(np.maximum(pairs.around(product * product), 0)))
    least = SEVERAL * np.count_nonzero(enough)
    if np.count_nonzero(evident) <= least:
        return None
    at = (np.where(known, turns, 0) * steps % 1 * BINS).astype(np.intp) % BINS
    b = b * (np.bincount(at, a, BINS) / np.maximum(np.bincount(at, b, BINS), TINY)).astype(np.float32)[at]
    halves = [[half * both for half in pairs.split(each)] for each in (b, a, x * b)]
    (bb, ab, xb), (_, aa, xa), (_, _, xx) = ([pairs.around(p[0] * q[1] + p[1] * q[0]) for q in halves] for p in halves)
    bb, total = np.maximum(bb, TINY), np.maximum(pairs.around(halves[0][0] + halves[0][1]), TINY)
    mean, bent = (pairs.around(p[0] + p[1]) / total for p in halves[1:])
    swing = np.maximum(aa - 2 * mean * ab + mean**2 * bb, 0)
    apart = np.maximum(xx - 2 * bent * xb + bent**2 * bb, TINY)
    alike = (xa - mean * xb - bent * ab + mean * bent * bb) ** 2 / np.maximum(apart * swing, TINY)
    by_swing = np.sqrt(2 * swing / bb) / np.maximum(mean, TINY)
    telling = evident & (by_swing > SLIGHT)
    if np.count_nonzero(telling) <= least or np.median(alike[telling]) < ALIKE:
        return None
    # where the second way stays as long for all tiles around, the amplitude only is low
    by_mean = np.quantile(mean[enough], BEST) / np.maximum(mean, TINY) - 1
    part = np.where(telling & (alike > ALIKE), np.maximum(by_swing, by_mean), by_swing)
    part = np.where(enough & (part > SLIGHT), part, 0).astype(np.float32)
    return part if part.any() else None
