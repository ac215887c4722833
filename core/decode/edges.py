"""Gray code alone: how surely its edges tell the place, by how many pixels about one see a bit blurred."""

from __future__ import annotations

import cv2
import numpy as np

from core.decode.tables import Limits, Singles

AROUND = (15, 15)  # px
LEAST_REACH = 0.2  # cells
LEAST_REST = 0.7  # of a cell
NOISY = 10.0  # standard deviations of the noise: of less contrast a bit is unsure for the noise, wherever it is


def sigma_of_edges(
    place: Singles, sigma: Singles, cell: float, modulation: Singles, image: Singles, limits: Limits
) -> None:
    """Change the standard deviations (H, W), lines, of coordinates that Gray code tells to a cell or two.

    The finest bit changes at every second edge, a coarser one at the others, and is unsure within some reach of it,
    where the coordinate is the edge. A share p of the pixels that see it so means a reach of p cells: all of them where
    the finest bit is not resolved. Beyond the edges the rest of the cell is left. In dim places
    nothing is gained.
    """
    even = cell / np.sqrt(12)
    cells = np.round(sigma / np.float32(even))
    y = (place + np.float32(0.5)) / np.float32(cell)
    known = np.isfinite(place) & (cells <= 2)
    count = np.maximum(cv2.boxFilter(known.astype(np.float32), -1, AROUND, normalize=False), 1)
    told, rest = np.full(sigma.shape, np.nan, np.float32), np.ones(sigma.shape, np.float32)
    for edges in (known & (cells == 2), known & (cells < 2) & (np.abs(y - np.round(y)) < 0.25)):
        share = cv2.boxFilter(edges.astype(np.float32), -1, AROUND, normalize=False) / count
        np.copyto(told, 2 * np.maximum(share, np.float32(LEAST_REACH)), where=edges)
        rest -= share
    told = np.where(np.isnan(told), np.maximum(rest, np.float32(LEAST_REST)), told)
    noise = np.sqrt(np.maximum(limits.dark + limits.shot * image, limits.floor))
    told = np.where(modulation < NOISY * noise, np.maximum(told, 1), told)
    np.copyto(sigma, told * np.float32(even), where=known)
