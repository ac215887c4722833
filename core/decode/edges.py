"""Gray code alone: how surely its edges tell the place, by how many pixels about one see a bit blurred."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.tables import Limits, Singles

AROUND = (15, 15)  # px
LEAST_REACH = 0.2  # cells
LEAST_REST = 0.7  # of a cell
NOISY = 10.0  # standard deviations of the noise: of less contrast a bit is unsure for the noise, wherever it is
FEW = 0.5  # part of the pixels about a dim one that tell a cell or two


def sigma_of_edges(
    place: Singles, sigma: Singles, cell: float, modulation: Singles, image: Singles, limits: Limits
) -> None:
    """Change the standard deviations (H, W), lines, of coordinates that Gray code tells to a cell or two.

    The finest bit changes at every second edge, a coarser one at the others, and is unsure within some reach of it,
    where the coordinate is the edge. A share p of the pixels that see it so means a reach of p cells: all of them where
    the finest bit is not resolved. Beyond the edges the rest of the cell is left. In dim places nothing is gained, and
    a bit may look sure by chance: where few about a pixel tell as much, it claims no more than they.
    """

    def sums(values: NDArray[Any]) -> NDArray[np.float32]:
        plain = values.view(np.uint8) if values.dtype == bool else values.astype(np.float32)
        return np.asarray(cv2.boxFilter(plain, cv2.CV_32F, AROUND, normalize=False))

    even = cell / np.sqrt(12)
    cells = np.round(sigma / np.float32(even))
    y = (place + np.float32(0.5)) / np.float32(cell)
    finite = np.isfinite(place)
    known = finite & (cells <= 2)
    told, rest = np.full(sigma.shape, np.nan, np.float32), np.ones(sigma.shape, np.float32)
    near, number = np.abs(y - np.round(y)) < 0.25, sums(known)
    for edges in (known & (cells == 2), known & (cells < 2) & near):
        share = sums(edges) / np.maximum(number, 1)
        np.copyto(told, 2 * np.maximum(share, np.float32(LEAST_REACH)), where=edges)
        rest -= share
    told = np.where(np.isnan(told), np.maximum(rest, np.float32(LEAST_REST)), told)
    dim = modulation < NOISY * np.sqrt(limits.variance(image))
    if dim.any():
        every = np.maximum(sums(finite), 1)
        around = np.where(number / every < FEW, np.sqrt(sums(np.where(finite, cells, 0) ** 2) / every), 1)
        told = np.where(dim, np.maximum(told, around), told)
    np.copyto(sigma, told * np.float32(even), where=known)
