"""The rim of the projected field, where the fringes end.

Blur carries light of the last lines beyond the projector's edge, but none comes back from there: the fringe is cut
and its phase wrong by up to a line. Seen alone such a pixel looks sound; it betrays itself by the darkness beside it.
"""

from __future__ import annotations

import cv2
import numpy as np

from core.decode.options import Flag, invalidate
from core.decode.tables import Singles
from core.numerics import median_of

FARTHEST = 48  # px
LAST = 1.0  # lines: so near the field's edge the darkness may begin where the image ends


def drop_rim(u: Singles, sigma: Singles, flags: np.ndarray, lines: float, width: float, missing: Flag) -> None:
    """Invalidate, in place, the coordinates of the last lines of a field whose edge is in the image.

    `u` and `sigma`, (H, W) lines, are of one axis of so many `lines`, `width` that of the rim, `missing` `Flag.NO_U` or
    `Flag.NO_V`.
    """
    rim = np.flatnonzero((u < width - 0.5) | (u > lines - 0.5 - width))
    if len(rim) == 0:
        return
    row, column = np.unravel_index(rim, u.shape)
    here = u[row, column]
    across = np.abs(here - u[row, np.maximum(column - 1, 0)])
    down = np.abs(here - u[np.maximum(row - 1, 0), column])
    slopes = [median_of(known) for step in (across, down) if len(known := step[np.isfinite(step)])]
    slope = max(sum(slopes), 1e-3)
    reach = int(min(FARTHEST, np.ceil(2 * width / slope) + 1))
    beside = cv2.dilate(flags & int(Flag.LOW_MODULATION), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    last = np.minimum(here + 0.5, lines - 0.5 - here) < LAST
    aside = np.min([row, u.shape[0] - 1 - row, column, u.shape[1] - 1 - column], axis=0)
    lost = (beside[row, column] > 0) | (last & (aside < min(FARTHEST, 2 * LAST / slope + 1)))
    invalidate(u, sigma, flags, (row[lost], column[lost]), Flag.OUTSIDE | missing)
