"""How far the periods of an axis contradict each other, and what that makes of a coordinate's sigma.

Every period tells the coordinate by itself. By what two differ beyond their noise, both are wrong: through light that
is reflected twice, a response that is not the same everywhere, a lens that blurs unlike the model. It differs from
place to place, so tiles of the image tell it each for themselves. Errors that all periods share stay unseen.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from core.decode.compiled import HALF, TILE
from core.decode.frames import Image
from core.decode.kernel import decode_pixels, scratch_for
from core.decode.noise import MEDIAN_OF_SQUARE
from core.decode.tables import SWEEP, Array, AxisTable, Limits, Rows, Singles, no_axis

TILES = 16  # of the image, in either direction
PIXELS, PART = 128, 0.03  # of a tile that are looked at, or such a part of them
FEWEST = 24  # that tell it; the variance is then known to a third
SHOWN = 1.2  # times what noise alone makes of the median square, from which there is anything to tell


def contradiction(images: Sequence[Image], table: AxisTable, limits: Limits, image_rows: Rows) -> Singles | None:
    """Variance of the coordinate by what the two finest periods contradict each other beyond their noise.

    Parameters
    ----------
    images : sequence of arrays (H, W)
        All frames.
    image_rows : Rows
        The evenly lit image.

    Returns
    -------
    variance : float32 (TILES, TILES), optional
        In lines², of tiles of the image; None where the periods agree, or there is but one.
    """
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
    place, turns, variance = _decoded(shown, table, limits, image_rows)
    period = table.period[:, None]
    apart = period * turns - (place + HALF)
    apart -= period * np.rint(apart / period)
    spread = period**2 * variance
    finest = np.argsort(table.period)[:2]
    square, noise = np.diff(apart[finest], axis=0)[0] ** 2, spread[finest].sum(axis=0)
    weight = 1 / spread / np.sum(1 / spread, axis=0)
    share = np.sum((weight * period) ** 2, axis=0) / np.sum(period[finest] ** 2)  # if all are as wrong, in turns
    seen = np.where(np.isfinite(place), np.array([square / noise, square, noise, share]), np.nan)
    whole = _medians(seen)
    if not whole[0] > SHOWN * MEDIAN_OF_SQUARE:
        return None
    tiles = seen.reshape(4, TILES, down, TILES, across).transpose(0, 1, 3, 2, 4)
    found = np.full((TILES + 2, TILES + 2), np.nan)
    found[1:-1, 1:-1] = _beyond(_medians(tiles.reshape(4, TILES, TILES, -1), FEWEST))
    beside = np.lib.stride_tricks.sliding_window_view(found, (3, 3))
    return np.nan_to_num(_medians(beside.reshape(TILES, TILES, 9)), nan=float(_beyond(whole))).astype(np.float32)


def widen(sigma: Singles, variance: Singles) -> None:
    """Add a variance (lines²) by tiles of the image to standard deviations (H, W) in lines, in place."""
    more = cv2.resize(variance, sigma.shape[::-1], interpolation=cv2.INTER_NEAREST)
    np.sqrt(sigma * sigma + more, out=sigma)


def _beyond(medians: Array) -> Array:
    """Variance (lines²) from medians of squared contradictions, of their variance by noise, and of the share of it."""
    _, square, noise, share = medians
    return np.asarray(np.maximum(square / MEDIAN_OF_SQUARE - noise, 0) * share)


def _medians(values: Array, fewest: int = 1) -> Array:
    """Medians over the last axis of what is no NaN; NaN where that is fewer than some."""
    count = np.isfinite(values).sum(axis=-1, keepdims=True)
    middle = np.take_along_axis(np.sort(values, axis=-1), count // 2 % values.shape[-1], axis=-1)
    return np.asarray(np.where(count < fewest, np.nan, middle)[..., 0])


def _decoded(
    shown: Sequence[Image], table: AxisTable, limits: Limits, image_rows: Rows
) -> tuple[Singles, Singles, Singles]:
    """Coordinates (n,), NaN where invalid, and the phases (turns) they are made of, with their variances (J, n)."""
    count = shown[0].size
    addresses = np.array([image.ctypes.data for image in shown], np.uint64)
    place, sigma = np.empty((2, 2, count), np.float32)
    out = (place, sigma, *np.empty((2, count), np.float32), np.empty(count, np.uint8))
    tables, plain = (table, no_axis()), np.arange(len(shown), dtype=np.int32)
    scratch = scratch_for(tables)
    phases = np.empty((2, len(table.period), count), np.float32)
    for first in range(0, count, TILE):  # of the last tile the phases stay in the scratch memory
        last = min(first + TILE, count)
        decode_pixels(first, last, addresses, shown[0].itemsize, limits, image_rows, plain, tables, scratch, out)
        phases[:, :, first:last] = scratch.phases[:2, :, : last - first]
    return place[0], phases[0], phases[1]
