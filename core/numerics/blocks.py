"""Whether images were compressed with losses, in blocks of pixels as JPEG makes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

BLOCK, BLOCKS = 8, 20  # px of a JPEG's blocks along a side; fewer of them tell nothing
AT_EDGES = 0.35  # of them differ most at an edge, by chance an eighth; of 20 along both sides once in 70,000 captures


def compressed_in_blocks(images: Sequence[NDArray[Any]]) -> bool:
    """Neighbours differ most at the edges of blocks, all over an image, along both sides; best seen in even light."""
    return any(min(_at_edges(image, axis) for axis in (0, 1)) > AT_EDGES for image in images)


def _at_edges(image: NDArray[Any], axis: int) -> float:
    """Part of the blocks along an axis in whose rows or columns neighbours differ most at an edge."""
    if image.shape[axis] <= BLOCKS * BLOCK + BLOCK // 2:
        return 0.0
    apart = cv2.absdiff(image[1:], image[:-1]) if axis == 0 else cv2.absdiff(image[:, 1:], image[:, :-1])
    off = cv2.reduce(apart, 1 - axis, cv2.REDUCE_AVG, dtype=cv2.CV_32F).ravel()
    blocks = off[BLOCK // 2 :][: (len(off) - BLOCK // 2) // BLOCK * BLOCK].reshape(-1, BLOCK)
    return float(np.mean(blocks.argmax(axis=1) == BLOCK // 2 - 1))
