"""Everything in the image that could be a dot: local contrast, threshold, connected components.

Works on an image reduced until the smallest dots may be four pixels wide: identification needs no more, and the
centroid is taken in the full image later.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array
from core.numerics import median_of

SMALLEST_PX = 4.0  # diameter to which the smallest dots may be reduced


@dataclass(frozen=True)
class Blobs:
    """Bright spots; one row per spot, in pixels of the full image."""

    uv: Array  # (n, 2) grey-weighted centre
    area_px: Array  # (n,)
    cov_px2: Array  # (n, 2, 2) second moments of the spot's area
    contrast: Array  # (n,) brightest value above the background
    on_border: NDArray[np.bool_]  # (n,) reaches the image border


def find_blobs(image: NDArray[np.float32], diameters_px: tuple[float, float], clicks_uv: Array) -> Blobs:
    """Find bright spots no larger than the dots, whose least and greatest diameter (along any direction) are given.

    At the clicks, (k, 2), are dots for certain: their contrast sets what is too faint to be one.
    """
    factor = int(np.clip(diameters_px[0] / SMALLEST_PX, 1, 16))
    small = _reduced(image, factor)
    size = diameters_px[1] / factor
    # the opening is the background: nothing wider than the kernel stands out from it
    contrast = small - cv2.morphologyEx(small, cv2.MORPH_OPEN, _square(1.5 * size + 2))
    threshold = np.float32(0.5) * cv2.dilate(contrast, _square(size))
    at = np.clip(np.rint((clicks_uv + 0.5) / factor - 0.5), 0, np.array(small.shape)[::-1] - 1).astype(int)
    reach = int(np.ceil(size / 2)) + 1
    typical = np.median(
        [contrast[max(v - reach, 0) : v + reach + 1, max(u - reach, 0) : u + reach + 1].max() for u, v in at]
    )
    faintest = max(0.1 * float(typical), 2.0 * median_of(contrast[::3, ::3]), 1e-6)
    return connected_spots(contrast > np.maximum(threshold, np.float32(faintest)), contrast, factor)


def _reduced(image: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Means over factor × factor pixels; a light smoothing where nothing is reduced, against single noisy pixels."""
    if factor == 1:
        return np.asarray(cv2.GaussianBlur(image, (3, 3), 0.6))
    height, width = image.shape
    bottom, right = -height % factor, -width % factor
    if bottom or right:
        image = np.asarray(cv2.copyMakeBorder(image, 0, bottom, 0, right, cv2.BORDER_REPLICATE))
    size = (image.shape[1] // factor, image.shape[0] // factor)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def _square(size: float) -> NDArray[np.uint8]:
    k = 2 * int(np.ceil(size / 2)) + 1
    return np.ones((k, k), np.uint8)


def connected_spots(mask: NDArray[np.bool_], contrast: NDArray[np.float32], factor: int) -> Blobs:
    """Moments of the connected parts of a mask."""
    # without the library's statistics, which cost six times as much as the labels
    count, labels = cv2.connectedComponents(mask.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    at = np.flatnonzero(mask)
    v, u = np.divmod(at, mask.shape[1])
    label = labels.ravel()[at].astype(np.int64)
    weight = contrast.ravel()[at].astype(np.float64)
    area = np.bincount(label, minlength=count).astype(np.float64)
    area[0] = 1.0
    total = np.maximum(np.bincount(label, weight, minlength=count), 1e-12)
    cu = np.bincount(label, weight * u, minlength=count) / total
    cv = np.bincount(label, weight * v, minlength=count) / total
    du, dv = u - cu[label], v - cv[label]
    suu = np.bincount(label, du * du, minlength=count) / area + 1 / 12
    svv = np.bincount(label, dv * dv, minlength=count) / area + 1 / 12
    suv = np.bincount(label, du * dv, minlength=count) / area
    peak = np.zeros(count)
    np.maximum.at(peak, label, weight)
    border = np.zeros(count, bool)
    for line in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        border[line] = True
    cov = np.stack([np.stack([suu, suv], axis=1), np.stack([suv, svv], axis=1)], axis=1)
    centre = (np.stack([cu, cv], axis=1) + 0.5) * factor - 0.5
    return Blobs(centre[1:], area[1:] * factor**2, cov[1:] * factor**2, peak[1:], border[1:])
