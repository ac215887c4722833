"""What compression with losses (JPEG) does to phases, told by how rough coordinates are.

What it leaves of stripes in a block of pixels is bent, in all steps alike: nothing that should be noise shows it.
"""

from __future__ import annotations

import numpy as np

from core.decode.noise import MEDIAN_OF_SQUARE
from core.decode.pairs import FEWEST, TILES, median_around
from core.decode.tables import Singles
from core.numerics import median_of

APART = 4  # px between coordinates whose fourth differences show how rough they are: errors within a block are alike
FOURTH = np.array([1, -4, 6, -4, 1], np.float32)
STEP = 16.0  # times what is usual, squares from which a surface is seen to step: errors within cells have up to 11
EVERY = 3  # so manieth row or column tells it
COMPRESSED = (
    "The frames were compressed with losses (JPEG), which shifts coordinates: sigma holds most of that, by how rough "
    "they are. Save frames as they are, as PNG or TIFF."
)


def roughness(place: Singles, sigma: Singles, apart: int = APART, bounded: bool = False) -> Singles:
    """By what variance (lines²) coordinates (H, W) so many pixels apart are rougher than their sigmas, in tiles.

    Across the stripes, along which blocks err alike; and no more than in most tiles beside, as surfaces, too, bend.
    Errors that are `bounded`, as within cells, are not those whose median tells their mean square.
    """
    some = place[::EVERY, ::EVERY]
    if median_of(np.abs(np.diff(some, axis=0))) > median_of(np.abs(np.diff(some, axis=1))):
        return np.ascontiguousarray(roughness(place.T, sigma.T, apart, bounded).T)
    place, square = place[::EVERY], np.square(sigma[::EVERY])
    bend, expected = np.full((2, *place.shape), np.nan, np.float32)
    count = place.shape[1] - 4 * apart
    parts = [slice(k * apart, k * apart + count) for k in range(len(FOURTH))]
    if count > 0:
        bend[:, parts[2]] = sum(factor * place[:, part] for factor, part in zip(FOURTH, parts, strict=True))
        expected[:, parts[2]] = sum(factor**2 * square[:, part] for factor, part in zip(FOURTH, parts, strict=True))
    beyond = np.square(bend) / np.float32(MEDIAN_OF_SQUARE)
    rows, columns = (np.linspace(0, size, TILES + 1).astype(int) for size in bend.shape)
    found = np.full((TILES, TILES), np.nan)
    for i, j in np.ndindex(TILES, TILES):
        at = slice(rows[i], rows[i + 1]), slice(columns[j], columns[j + 1])
        known = np.isfinite(bend[at])
        if np.count_nonzero(known) >= FEWEST:
            seen, usual = median_of(beyond[at][known]), median_of(expected[at][known])
            if bounded:
                square = np.square(bend[at][known])
                seen = float(square[square < STEP * max(seen, usual)].mean())
            found[i, j] = seen - usual
    return np.maximum(np.nan_to_num(median_around(found / np.sum(np.square(FOURTH)))), 0).astype(np.float32)
