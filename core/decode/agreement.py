"""How far the periods of an axis contradict each other: what that adds to sigma, and where it leaves the order open.

Every period tells the coordinate by itself. By what two differ beyond their noise, both are wrong: through light that
is reflected twice, a response that is not the same everywhere, a lens that blurs unlike the model. It differs from
place to place, so tiles of the image tell it each for themselves. Errors that all periods share stay unseen.

Where there is no code, the periods' differences also tell the order of the fringe. Where many pixels lie about halfway
between two orders, and noise does not explain that, others have passed the middle and been miscounted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.compiled import HALF, TILE
from core.decode.frames import Image
from core.decode.fringes import orders_stand
from core.decode.kernel import decode_pixels, scratch_for
from core.decode.noise import MEDIAN_OF_SQUARE
from core.decode.options import Flag, invalidate
from core.decode.tables import PHASES, SWEEP, Array, AxisTable, Limits, Rows, Singles, no_axis
from core.numerics import erf, row_median

TILES = 16  # of the image, in either direction
PIXELS, PART = 128, 0.03  # of a tile that are looked at, or such a part of them
FEWEST = 24  # that tell it; the variance is then known to a third
SHOWN = 1.2  # times what noise alone makes of the median square, from which there is anything to tell
FAR = 0.4  # turns that a step of the way to the finest phase must round, and nearly rounds to the next
OPEN, CHANCE, ENOUGH = 0.08, 2.0, 100  # part of so many pixels that do, besides so many times what noise alone makes
REACH = 5  # tiles: what leaves orders open in a tile may do so around it
ROWS = 64  # of the image that are judged at once


class Contradiction(NamedTuple):
    """Of tiles of the image, float32 (TILES, TILES): variances beyond noise.

    `lines` is that of the coordinate (lines²). `turns` is that of a phase (turns²) within `REACH` of tiles whose orders
    it leaves open, and 0 elsewhere.
    """

    lines: Singles
    turns: Singles


def contradiction(images: Sequence[Image], table: AxisTable, limits: Limits, image_rows: Rows) -> Contradiction | None:
    """Find by what the two finest periods contradict each other beyond their noise; None where they agree."""
    if table.start == SWEEP or len(table.period) < 2:
        return None
    size = images[0].size / TILES**2
    thin = np.sqrt(min(max(PART * size, 2 * FEWEST), PIXELS, size) / size)
    down, across = (max(1, int(n * thin / TILES)) for n in images[0].shape)  # pixels of a tile
    rows, columns = (
        ((np.arange(TILES * k) + 0.5) * n / (TILES * k)).astype(np.intp)
        for k, n in zip((down, across), images[0].shape, strict=True)
    )
    shown = [image[np.ix_(rows, columns)] for image in images]
    place, turns, variance, lit = _decoded(shown, table, limits, image_rows)
    period = table.period[:, None]
    apart = period * turns - (place + HALF)
    apart -= period * np.rint(apart / period)
    spread = period**2 * variance
    finest = np.argsort(table.period)[:2]
    square, noise = np.diff(apart[finest], axis=0)[0] ** 2, spread[finest].sum(axis=0)
    weight = 1 / spread / np.sum(1 / spread, axis=0)
    of_both = np.sum(period[finest] ** 2)
    share = np.sum((weight * period) ** 2, axis=0) / of_both  # if all are as wrong, in turns
    seen = np.where(np.isfinite(place), np.array([square / noise, square, noise, share]), np.nan)
    in_tiles = (TILES, down, TILES, across)
    tiles = seen.reshape(4, *in_tiles).transpose(0, 1, 3, 2, 4).reshape(4 * TILES**2, -1)
    medians = row_median(tiles).reshape(4, TILES, TILES)
    few = np.isfinite(tiles).sum(axis=1).reshape(4, TILES, TILES)[0] < FEWEST
    whole = row_median(seen)
    shown_anywhere = whole[0] > SHOWN * MEDIAN_OF_SQUARE
    sums = [
        np.where(lit, each, 0).reshape(in_tiles).sum(axis=(1, 3)) for each in (*_halfway(table, turns, variance), 1)
    ]
    halfway, chance, count = (cv2.blur(each.astype(np.float64), (3, 3)) * 9 for each in sums)
    left_open = (table.start == PHASES) & (count >= ENOUGH) & (halfway > OPEN * count + CHANCE * chance)
    if not shown_anywhere and not left_open.any():
        return None
    found = np.pad(np.where(few, np.nan, _beyond(medians) * medians[3]), 1, constant_values=np.nan)
    beside = np.lib.stride_tricks.sliding_window_view(found, (3, 3)).reshape(-1, 9)
    lines = np.nan_to_num(row_median(beside), nan=float(_beyond(whole) * whole[3])).reshape(TILES, TILES)
    turned = np.nan_to_num(np.where(left_open, _beyond(medians) / of_both, 0.0)).astype(np.float32)
    around = np.asarray(cv2.dilate(turned, np.ones((REACH, REACH), np.uint8)), np.float32)
    return Contradiction(np.where(shown_anywhere | left_open, lines, 0.0).astype(np.float32), around)


def _halfway(table: AxisTable, turns: Singles, variance: Singles) -> tuple[Array, Array]:
    """Which pixels (n,) lie about halfway between two orders in any step, and how probable noise makes that."""
    middle = HALF * (table.lines - 1)
    far, chance = np.zeros((2, turns.shape[1]))
    place = np.zeros_like(far)
    for s, (step, error, beat) in enumerate(zip(table.steps, table.step_error, table.step_period, strict=True)):
        away = step @ turns - ((place if s else middle) + HALF) / beat
        away -= np.rint(away)
        place = (place if s else middle) + beat * away
        if s:
            far = np.maximum(far, np.abs(away) > FAR)
            chance += 1 - erf(FAR / np.sqrt(2 * (error @ variance)))
    return far, chance


def widen(sigma: Singles, variance: Singles) -> None:
    """Add a variance (lines²) by tiles of the image to standard deviations (H, W) in lines, in place."""
    more = cv2.resize(variance, sigma.shape[::-1], interpolation=cv2.INTER_NEAREST)
    np.sqrt(sigma * sigma + more, out=sigma)


def refuse_open_orders(
    images: Sequence[Image],
    table: AxisTable,
    limits: Limits,
    image_rows: Rows,
    turns: Singles,
    axis: tuple[Singles, Singles, np.ndarray, Flag],
) -> float:
    """Invalidate, in place, coordinates whose order a contradiction of the periods leaves open; give their share.

    `turns`, (TILES, TILES), are of a `Contradiction`; `axis` has coordinates and sigmas in lines and flags, each (H,
    W), and `Flag.NO_U` or `Flag.NO_V`.
    """
    place, sigma, flags, missing = axis
    height, width = place.shape
    valid, lost = int(np.isfinite(place).sum()), 0
    more = cv2.resize(turns, (width, height), interpolation=cv2.INTER_NEAREST)
    for top in range(0, height, ROWS):
        band = slice(top, min(top + ROWS, height))
        row, column = np.nonzero((more[band] > 0) & np.isfinite(place[band]))
        if len(row) == 0:
            continue
        row += top
        found, phases, variance, _ = _decoded([image[row, column] for image in images], table, limits, image_rows)
        stand = np.empty(len(row), np.bool_)
        orders_stand(table, phases, variance, more[row, column], found, stand)
        row, column = row[~stand], column[~stand]
        invalidate(place, sigma, flags, (row, column), Flag.DISAGREEMENT | missing)
        lost += len(row)
    return lost / max(valid, 1)


def _beyond(medians: Array) -> Array:
    """Variance (lines²) of a difference beyond that by noise, from medians of its square and of that by noise."""
    return np.asarray(np.maximum(medians[1] / MEDIAN_OF_SQUARE - medians[2], 0))


def _decoded(
    shown: Sequence[Image], table: AxisTable, limits: Limits, image_rows: Rows
) -> tuple[Singles, Singles, Singles, NDArray[np.bool_]]:
    """Coordinates (n,), NaN where invalid; their phases (turns) and those' variances (J, n); what is lit."""
    count = shown[0].size
    addresses = np.array([image.ctypes.data for image in shown], np.uint64)
    place, sigma = np.empty((2, 2, count), np.float32)
    flags = np.empty(count, np.uint8)
    out = (place, sigma, *np.empty((2, count), np.float32), flags)
    tables, plain = (table, no_axis()), np.arange(len(shown), dtype=np.int32)
    scratch = scratch_for(tables)
    phases = np.empty((2, len(table.period), count), np.float32)
    for first in range(0, count, TILE):  # of the last tile the phases stay in the scratch memory
        last = min(first + TILE, count)
        decode_pixels(first, last, addresses, shown[0].itemsize, limits, image_rows, plain, tables, scratch, out)
        phases[:, :, first:last] = scratch.phases[:2, :, : last - first]
    return place[0], phases[0], phases[1], flags & int(Flag.LOW_MODULATION | Flag.SATURATED) == 0
