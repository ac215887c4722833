"""What an adjustment says beyond its tables: coverage of the images, correlations, sigmas of the object points."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Adjustment, Array, Ints

CELLS = 12  # of the coverage along the longer side of an image
STRONG = 0.9  # a correlation that ties two parameters together


@dataclass(frozen=True)
class Coverage:
    """Where in a device's image there are points."""

    name: str
    size: tuple[int, int]  #: (width, height), px
    uv: Array  #: (n, 2): image points of all stations, px
    counts: Ints  #: (rows, columns): points in each cell of the image
    hull: Array  #: (k, 2): corners of the points' convex hull, px, closed
    hull_share: float  #: area of the hull over that of the image

    @property
    def filled(self) -> float:
        """Share of cells with at least one point."""
        return float(np.mean(self.counts > 0))

    def map(self) -> NDArray[np.int32]:
        """The counts as an image of the device's size."""
        return image_of_cells(self.counts, self.size).astype(np.int32)


def image_of_cells(cells: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Give every pixel of an image of a size (width, height) the value of its cell, of shape (rows, columns)."""
    rows, columns = (np.arange(n) * k // n for n, k in zip(reversed(size), cells.shape, strict=True))
    return cells[np.ix_(rows, columns)]


def coverage(adjustment: Adjustment) -> tuple[Coverage, ...]:
    """Count every device's image points over its image; points seen in one coordinate only have no place there."""
    network = adjustment.network
    found = []
    for name, own in network.made_by.items():
        uv, spec = network.observation_uv[own], network.devices[name].spec
        size = spec.width, spec.height
        found.append(covered(name, size, uv[np.isfinite(uv).all(axis=1)]))
    return tuple(found)


def covered(name: str, size: tuple[int, int], uv: Array) -> Coverage:
    """Count points, shape (n, 2) in px, over an image of a size."""
    width, height = size
    cell = max(size) / CELLS
    shape = max(1, round(height / cell)), max(1, round(width / cell))
    edges = [np.linspace(-0.5, side - 0.5, n + 1) for side, n in zip((height, width), shape, strict=True)]
    counts = np.histogram2d(uv[:, 1], uv[:, 0], edges)[0].astype(np.int64)
    hull = cv2.convexHull(uv.astype(np.float32))[:, 0].astype(np.float64) if len(uv) else np.zeros((0, 2))
    area = cv2.contourArea(hull.astype(np.float32)) if len(hull) else 0.0
    return Coverage(name, size, uv, counts, np.concatenate([hull, hull[:1]]), area / (width * height))


@dataclass(frozen=True)
class Correlations:
    """Correlation coefficients of the estimated parameters, shape (n, n), with their names and sigmas."""

    names: tuple[str, ...]
    values: Array

    def describe(self, i: int, j: int) -> str:
        """Name a pair and its correlation."""
        if i == j:
            return self.names[i]
        return f"{self.names[i]}, {self.names[j]}: {self.values[i, j]:+.3f}"

    def strongest(self, count: int = 8) -> list[tuple[str, str, float]]:
        """Give the pairs of different parameters that are tied most, the strongest first."""
        i, j = np.triu_indices(len(self.names), 1)
        order = np.argsort(-np.abs(self.values[i, j]))[:count]
        return [(self.names[i[k]], self.names[j[k]], float(self.values[i[k], j[k]])) for k in order]


def correlations(adjustment: Adjustment) -> Correlations:
    """Correlate the parameters; those that were held have no sigma and are left out."""
    covariance = np.asarray(adjustment.parameter_cov, dtype=np.float64)
    variance = np.diagonal(covariance)
    free = np.flatnonzero(np.isfinite(variance) & (variance > 0))
    sigma = np.sqrt(variance[free])
    values = covariance[np.ix_(free, free)] / np.outer(sigma, sigma)
    return Correlations(tuple(adjustment.parameter_names[i] for i in free), values)


@dataclass(frozen=True)
class PointSigmas:
    """Sigmas of the object points."""

    names: tuple[str, ...]
    xyz_mm: Array  #: (n, 3)
    sigma_um: Array  #: (n, 3): along X, Y and Z of the testfield
    images: Ints  #: (n,): in how many images each was seen

    def of(self, axis: str) -> Array:
        """Give the sigma along "X", "Y" or "Z", or for "XYZ" the root of the sum of their squares, µm, shape (n,)."""
        return np.asarray(np.sqrt(np.sum(self.sigma_um[:, ["XYZ".index(a) for a in axis]] ** 2, axis=1)))


def point_sigmas(adjustment: Adjustment) -> PointSigmas:
    """Gather the sigmas of an adjustment's points."""
    variance = np.diagonal(adjustment.point_cov_mm2, axis1=1, axis2=2)
    count = len(adjustment.points_mm)
    return PointSigmas(
        adjustment.network.point_names,
        adjustment.points_mm,
        1e3 * np.sqrt(variance),
        np.bincount(adjustment.network.observation_point, minlength=count),
    )
