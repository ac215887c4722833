"""Pixels that are the same in every frame, among others that are not: dead lines of a sensor, and what is drawn in."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import listed
from core.model.finding import Finding
from core.numerics import median_of
from core.patterns import Pattern, level_of

DEAD, ALIVE = 0.98, 0.7  # of a line's pixels that never change at least, of those of its neighbours at most
AROUND = 15  # px about a pixel that show what is lit there
LIT = 0.5  # of the pixels around that must change
BRIGHT = 0.15  # of the range, above the pixels around in the darkest frame: what is dark may be without noise
LETTER, TEXT = 8, 40  # pixels that hang together, and of all such: single hot pixels are no text
MOST_NAMED = 4


def unchanging(patterns: Sequence[Pattern], images: Sequence[NDArray]) -> list[Finding]:
    """Find dead lines of the sensor, and text or a logo, in images (H, W) of patterns."""
    same = np.ones(images[0].shape, bool)
    for image in images[1:]:
        same &= image == images[0]
        if not same.any():
            return []
    rows, columns = (_dead(same.mean(axis=axis)) for axis in (1, 0))
    found = []
    for lines, word in ((rows, "row"), (columns, "column")):
        if len(lines):
            which = f"{word}{'s' if len(lines) > 1 else ''} {listed(lines.tolist(), MOST_NAMED)}"
            text = (
                f"the same grey values are in {which} of the image in every frame, and not beside: dead lines of the "
                "sensor; have the camera correct its defects, and record again"
            )
            found.append(Finding("sensor", "warning", text, {"lines": float(len(lines))}))
    same[rows], same[:, columns] = False, False
    return [*found, *_drawn(patterns, images, same)]


def _dead(share: NDArray[np.float64]) -> NDArray[np.intp]:
    """Lines, one or two together, by the share of their pixels that never change, between others that do."""
    alive = np.pad(share < ALIVE, 2)
    before, behind = alive[:-4] | alive[1:-3], alive[3:-1] | alive[4:]
    return np.flatnonzero((share > DEAD) & before & behind)


def _drawn(patterns: Sequence[Pattern], images: Sequence[NDArray], same: NDArray[np.bool_]) -> list[Finding]:
    if np.count_nonzero(same) < TEXT:
        return []
    full = float(max(image.max() for image in images))
    if not any(level_of(p) == 0 for p in patterns):
        same = same & (images[0] < full)  # gloss may saturate in all frames
    dark = min(images, key=lambda image: float(image[::8, ::8].mean())).astype(np.float32)
    box = (2 * AROUND + 1, 2 * AROUND + 1)
    changing = (~same).astype(np.float32)
    share = cv2.blur(changing, box)
    above = dark - cv2.blur(dark * changing, box) / np.maximum(share, 1e-6)
    mask = same & (share > LIT) & (above > BRIGHT * full)
    stats = cv2.connectedComponentsWithStats(mask.astype(np.uint8))[2]
    large = stats[1:, cv2.CC_STAT_AREA] >= LETTER
    count = int(stats[1:, cv2.CC_STAT_AREA][large].sum())
    if count < TEXT:
        return []
    row, column = (median_of(at) for at in np.nonzero(mask))
    text = (
        f"{count} pixels about column {column:.0f}, row {row:.0f} are bright and the same in every frame: text or a "
        "logo is drawn into the frames; switch it off, and record again"
    )
    return [Finding("drawn", "warning", text, {"pixels": float(count)})]
