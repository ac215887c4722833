"""Cameras whose neighbouring pixels are not alike and independent: colour filters, as they are or interpolated.

A raw image of a colour camera is a mosaic of pixels of unlike gain, in squares of two by two. Interpolated to colours,
and these to grey, the noise of neighbours is alike: differences between them show little of it, and a centroid, which
sums over many, has more than so many independent pixels would leave it. Smoothing and compression do the same.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from core.measure.centres.rays import Rays
from core.model import Array, Floats
from core.numerics import median_of, quantum, spaced

UNLIKE = 0.005  # of their gain, by which pixels of a mosaic differ at least
BLOCKS = 2, 4  # px: sides of blocks whose sums tell the noise; even, so that a mosaic's pixels count alike
LEAST, MANY = 30, 1000  # independent blocks that tell it; that tell it to a tenth
SHOWN = 3.0  # standard deviations by which noise must be alike to count
ROUNDED = 0.25  # of a step's square, noise of which is mostly rounding, that goes on over many pixels
ENOUGH = 200_000, 1_000_000  # pixels that tell gains, and noise
BAND = 16  # rows of each part of an image that has more
ODD = 1.15  # times the least variance of differences beyond which pixels are unlike: interpolated 1.3 to 1.45
# px·sqrt(px) and per px²: what 6 to 22 px dots of blurs from 0.3 to 1.2 px, free of noise, lose to interpolation of
# colours, bilinear or along edges; these widen edges by 0.27 and 0.38 px², and a pixel's own square by 1 / 12
LATTICE, INTERPOLATED, PIXEL = (0.085, 3.0), 0.3, 1 / 12


def balanced(image: Floats) -> Floats:
    """The image (H, W) with pixels of equal gain, if those of a mosaic of two by two have unlike ones.

    Binomial smoothing weighs all four alike, so that the ratios to it are the gains wherever the image is smooth. Those
    of its dark half must show the same: dots on an even raster have their edges on pixels of one kind.
    """
    smooth = cv2.GaussianBlur(image, (3, 3), 0, borderType=cv2.BORDER_REFLECT_101)  # weights 1 2 1
    lit = smooth > image.mean()
    gain, of_ground = _gains(image, smooth, lit), _gains(image, smooth, ~lit & (smooth > 0))
    if np.ptp(gain) < UNLIKE or gain.min() <= 0 or np.abs(gain - of_ground).max() > np.ptp(gain) / 2:
        return image
    even = image.copy()
    for i, j in np.ndindex(2, 2):
        even[i::2, j::2] /= gain[i, j]
    return even


def _gains(image: Floats, smooth: NDArray[Any], of: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Medians of the ratios to the smooth image of the pixels in use, by their place in squares of two by two."""
    gain, apart = np.ones((2, 2), np.float32), 2 * max(1, image.size // ENOUGH[0])
    for i, j in np.ndindex(2, 2):
        at = (slice(i, None, apart), slice(j, None, 2))
        if (known := of[at]).any():
            gain[i, j] = median_of(image[at][known] / smooth[at][known])
    return gain


class Grain(NamedTuple):
    """How many times the variance that neighbours' differences show the one is that sums over many pixels have.

    `ground` is of the ground between dots, `slope` of what it grows by up to their middles; both are 1 where noise is
    not shown to be alike. `every_other` tells that pixels of odd and even number show unlike noise then: some were
    interpolated from others, two pixels apart.
    """

    ground: float = 1.0
    slope: float = 1.0
    every_other: bool = False


PLAIN = Grain()


def grain(image: Floats, rays: Rays, window: Array, even: Array) -> Grain:
    """Of the ground between dots, whose windows (m,) in the unit disc are left out, and of their middles of radius
    `even` (m,).

    Of four blocks beside each other, b px wide, the sums of both diagonals differ by noise alone where light falls off
    steadily. As noise reaches a few pixels, ever fewer of a block share theirs with those outside: what is missing
    falls with 1 / b. The middles have room for small blocks alone, which miss as large a part there.
    """
    for some in (_rows(*image.shape), np.arange(len(image))):  # bands tell too little of few small dots
        within = partial(_drawn, image.shape, rays, some)
        part, ground = image[some], within(2 * window) - within(window)
        found = [_of_blocks(part, ground, b) for b in BLOCKS]
        if len(part) == len(image) or min(number for _, number in found) >= MANY:
            break
    if min(number for _, number in found) < LEAST:
        return PLAIN
    (fine, many), (coarse, few) = found
    of_pixels = _of_neighbours(part, ground)
    whole, near = 2 * coarse - fine, float(of_pixels.mean())
    doubt = np.sqrt(8 * coarse**2 / few + 2 * fine**2 / many)
    step = quantum(part) if np.array_equal(part, np.rint(part)) else 0.0
    if near <= ROUNDED * step**2 or whole - near < SHOWN * doubt:
        return PLAIN
    middles = within(even)
    high, number = _of_blocks(part, middles, BLOCKS[0])
    rise = float(_of_neighbours(part, middles).mean()) - near if number >= LEAST else 0.0
    slope = (high - fine) / rise * whole / fine if rise > 0 and high > fine else whole / near
    return Grain(whole / near, slope, bool(of_pixels.max() > ODD * of_pixels.min()))


def of_lattice(found: Grain, diameter: Array, spread: Array) -> Array:
    """Variance (m,), px², that centres of dots of such diameters (m,), px, and edges (m,), px², have without noise,
    as a lattice of every other pixel undersamples them."""
    if not found.every_other:
        return np.zeros(len(diameter))
    error = LATTICE[0] / np.sqrt(diameter) * np.exp(-LATTICE[1] * np.maximum(spread - INTERPOLATED, PIXEL))
    return np.asarray(error**2)


def _of_blocks(image: Floats, use: NDArray[np.uint8], b: int) -> tuple[float, float]:
    """Variance a pixel in sums of blocks, where all four are in use; how many are independent."""
    sums = cv2.boxFilter(image, cv2.CV_32F, (b, b), anchor=(0, 0), normalize=False)
    twist = sums[:-b, :-b] - sums[b:, :-b] - sums[:-b, b:] + sums[b:, b:]
    whole = cv2.erode(use, np.ones((2 * b, 2 * b), np.uint8), anchor=(0, 0))[:-b, :-b].view(np.bool_)
    whole[twist.shape[0] - b + 1 :], whole[:, twist.shape[1] - b + 1 :] = False, False  # reach beyond the image
    some = twist[whole]
    return clipped_variance(some) / (4 * b * b) if len(some) else 0.0, len(some) / (b * b)


def _of_neighbours(image: Floats, use: NDArray[np.uint8]) -> Array:
    """Variances of a pixel by second differences along rows of those in use: of even and odd rows and columns (4,)."""
    second = image[:, :-2] - 2 * image[:, 1:-1] + image[:, 2:]
    some = (use[:, :-2] & use[:, 1:-1] & use[:, 2:]) == 1
    parts = [(slice(i, None, 2), slice(j, None, 2)) for i, j in np.ndindex(2, 2)]
    return np.array([clipped_variance(second[part][some[part]]) / 6 if some[part].any() else 0.0 for part in parts])


def _rows(height: int, width: int) -> NDArray[np.intp]:
    """Numbers of rows that tell the noise: all, or bands of them, each from an even row on."""
    bands = max(ENOUGH[1] // (width * BAND), 1)
    if 2 * BAND * bands > height:
        return np.arange(height)
    return np.asarray(spaced(height - BAND, bands)[:, None] // 2 * 2 + np.arange(BAND)).ravel()


def _drawn(shape: tuple[int, ...], rays: Rays, rows: NDArray[np.intp], radius: Array) -> NDArray[np.uint8]:
    """1 within so large ellipses (m,), in the unit disc, of dots, else 0; some rows of an image, parted by zeros."""
    drawn = np.zeros(shape, np.uint8)
    left, size, _ = np.linalg.svd(np.nan_to_num(rays.ellipse))
    axes, angle = 2 * radius[:, None] * size, np.degrees(np.arctan2(left[:, 1, 0], left[:, 0, 0]))
    known = np.isfinite(rays.centre).all(axis=1) & np.isfinite(axes).all(axis=1) & (axes.min(axis=1) > 0)
    for box in zip(rays.centre[known].tolist(), axes[known].tolist(), angle[known].tolist(), strict=True):
        cv2.ellipse(drawn, box, 1, cv2.FILLED)
    found = drawn[rows]
    if len(rows) < len(drawn):
        found[BAND - 1 :: BAND] = 0
    return found


def clipped_variance(values: Array | Floats) -> float:
    """Mean square about the median, without what lies beyond three standard deviations."""
    square = (values - median_of(values)) ** 2
    spread = 2.2 * median_of(square)  # the median of a squared Gaussian is 0.455 of its variance
    for _ in range(3):  # the median of whole numbers is coarse: go on with means
        spread = float(np.mean(square[square <= 9 * spread + 1e-12])) / 0.973
    return spread
