"""Low-pass of the projector coordinates on a flat plate.

Over a plate the coordinate u is a smooth surface over the image; its pixel noise would otherwise stay in every pixel's
curve for good. A Gaussian alone would bend a sloping map along every border and gap. So a smooth trend is taken off
first, and only the small rest is averaged over the pixels that belong to the plate.
"""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from core.model import Array, Floats
from core.progress import SILENT, Progress

TREND_DEGREES = (1, 2, 4)  # one after the other: the higher ones start from what the lower ones took for the plate
TREND_PIXELS = 10_000  # a subsample that determines 15 coefficients well
TREND_STEPS = 10  # for each degree
ON_PLATE_FACTOR = 6.0  # pixels further from the trend, in units of the rest's spread, are taken for background
ON_PLATE_LINES = (0.5, 3.0)  # but never nearer than the one, and always further than the other
LEAST_PIXELS = 250
LEAST_COVER = 0.5  # share of the Gaussian's weight that must lie on valid pixels


def smooth_maps(maps: Floats, sigma_px: float, *, progress: Progress = SILENT) -> Floats:
    """Smooth the coordinate maps (planes, H, W) of a plate by a Gaussian of standard deviation `sigma_px`.

    Pixels off the plate (far from its trend, or still) stay as they are; gaps, such as dark targets, are filled where
    half of the Gaussian's weight lies on valid pixels. With `sigma_px` 0 the maps themselves are returned.
    """
    if sigma_px <= 0:
        return maps
    smoothed = np.empty(maps.shape, np.float32)
    moving = _moving(maps)
    for i in progress.over(range(len(maps)), "smoothing plane {}"):
        smoothed[i] = _smooth(maps[i], moving, sigma_px)
    return smoothed


def _moving(maps: Floats) -> NDArray[np.bool_]:
    """Whether a pixel's coordinate only rises or only falls from plane to plane: a still background does neither."""
    rises = np.zeros(maps.shape[1:], np.bool_)
    falls = np.zeros(maps.shape[1:], np.bool_)
    for one, other in pairwise(maps):
        with np.errstate(invalid="ignore"):
            rises |= other > one
            falls |= other < one
    return rises ^ falls


def _smooth(measured: Floats, moving: NDArray[np.bool_], sigma_px: float) -> Floats:
    known = np.isfinite(measured)
    valid = known & moving
    if np.count_nonzero(valid) < LEAST_PIXELS:
        return measured
    trend, spread = _trend(measured, valid)
    rest = np.where(valid, measured - trend, 0).astype(np.float32)
    on_plate = valid & (np.abs(rest) <= np.clip(ON_PLATE_FACTOR * spread, *ON_PLATE_LINES))
    weight = _blur(on_plate.astype(np.float32), sigma_px)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = trend + _blur(np.where(on_plate, rest, 0).astype(np.float32), sigma_px) / weight
    fill = ~known & (weight >= LEAST_COVER)
    return np.where(on_plate | fill, mean, measured).astype(np.float32)


def _blur(image: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_CONSTANT), np.float32)


def _trend(measured: Floats, valid: NDArray[np.bool_]) -> tuple[Floats, float]:
    """Fit a polynomial surface over the image, robustly; the surface (H, W) and the spread of the rest about it."""
    height, width = measured.shape
    x, y = np.linspace(-1, 1, width), np.linspace(-1, 1, height)
    index = np.flatnonzero(valid)
    index = index[:: max(1, len(index) // TREND_PIXELS)]
    px, py = x[index % width], y[index // width]
    values = measured.ravel()[index].astype(np.float64)
    weights = np.ones(len(values))
    for degree in TREND_DEGREES:
        powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
        design = np.stack([px**i * py**j for i, j in powers], axis=1)
        for _ in range(TREND_STEPS):  # least absolute deviations, and what lies far off does not count
            weighted = design * weights[:, None]
            solution = np.linalg.lstsq(weighted.T @ design, weighted.T @ values, rcond=None)[0]
            rest = np.abs(values - design @ solution)
            spread = max(1.4826 * float(np.median(rest)), 1e-6)
            weights = (rest <= ON_PLATE_FACTOR * spread) / np.maximum(rest, 0.1 * spread)
    surface: Array = np.zeros((height, width))
    for (i, j), value in zip(powers, solution, strict=True):
        surface += (value * y**j)[:, None] * x**i
    return surface.astype(np.float32), spread
