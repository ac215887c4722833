"""Pixels spread over the image in pairs: what both of a pair show alike is none of noise."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.tables import Array, Singles
from core.lazy import dataclass
from core.numerics import median_of, row_median

TILES = 16  # of the image, in either direction
PIXELS, PART = 128, 0.03  # of a tile that are looked at, or such a part of them
FEWEST = 24  # of a tile, or pairs around it, that tell anything
BESIDE = 2  # px to another pixel: in the noise of neighbours mosaics and compression may have a share
STEP = 12.0  # times the usual bend of coordinates that makes a step
SOME = 4  # one column, or row, of so many tells what is usual
WINDOW = 5  # tiles across, whose pairs are taken together
STRIDE = 16  # px: so many pixels tell how stripes lie


@dataclass(frozen=True)
class Pairs:
    """Rows and columns of the pixels, as many in every tile; 2 k and 2 k + 1 of those along `axis` are a pair."""

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    axis: int

    @property
    def shape(self) -> tuple[int, int]:
        """Of values of all pixels."""
        return len(self.rows), len(self.columns)

    @property
    def in_tiles(self) -> tuple[int, int, int, int]:
        """Shape of the same by tiles."""
        return TILES, len(self.rows) // TILES, TILES, len(self.columns) // TILES

    def split(self, values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Give values of one and of the other of each pair."""
        grid = values.reshape(self.shape)
        return (grid[::2], grid[1::2]) if self.axis == 0 else (grid[:, ::2], grid[:, 1::2])

    def around(self, values: NDArray[Any]) -> Array:
        """Give sums (TILES, TILES) over the pairs of the tiles around each."""
        down, across = values.shape
        tiles = values.reshape(TILES, down // TILES, TILES, across // TILES).sum(axis=(1, 3), dtype=np.float64)
        size = (WINDOW, WINDOW)
        return np.asarray(cv2.boxFilter(tiles, -1, size, normalize=False, borderType=cv2.BORDER_CONSTANT))


def look_at(place: Singles) -> Pairs:
    """Choose them for coordinates (H, W); pairs lie along the stripes, where light by a second way changes least."""
    size = place.size / TILES**2
    thin = np.sqrt(min(max(PART * size, 2 * FEWEST), PIXELS, size) / size)
    some = place[::STRIDE, ::STRIDE]
    axis = int(median_of(np.abs(np.diff(some, axis=0))) > median_of(np.abs(np.diff(some, axis=1))))
    chosen = []
    for k, n in enumerate(place.shape):
        each = max(1, int(n * thin / TILES / (1 + (k == axis))))
        at = ((np.arange(TILES * each) + 0.5) * n / (TILES * each)).astype(np.intp)
        chosen.append(np.clip(at[:, None] + np.array([-1, BESIDE - 1]), 0, n - 1).ravel() if k == axis else at)
    return Pairs(chosen[0], chosen[1], axis)


def smooth_at(place: Singles, here: Singles, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Tell of the coordinates `here`, at rows and columns, where no step is near: there pixels see two surfaces."""
    height, width = place.shape
    above, below = (place[np.clip(rows + side, 0, height - 1)][:, columns] for side in (-BESIDE, BESIDE))
    left, right = (place[rows][:, np.clip(columns + side, 0, width - 1)] for side in (-BESIDE, BESIDE))
    bend = np.maximum(np.abs(above + below - 2 * here), np.abs(left + right - 2 * here))
    return np.asarray(bend <= STEP * median_of(bend[:, ::SOME]), bool)


def median_around(tiles: Array) -> Array:
    """Of every tile (TILES, TILES) the median of those around it that are known, itself among them; NaN if none is."""
    padded = np.pad(tiles, 1, constant_values=np.nan)
    return row_median(np.lib.stride_tricks.sliding_window_view(padded, (3, 3)).reshape(-1, 9)).reshape(tiles.shape)
