"""Edges of a code that lie beside the phases' place of them: light by a second way from near, or from one direction.

Light of part p from elsewhere moves a phase of period P by ``p P / (2 pi)`` times the sine of how many turns away it
comes from, and the edges of bits by p over how steeply these change, whichever way the other place's bit is. Where the
other place is a few lines off, or as many turns off all over a tile, no level far from edges shows it, but the edges no
longer lie where the phases say. Noise, a response, a camera's gamma, blur and light from all around leave them there:
they bend phases by nothing at the edges, and move edges that fall as much as those that rise, the other way.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.pairs import TILES
from core.decode.tables import Array, AxisTable, Singles

NEAR = 1.0  # line about an edge, in which levels change evenly
STRAIGHT = 0.9  # of half the contrast, the same
APART = 6.0  # lines between edges of a bit, at least
BITS = 3  # the finest of those
FEWEST = 15  # pixels about rising edges, and about falling ones, that tell it in a tile and those beside it
AROUND = 5  # tiles across, whose squares are taken together
# times what noise makes of it, and lines, from which there is anything to tell: without light by a second way, 36
# captures of three sequences under responses, gammas, flicker, gloss and scattering had up to 3.1, and 0.026 lines
SHOWN, SLIGHT = 3.5, 0.03

Levels = Callable[[NDArray[np.intp], NDArray[np.intp]], Singles]


def moved_edges(place: Singles, smooth: NDArray[np.bool_], table: AxisTable, levels: Levels) -> Singles | None:
    """Find how much light comes by a second way, of what comes straight, by edges beside their place.

    `place`, (h, w), are coordinates in lines of pixels spread over the image, as many in every tile, used where
    `smooth`. `levels` gives the grey values of a bit, of each of some pixels (flat numbers), as parts of half the
    contrast about the middle between off and on. The part is (TILES, TILES); None where nothing is shown.
    """
    bits = len(table.sign)
    runs = [float(table.cell) * 2.0 ** (bits - b - (0 if table.gray else 1)) for b in range(bits)]
    pixels, numbers, aside, rising = [], [], [], []
    for bit in [b for b in range(bits) if runs[b] >= APART and table.fading[b] <= 1][-BITS:]:
        edge = (place + 0.5) / runs[bit] - (0.5 if table.gray else 0.0)
        number = np.rint(edge)
        away = (edge - number) * runs[bit]
        at = np.flatnonzero((np.abs(away) < NEAR) & smooth)
        pixels.append(at)
        numbers.append(np.full(len(at), bit))
        aside.append(away.ravel()[at])
        rising.append(np.where((number.ravel()[at] % 2 == 0) == table.gray, 1.0, -1.0))
    if not pixels:
        return None
    at, sign, x = np.concatenate(pixels), np.concatenate(rising), np.concatenate(aside)
    y = sign * levels(at, np.concatenate(numbers))
    good = np.abs(y) < STRAIGHT
    at, sign, x, y = at[good], sign[good], x[good], y[good]
    row, column = (each * TILES // size for each, size in zip(np.divmod(at, place.shape[1]), place.shape, strict=True))
    tile, ones = row * TILES + column, np.ones(len(at))
    terms = x, ones, sign
    sums = [np.bincount(tile, a * b, TILES**2) for k, a in enumerate(terms) for b in (*terms[k:], y)]
    stack = np.stack([*sums, np.bincount(tile, y * y, TILES**2)], axis=1).reshape(TILES, TILES, -1)
    xx, x1, xs, xy, one, s1, y1, ss, ys, yy = np.moveaxis(_around(stack, 3), -1, 0)
    normal = np.array([[xx, x1, xs], [x1, one, s1], [xs, s1, ss]]).transpose(2, 3, 0, 1) + 1e-6 * np.eye(3)
    right = np.array([xy, y1, ys]).transpose(1, 2, 0)[..., None]
    inverse = np.linalg.inv(normal)
    slope, offset, middle = np.moveaxis((inverse @ right)[..., 0], -1, 0)
    left = np.maximum(yy - slope * xy - offset * y1 - middle * ys, 0) / np.maximum(one - 3, 1)
    told = (one - np.abs(s1) >= 2 * FEWEST) & (slope > 0)
    per = np.where(told, 1 / np.maximum(slope, 1e-3), 0)
    each = np.stack([(offset * per) ** 2, left * inverse[..., 1, 1] * per**2, per**2, told], axis=-1)
    square, chance, steep, number = np.moveaxis(_around(each, AROUND), -1, 0)
    beyond = np.maximum(square - chance, 0)
    by_phase = float(table.period[0]) ** 2 / (8 * np.pi**2)  # in the mean over all turns, of both
    shown = (square > SHOWN**2 * chance) & (beyond > SLIGHT**2 * number)
    part = np.where(shown, np.sqrt(beyond / np.maximum(number * by_phase + steep, 1e-9)), 0).astype(np.float32)
    return part if part.any() else None


def _around(values: Array, tiles: int) -> Array:
    """Sums (TILES, TILES, n) over so many tiles across."""
    return np.asarray(cv2.boxFilter(values, -1, (tiles, tiles), normalize=False, borderType=cv2.BORDER_CONSTANT))
