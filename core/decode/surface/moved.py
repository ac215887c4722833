"""Edges of a code that lie beside the phases' place of them: light by a second way from near, or from one direction.

Light of part p from elsewhere moves a phase of period P by up to ``p P / (2 pi)``. To both sides of an edge a bit is
brighter or darker by p, whichever way the other place's bit is; without that, the edge is where light comes straight.
Where the other place is a few lines off, or as many turns off all over a tile, no level far from edges shows it, but
the edges no longer lie where the phases say. Noise, a response, a camera's gamma, blur and light from all around leave
them there: they bend phases by nothing at the edges, and move edges that fall as much as those that rise, the other
way.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.pairs import TILES
from core.decode.tables import Array, AxisTable, Singles, runs_of

NEAR, BESIDE, FAR = 1.0, 1.3, 2.3  # lines from an edge in which levels change, and where they change no more
STRAIGHT = 0.9  # of half the contrast, the same
APART = 6.0  # lines between edges of a bit, at least
STEPS = 8  # of the places to either side
BITS = 3  # the finest of those
SPREAD = 0.05  # of the odd function's values, least variance: a third of what they have where all lines are seen
FEWEST = 15  # pixels about rising edges, and about falling ones, that tell it in a tile and those beside it
AROUND = 5  # tiles across, whose squares are taken together
# times what noise makes of it, and lines, from which there is anything to tell; and part of the tiles that must show it
SHOWN, SLIGHT, SEVERAL = 3.5, 0.03, 0.05

Levels = Callable[[NDArray[np.intp], NDArray[np.intp]], Singles]


def moved_edges(place: Singles, smooth: NDArray[np.bool_], table: AxisTable, levels: Levels) -> Singles | None:
    """Find how much light comes by a second way, of what comes straight, by edges beside their place.

    `place`, (h, w), are coordinates in lines of pixels spread over the image, as many in every tile, used where
    `smooth`. `levels` gives the grey values of a bit, of each of some pixels (flat numbers), as parts of half the
    contrast about the middle between off and on. The part is (TILES, TILES); None where nothing is shown.
    """
    runs = runs_of(table)
    pixels, numbers, aside, rising = [], [], [], []
    for bit in [b for b in range(len(runs)) if runs[b] >= APART and table.fading[b] <= 1][-BITS:]:
        edge = (place + 0.5) / runs[bit] - (0.5 if table.gray else 0.0)
        number = np.rint(edge)
        away = (edge - number) * runs[bit]
        at = np.flatnonzero((np.abs(away) < FAR) & smooth)
        pixels.append(at)
        numbers.append(np.full(len(at), bit))
        aside.append(away.ravel()[at])
        rising.append(np.where((number.ravel()[at] % 2 == 0) == table.gray, 1.0, -1.0))
    if not pixels:
        return None
    at, sign, x = np.concatenate(pixels), np.concatenate(rising), np.concatenate(aside)
    y = sign * levels(at, np.concatenate(numbers))
    row, column = (each * TILES // size for each, size in zip(np.divmod(at, place.shape[1]), place.shape, strict=True))
    tile = row * TILES + column
    near = (np.abs(x) < NEAR) & (np.abs(y) < STRAIGHT)
    aside = (np.abs(x) > BESIDE) & (np.abs(y) < 2)
    (offset, _, slope), chance = _fitted(tile[near], y[near], sign[near], _evenly(x[near], y[near], sign[near]))
    (more, *_), by_noise = _fitted(tile[aside], y[aside], sign[aside], np.sign(x[aside]))
    per = np.where(slope > 0, 1 / np.maximum(slope, 1e-3), 0)
    told = np.isfinite(offset + more)
    each = [np.where(told, value, 0) for value in (((more - offset) * per) ** 2, (chance + by_noise) * per**2, 1.0)]
    square, chance, number = np.moveaxis(_around(np.stack(each, axis=-1), AROUND), -1, 0)
    beyond = np.maximum(square - chance, 0) / np.maximum(number, 1)
    shown = (square > SHOWN**2 * chance) & (beyond > SLIGHT**2)
    if np.count_nonzero(shown) <= SEVERAL * np.count_nonzero(number):
        return None
    by_phase = float(table.period[0]) / (8**0.5 * np.pi)  # in the mean over all turns, of all the light
    return np.where(shown, np.sqrt(beyond) / by_phase, 0).astype(np.float32)


def _evenly(x: Array, y: Array, sign: Array) -> Array:
    """Places about an edge where levels would be as they are if they changed evenly; they change most next to it."""
    columns = np.stack([np.ones(len(x)), sign, x])
    level, _, slope = np.linalg.solve(columns @ columns.T + 1e-6 * np.eye(3), columns @ y)
    edge = float(np.clip(-level / max(slope, 1e-3), -NEAR / 2, NEAR / 2))  # of all tiles, where all are moved
    away, side = np.abs(x - edge), np.sign(x - edge)
    step = np.minimum((away / NEAR * STEPS).astype(int), STEPS - 1)
    rise = np.bincount(step, side * y, STEPS) / np.maximum(np.bincount(step, minlength=STEPS), 1)
    middles = (np.arange(STEPS) + 0.5) / STEPS * NEAR
    even = np.interp(away, [0, *middles], [0, *rise])
    return np.asarray(edge + side * even * (away @ away) / max(float(even @ away), 1e-9))


def _fitted(tile: NDArray[np.intp], y: Array, sign: Array, odd: Array) -> tuple[Array, Array]:
    """Fit what edges show in tiles: a constant, what falls as much as it rises, and an odd function of the place.

    The terms (n, TILES, TILES), NaN where too little tells them, and the variance of the constant by noise.
    """
    columns = np.ones(len(y)), sign, odd
    sums = [np.bincount(tile, a * b, TILES**2) for a in (*columns, y) for b in (*columns, y)]
    size = len(columns) + 1
    normal = _around(np.stack(sums, axis=1, dtype=float).reshape(TILES, TILES, -1), 3).reshape(TILES, TILES, size, size)
    inverse = np.linalg.inv(normal[..., :-1, :-1] + 1e-6 * np.eye(size - 1))
    terms = (inverse @ normal[..., :-1, -1:])[..., 0]
    number = normal[..., 0, 0]
    left = (normal[..., -1, -1] - np.sum(terms * normal[..., :-1, -1], axis=-1)) / np.maximum(number - size, 1)
    told = number - np.abs(normal[..., 0, 1]) >= 2 * FEWEST
    told &= number * inverse[..., 2, 2] < 1 / SPREAD  # pixels in step with lines: a slope is as good as a constant
    terms = np.where(told[..., None], terms, np.nan)
    return np.moveaxis(terms, -1, 0), np.maximum(left, 0) * inverse[..., 0, 0]


def _around(values: Array, tiles: int) -> Array:
    """Sums (TILES, TILES, n) over so many tiles across."""
    return np.asarray(cv2.boxFilter(values, -1, (tiles, tiles), normalize=False, borderType=cv2.BORDER_CONSTANT))
