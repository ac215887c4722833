"""What an adjustment says beyond its tables: coverage of the images, correlations, sigmas of the object points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.model import Adjustment, Array, Ints

CELLS = 12  # of the coverage along the longer side of an image
STRONG = 0.9  # a correlation that ties two parameters together


@dataclass(frozen=True)
class Coverage:
    """Where in a device's image there are points.

    Attributes
    ----------
    name : str
    size : (width, height), px
    uv : array, shape (n, 2)
        Image points of all stations, px.
    counts : array, shape (rows, columns)
        Points in each cell of the image.
    hull : array, shape (k, 2)
        Corners of the points' convex hull, px, closed.
    hull_share : float
        Area of the hull over that of the image.
    """

    name: str
    size: tuple[int, int]
    uv: Array
    counts: Ints
    hull: Array
    hull_share: float

    @property
    def filled(self) -> float:
        """Share of cells with at least one point."""
        return float(np.mean(self.counts > 0))

    def map(self) -> NDArray[np.int32]:
        """The counts as an image of the device's size."""
        width, height = self.size
        rows = (np.arange(height) * self.counts.shape[0]) // height
        columns = (np.arange(width) * self.counts.shape[1]) // width
        return self.counts[np.ix_(rows, columns)].astype(np.int32)


def coverage(adjustment: Adjustment) -> tuple[Coverage, ...]:
    """Count every device's image points over its image; points seen in one coordinate only have no place there."""
    network = adjustment.network
    device_of = np.array(network.station_device)[network.observation_station]
    found = []
    for name, device in network.devices.items():
        uv = network.observation_uv[device_of == name]
        size = device.spec.width, device.spec.height
        found.append(covered(name, size, uv[np.isfinite(uv).all(axis=1)]))
    return tuple(found)


def covered(name: str, size: tuple[int, int], uv: Array) -> Coverage:
    """Count points, shape (n, 2) in px, over an image of a size."""
    width, height = size
    cell = max(size) / CELLS
    shape = max(1, round(height / cell)), max(1, round(width / cell))
    edges = [np.linspace(-0.5, side - 0.5, n + 1) for side, n in zip((height, width), shape, strict=True)]
    counts = np.histogram2d(uv[:, 1], uv[:, 0], edges)[0].astype(np.int64)
    hull = convex_hull(uv)
    x, y = hull.T
    area = abs(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))) / 2  # the shoelace formula
    return Coverage(name, size, uv, counts, hull, area / (width * height))


def convex_hull(points: Array) -> Array:
    """Give the convex hull of points, shape (n, 2), as a closed line; points on one line have no area.

    Andrew, *Another efficient algorithm for convex hulls in two dimensions*, Inf. Proc. Letters 9, 1979.

    Examples
    --------
    >>> convex_hull(np.array([[0, 0], [2, 0], [1, 1], [2, 2], [0, 2]])).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]]
    """
    ordered = [(float(x), float(y)) for x, y in np.unique(points, axis=0)]
    if len(ordered) < 3:
        return np.array([*ordered, *ordered[:1]]).reshape(-1, 2)
    half: list[list[tuple[float, float]]] = []
    for run in (ordered, ordered[::-1]):
        line: list[tuple[float, float]] = []
        for p in run:
            while len(line) > 1 and _turn(line[-2], line[-1], p) <= 0:
                line.pop()
            line.append(p)
        half.append(line[:-1])
    return np.array([*half[0], *half[1], half[0][0]])


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


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
    free = np.flatnonzero(variance > 0)
    sigma = np.sqrt(variance[free])
    values = covariance[np.ix_(free, free)] / np.outer(sigma, sigma)
    return Correlations(tuple(adjustment.parameter_names[i] for i in free), values)


@dataclass(frozen=True)
class PointSigmas:
    """Sigmas of the object points.

    Attributes
    ----------
    names : tuple of str
    xyz_mm : array, shape (n, 3)
    sigma_um : array, shape (n, 3)
        Along X, Y and Z of the testfield.
    images : array, shape (n,)
        In how many images each was seen.
    """

    names: tuple[str, ...]
    xyz_mm: Array
    sigma_um: Array
    images: Ints

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
