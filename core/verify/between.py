"""What changed between the frames of columns and those of rows: the light, or the place of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from core.model import Plan
from core.model.finding import Finding
from core.numerics import median_of, quantile_of
from core.patterns import axis_of

Array = NDArray[np.float32]

MOVED_PX = 0.5
UNLIKE = 0.7  # of the difference that putting back what moved leaves; of bare boards at rest 0.79 and more, by 300
MOVED_RESPONSE = 0.45  # of the correlation's peak: bare boards show 0.35 by chance, what moved 0.55 and more
DRIFT = 0.15


def halves(plan: Plan, images: Sequence[NDArray]) -> list[Finding]:
    """The steps of each axis add up to an evenly lit image: compare these, taken at different times."""
    even = []
    for axis in ("x", "y"):
        steps = [i for i, p in enumerate(plan.shots) if axis_of(p) == axis and hasattr(p, "steps")]
        if not steps:
            continue
        first = plan.shots[steps[0]]
        same = [i for i in steps if getattr(plan.shots[i], "period", 0) == getattr(first, "period", 0)]
        if len(same) == getattr(first, "steps", 0) >= 4:
            even.append(_mean([images[i] for i in same]))
    if len(even) < 2:
        return []
    side = int(np.clip(min(even[0].shape) // 64 * 64, 64, 512))  # OpenCV is half a pixel off at odd sizes
    both = cv2.resize(cv2.merge(even), (side, side), interpolation=cv2.INTER_AREA)  # at once: a third less time
    a, b = (np.asarray(each, np.float32) for each in cv2.split(both))
    few = [each.ravel()[::17] for each in (a, b)]  # which meets every column
    lit = few[0] > 0.1 * quantile_of(a[::4, ::4], 0.98)
    gain = median_of(few[1][lit]) / max(median_of(few[0][lit]), 1e-9)
    if abs(gain - 1) > DRIFT:
        text = f"the light changed by {gain - 1:+.0%} between the steps of columns and of rows: warm the lamp up"
        return [Finding("lamp", "warning", text, {"drift": gain - 1})]
    one, other, window = _texture(a), _texture(b), _window(side)
    shift, response = cv2.phaseCorrelate(one, other, window)
    moved = float(np.hypot(*np.multiply(shift, images[0].shape[::-1]))) / side
    if moved <= MOVED_PX or response <= MOVED_RESPONSE:
        return []
    back = np.array([[1, 0, -shift[0]], [0, 1, -shift[1]]])
    beside = cv2.warpAffine(other, back, (side, side), borderMode=cv2.BORDER_REPLICATE)
    if np.sum(window * (one - beside) ** 2) < UNLIKE * np.sum(window * (one - other) ** 2):
        text = f"the scene moved by {moved:.1f} px between the frames of columns and of rows: fasten all, record again"
        return [Finding("movement", "bad", text, {"shift_px": moved, "response": float(response)})]
    return []


@cache
def _window(side: int) -> Array:
    """Let an image fade out to its edges."""
    return np.asarray(cv2.createHanningWindow((side, side), cv2.CV_32F), np.float32)


def _texture(image: Array) -> Array:
    """What stands out of the light, over the light."""
    light = cv2.blur(cv2.blur(image, (15, 15)), (15, 15)) + 0.05 * float(image.max()) + 1e-6
    return np.asarray(np.clip((image - light) / light, -0.5, 0.5), np.float32)


def _mean(images: Sequence[NDArray]) -> Array:
    thin = max(1, min(images[0].shape) // 500)
    short = images[0].dtype == np.uint8 and len(images) <= 257  # whose sums 16 bits hold
    summed = images[0][::thin, ::thin].astype(np.uint16 if short else np.float32)
    for image in images[1:]:
        np.add(summed, image[::thin, ::thin], out=summed)
    return summed.astype(np.float32) / np.float32(len(images))
