"""Low-pass of the projector coordinates on a flat plate.

Over a plate the coordinate u is a smooth surface over the image; its pixel noise would otherwise stay in every pixel's
curve for good. A Gaussian alone would bend a sloping map along every border and gap. So a smooth trend is taken off
first, and only the small rest is averaged over the pixels that show the undisturbed plate: not those on the rim of a
target or of the lit field, where one pixel mixes two brightnesses and its coordinate is drawn to the brighter one. Each
counts by its own variance: white dots on a black board tell ten times as sharply as the board between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from core.model import Floats
from core.numerics import exponents, polynomial, quantile_of, sigma_by_median
from core.parallel import run_in_bands
from core.progress import SILENT, Progress

TREND_DEGREES = (1, 2, 4)  # one after the other: the higher ones start from what the lower ones took for the plate
TREND_PIXELS = 10_000  # a subsample that determines 15 coefficients well
TREND_STEPS = 10  # for each degree
LEAST_VARIANCE = 1e-6  # lines²
LEAST_PIXELS = 250  # with fewer a plane stays as it is
DISTURBED_FACTOR = 5.0  # pixels further from the trend, in units of the rest's spread, do not show the plate alone
DISTURBED_LINES = (0.1, 3.0)  # but never those nearer than the one, and always those further than the other
DISTURBED_SHARE = 0.3  # on a rim the modulation changes by more within the reach below, or by
DISTURBED_TIMES = 3.0  # as many times what it usually does there, light and noise
DISTURBED_RIM_PX = 2  # so far a neighbour's brightness reaches
MOVED = 3.0  # sigmas by which a pixel's coordinate has moved
COVER = 0.5  # share of the Gaussian's weight that must lie on the plate
MOST_LEFT = 0.1  # share of a plate that undisturbed pixels may leave without a value
FILL_FACTOR = 5.0  # width of the Gaussian that fills gaps, in units of the low-pass: targets of a dozen pixels


def smooth_maps(
    maps: Floats, modulations: Sequence[Floats], sigmas: Sequence[Floats], sigma_px: float, progress: Progress = SILENT
) -> tuple[Floats, Floats, Floats]:
    """Smooth a plate's coordinate maps, (planes, H, W) lines, by a Gaussian of `sigma_px`; 0 leaves them alone.

    Gives the smoothed maps, the maps themselves with disturbed pixels NaN, and what the smoothed have left of their
    noise, (H, W) lines², mean of the planes. Gaps and disturbed pixels are filled from around where they are small; at
    the plate's border disturbed pixels are NaN. Pixels far off the plate's trend, or that do not move with it, stay as
    they are.
    """
    smoothed, undisturbed, variance = maps, maps, np.stack(sigmas).astype(np.float32) ** 2
    if sigma_px > 0:
        smoothed, undisturbed = np.empty_like(maps), np.empty_like(maps)
        moving = _moving(maps, variance)

    def smooth(start: int, stop: int) -> None:
        for i in range(start, stop):
            progress.check()
            smoothed[i], undisturbed[i] = maps[i], maps[i]
            lit = np.isfinite(maps[i]) & moving
            if np.count_nonzero(lit) >= LEAST_PIXELS:
                part = tuple(slice(at.min(), at.max() + 1) for at in (np.flatnonzero(lit.any(axis=k)) for k in (1, 0)))
                smoothed[i][part], undisturbed[i][part] = _smooth(
                    maps[i][part], modulations[i][part], variance[i][part], lit[part], sigma_px
                )
            variance[i][np.isnan(smoothed[i])] = np.nan

    if sigma_px > 0:
        progress(0.0, "smoothing planes")
        run_in_bands(smooth, len(maps), least=1)
    known = np.isfinite(variance)
    mean = np.where(known, variance, 0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return smoothed, undisturbed, mean


def _moving(maps: Floats, variance: Floats) -> NDArray[np.bool_]:
    """Whether a pixel's coordinate only rises or only falls, beyond its noise: a still background does neither."""
    rises = np.zeros(maps.shape[1:], np.bool_)
    falls = np.zeros(maps.shape[1:], np.bool_)
    for i, k in pairwise(range(len(maps))):
        with np.errstate(invalid="ignore"):
            step, noise = maps[k] - maps[i], MOVED * np.sqrt(variance[i] + variance[k])
            rises |= step > noise
            falls |= step < -noise
    return rises ^ falls


def _smooth(
    measured: Floats, modulation: Floats, variance: Floats, lit: NDArray[np.bool_], sigma_px: float
) -> tuple[Floats, Floats]:
    """Smooth the part of one plane that is lit; `variance` (H, W) becomes that of what is returned."""
    for even in (lit & _evenly_bright(modulation, lit), lit):
        trend, spread = _trend(measured, even if np.count_nonzero(even) >= LEAST_PIXELS else lit)
        rest = np.where(lit, measured - trend, 0).astype(np.float32)
        near = lit & (np.abs(rest) <= DISTURBED_LINES[1])
        plate = even & (np.abs(rest) <= np.clip(DISTURBED_FACTOR * spread, *DISTURBED_LINES))
        weight = np.where(plate, 1 / np.maximum(variance, LEAST_VARIANCE), 0).astype(np.float32)
        mean, covered, narrow = _average(rest, weight, sigma_px)
        wide, widely, broad = _average(rest, weight, FILL_FACTOR * sigma_px)
        left = near & ~(covered | plate | widely)
        if np.count_nonzero(left) <= MOST_LEFT * np.count_nonzero(near):
            break  # otherwise dots are small and close: all is rim, and its errors average out around each dot
    elsewhere = np.where(near, np.float32(np.nan), measured)  # disturbed, or not the plate at all
    filled = np.where(covered | plate, trend + mean, np.where(widely, trend + wide, elsewhere))
    variance[:] = np.where(covered | plate, narrow, np.where(widely, broad, variance))
    return filled.astype(np.float32), np.where(plate | ~near, measured, np.float32(np.nan))


def _evenly_bright(modulation: Floats, lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether a pixel and its neighbours are about as bright as the plate is around there."""
    counts, size = lit.astype(np.float32), 2 * DISTURBED_RIM_PX + 1
    with np.errstate(invalid="ignore", divide="ignore"):
        level = np.where(lit, np.log(_blur(np.nan_to_num(modulation) * counts, 1.0) / _blur(counts, 1.0)), 0)
    around = [
        op(np.where(lit, level, off), np.ones((size, size))) for op, off in ((cv2.dilate, -9e9), (cv2.erode, 9e9))
    ]
    change = np.where(lit, around[0] - around[1], 0)
    usual = quantile_of(change[lit], 0.25)  # rims may be the half of a board
    return np.asarray(change <= max(DISTURBED_SHARE, DISTURBED_TIMES * usual))


def _average(values: Floats, weight: Floats, sigma_px: float) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Average by a Gaussian and the inverse variances, where enough of it is covered, and the average's variance."""
    counts, total = (weight > 0).astype(np.float32), _blur(weight, sigma_px)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = _blur(values * weight, sigma_px) / total
        squares = _blur(weight, sigma_px / np.sqrt(2)) / np.float32(4 * np.pi * sigma_px**2)
        left = np.minimum(squares / total**2, 1 / weight)
    return mean, _blur(counts, sigma_px) >= COVER, left


def _blur(image: Floats, sigma_px: float) -> Floats:
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
        design = polynomial(px, py, degree)
        for _ in range(TREND_STEPS):  # least absolute deviations, and what lies far off does not count
            weighted = design * weights[:, None]
            solution = np.linalg.lstsq(weighted.T @ design, weighted.T @ values, rcond=None)[0]
            rest = np.abs(values - design @ solution)
            spread = max(sigma_by_median(rest), 1e-6)
            weights = (rest <= DISTURBED_FACTOR * spread) / np.maximum(rest, 0.1 * spread)
    terms, all_powers = np.zeros((degree + 1, degree + 1)), np.arange(degree + 1)
    terms[tuple(np.transpose(exponents(degree)))] = solution
    surface = (y[:, None] ** all_powers) @ terms.T @ (x[:, None] ** all_powers).T
    return surface.astype(np.float32), spread
