"""The ripple of whole lines on sine fringes, found in the coordinates themselves and taken out.

Each line is evenly bright: a wave of lines is a staircase, whose steps blur softens. Beside the wave there are copies
of it at ``1/P + k`` per line, k a whole number, and all of them follow the phase shift, so no number of steps tells
them from the wave. With the blur b (lines) they displace the coordinate u by ``-A sin(2 pi u)``,

    A ~ (exp(-2 pi² b² (1 - 2/P)) / (1 - 1/P) + exp(-2 pi² b² (1 + 2/P)) / (1 + 1/P)) / 2 pi,

whatever the period P. Displaced coordinates crowd about the lines' middles: the mean of ``exp(2 pi i u)`` over a scene
that favours no place within lines is ``J1(2 pi A) ~ pi A``, less what noise makes of it. A lens that is sharp enough
leaves phases that stand still over most of a line (A = 0.16 and more): no coordinate tells where in it a pixel lies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.decode.tables import Singles
from core.model import Array
from core.numerics import median_of, polynomial
from core.parallel import run_in_bands

TILES, SIDE = 4, 64  # tiles of the image along each axis, apart from each other, and pixels along each at most
FEWEST_PIXELS, FEWEST_TILES = 400, 8
SIGNIFICANT = 6.0  # standard errors by 8 to 16 tiles: once in 6,000 to 100,000 axes by chance
HIDDEN = 0.3  # lines, noise beyond which no place within lines is seen
LEAST = 0.003  # lines: less is not worth it
STRONG = 0.1  # lines: so much may come from a scene in step with the lines
WIDEST = 0.8  # lines in a pixel, whose width leaves less than `STRONG` of the strongest ripple: sinc(0.8) / pi
OWN = 0.5  # part of the crowding that smooth surfaces show where they are in step with the lines
MOST = 0.12  # lines that are taken out: places that phases tell less and less are better doubted
TURN = np.float32(2 * np.pi)
CLOSE = 0.002  # lines that the fixed point may leave


def take_ripple_out(u: Singles, sigma: Singles) -> None:
    """Correct, in place, coordinates of sine fringes, shape (H, W), and their sigmas, lines, where they crowd."""
    found = _amplitude(u, sigma)
    if found is None:
        return
    plane, unsure = found
    along = (plane[2] * np.arange(u.shape[1])).astype(np.float32)
    corners = plane[0] + np.add.outer([0, plane[1] * len(u)], [0, plane[2] * u.shape[1]])
    strongest = float(np.clip(corners.max(), LEAST, MOST))
    rounds = int(np.ceil(np.log(CLOSE / strongest) / np.log(TURN * strongest)))

    def band(first: int, last: int) -> None:
        seen, spread = u[first:last], sigma[first:last]
        down = (plane[0] + plane[1] * np.arange(first, last)).astype(np.float32)
        there = np.maximum(down[:, None] + along, 0)
        # of a place that noise hides, the ripple in the mean
        own = np.minimum(there, np.float32(MOST)) * np.exp(np.float32(-0.5) * np.square(TURN * spread))
        place = seen
        for _ in range(max(rounds, 1)):
            place = seen + own * np.sin(TURN * place)
        spread /= 1 - TURN * own * np.cos(TURN * place)
        left = there * np.maximum(there - np.float32(MOST), 0) + unsure  # nothing moves phases that stand still
        np.sqrt(np.square(spread) + np.float32(0.5) * left, out=spread)
        seen[:] = place

    run_in_bands(band, len(u))


def _amplitude(u: Singles, sigma: Singles) -> tuple[Array, np.float32] | None:
    """Find A, lines, as constant and slopes by row and column, and its variance about that, from the tiles.

    None where it is not worth it. A scene's own crowding favours no place within lines: its size shows in the imaginary
    parts.
    """
    places, means, tiles = [], [], []
    for tile in ((rows, columns) for rows in _tiles(u.shape[0]) for columns in _tiles(u.shape[1])):
        clear = np.isfinite(u[tile]) & (sigma[tile] < HIDDEN)
        if clear.sum() >= FEWEST_PIXELS:
            means.append(_crowding(u[tile][clear], sigma[tile][clear]))
            places.append((1.0, *((along.start + along.stop) / 2 for along in tile)))
            tiles.append((tile, clear))
    if len(means) < FEWEST_TILES:
        return None
    crowding = np.array(means)
    middle = float(crowding.real.mean())
    by_chance = float(np.sqrt(np.mean(crowding.imag**2) / len(means)))
    if middle < SIGNIFICANT * by_chance or middle / np.pi <= LEAST:
        return None
    if middle / np.pi >= STRONG:
        over_four = np.abs(u[:, 4:] - u[:, :-4]), np.abs(u[4:] - u[:-4])
        if max(median_of(change) / 4 for change in over_four) > WIDEST:
            return None
        smooth = [abs(_crowding(_smooth(u[t], clear)[clear], sigma[t][clear])) for t, clear in tiles]
        if np.mean(smooth) > OWN * middle:
            return None
    inverse = crowding.real * (1 + 0.5 * crowding.real**2) / np.pi  # of J1
    plane = np.linalg.lstsq(np.array(places), inverse, rcond=None)[0]
    left = np.square(inverse - np.array(places) @ plane).sum() / (len(places) - len(plane))
    return np.asarray(plane), np.float32(left)


def _crowding(u: Singles, sigma: Singles) -> complex:
    """Mean of ``exp(2 pi i u)``, were it without noise."""
    part = np.exp(np.float32(-0.5) * np.square(TURN * sigma))
    angle = TURN * (u - np.rint(u))
    return complex(np.vdot(part, np.cos(angle)), np.vdot(part, np.sin(angle))) / float(np.vdot(part, part))


def _smooth(u: Singles, clear: NDArray[np.bool_]) -> Singles:
    """Coordinates of the quadratic surface through a tile."""
    y, x = (np.linspace(-1, 1, n) for n in u.shape)
    y, x = (each.ravel() for each in np.meshgrid(y, x, indexing="ij"))
    terms = polynomial(x, y, 2)
    fitted = np.linalg.lstsq(terms[clear.ravel()], u[clear].astype(float), rcond=None)[0]
    return np.asarray(terms @ fitted, np.float32).reshape(u.shape)


def _tiles(size: int) -> list[slice]:
    """The tiles along an axis, evenly over the image."""
    side = min(SIDE, size // TILES)
    return [slice(first, first + side) for first in np.linspace(0, size - side, TILES).astype(int).tolist()]
