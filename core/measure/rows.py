"""How far single rows of an image are shifted: the line jitter of video, told by the dots that share a row.

The middles of a dot's rows lie on a smooth curve, whatever its tilt, blur and light, and so do the projector
coordinates read in them. What is left of both in a row is noise of its own in every dot, but the same in all dots of
that row where the row as a whole was shifted.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from core.measure.projector import INTERIOR
from core.model import Array, Ints, PhaseMap

CURVE = 3  # terms of the curve: place, lean, and the bow that uneven light and perspective give
LEAST_ROWS = CURVE + 2
LEAST_SHARE = 0.2  # of the widest row's weight: the middles of shorter ones are mostly noise
BIN_PX = 0.25
LEAST_SLOPE = 0.1  # lines per px along the rows: less, and a shift of theirs hardly moves a coordinate
SURE = 3.0  # sigmas above which a shift is taken for one


def row_shifts(
    image: NDArray[np.float32], phase: PhaseMap, uv: Array, ellipse: Array, window: Array, plane: Array
) -> Array:
    """Estimate the covariance (3, 3) of a row's shifts along u: of the image, and of both coordinates read there; px².

    From centroids (m, 2) of bright dots: `ellipse` maps the unit disc to the dot, `window` is the radius in that disc
    of what is weighted, `plane`, (m, 3), the background at the centroid and its slopes. What is not significant is 0.
    """
    shifts = np.zeros((3, 3))
    half = window[:, None] * np.linalg.norm(ellipse, axis=2)
    whole = np.all((np.ceil(uv - half) >= 0) & (np.floor(uv + half) < image.shape[::-1]), axis=1)
    if not np.any(whole):
        return shifts
    uv, half, window = uv[whole], half[whole], window[whole, None, None]
    u, v = _box(uv[:, 0], half[:, 0]), _box(uv[:, 1], half[:, 1])
    du, dv = (u - uv[:, :1])[:, None, :], (v - uv[:, 1:])[:, :, None]
    row = np.minimum(v, image.shape[0] - 1)
    at = row[:, :, None] * image.shape[1] + np.minimum(u, image.shape[1] - 1)[:, None, :]  # by one number: much quicker
    to_disc = np.linalg.inv(ellipse[whole])[..., None, None]
    disc = to_disc[:, :, 0] * du[:, None] + to_disc[:, :, 1] * dv[:, None]
    square = disc[:, 0] ** 2 + disc[:, 1] ** 2
    ground, slope_u, slope_v = plane[whole].T[..., None, None]
    # no grey value is cut off: what a threshold leaves of a row moves less than the row
    light = np.where(square <= window**2, image.take(at) - ground - slope_u * du - slope_v * dv, 0.0)
    curved = partial(_curved, row, dv[..., 0], half[:, 1])
    width, middle = light.sum(axis=2), np.einsum("mvu,mu->mv", light, du[:, 0])
    of_image = curved(width, middle, np.ones(len(uv)))
    shifts[0, 0] = of_image.variance()
    if not shifts[0, 0]:  # nor are the frames of the patterns shifted
        return shifts
    for axis, values, sigma in ((1, phase.u, phase.sigma_u), (2, phase.v, phase.sigma_v)):
        read = values.take(at).astype(np.float64)
        decoded = np.isfinite(read) & (square <= np.minimum(window, INTERIOR) ** 2)
        read = np.where(decoded, read, 0.0)
        w = 1 / np.where(decoded, sigma.take(at), np.inf).astype(np.float64) ** 2  # ** -2 takes ten times as long
        width = w.sum(axis=2)
        with np.errstate(invalid="ignore", divide="ignore"):
            place, mean = ((w * x).sum(axis=2) / width for x in (du, read))
            off, x = read - mean[..., None], w * (du - place[..., None])
            slope = np.nansum(x * off, axis=(1, 2)) / np.nansum(x * du, axis=(1, 2))
        steep = np.abs(slope[np.isfinite(slope)])
        if not len(steep) or np.median(steep) < LEAST_SLOPE:
            continue
        of_axis = curved(width, width * (mean - slope[:, None] * place), slope)
        shifts[axis, axis] = of_axis.variance()
        most = np.sqrt(shifts[0, 0] * shifts[axis, axis])
        shifts[0, axis] = shifts[axis, 0] = np.clip(of_image.shared(of_axis), -most, most)
    return shifts


def _box(centre: Array, half: Array) -> Ints:
    """Pixels (m, k) along one axis from where each dot's window begins, as many as the largest has."""
    first = np.ceil(centre - half).astype(np.int64)
    return np.asarray(first[:, None] + np.arange(np.max(np.floor(centre + half) - first) + 1), np.int64)


@dataclass(frozen=True)
class _Curved:
    """What is left of smooth curves through the k rows of m dots, and how it follows from shifts of the image's rows.

    `row` (m, k) is each one's place in the image, `place` (m, k) that in its dot, of which `count` tells how many there
    are; `left` are residuals less the mean of each place, as what squares of pixels leave is alike in all dots, and `A`
    (m, k, k) their derivatives by shifts.
    """

    row: Ints
    use: NDArray[np.bool_]
    left: Array
    A: Array
    place: Ints
    count: Array

    def variance(self) -> float:
        """Variance of the rows' shifts, 0 where it is not significant."""
        products, spread = self._products(self)
        return self.shared(self) if products > SURE * spread else 0.0

    def shared(self, other: _Curved) -> float:
        """Covariance of the shifts that made both: ``E(z_i z_k) = cov tr(A_i A_kᵀ)``, with z what is left."""
        both = np.bincount(self.place[self.use & other.use], minlength=len(self.count))
        own = np.sum(self.A * other.A) - both @ np.sum(self._means * other._means, axis=1)
        scale = float(np.sum(self._answers * other._answers) - own)
        return self._products(other)[0] / scale if scale > 0 else 0.0

    def _products(self, other: _Curved) -> tuple[float, float]:
        """Sum of the products of different dots in a row, free of noise, and its spread if no row were shifted."""
        products = self.left * other.left
        mine, its, same, squares = (_by(self.row, x) for x in (self.left, other.left, products, products**2))
        spread = np.sqrt(2 * max(float(np.sum(same**2 - squares)), 0.0))
        return float(mine @ its - same.sum()), float(spread)

    @property
    def _height(self) -> int:
        return int(self.row.max()) + 1

    @cached_property
    def _means(self) -> Array:
        """Means of A, by place and row of the image."""
        height = self._height
        means = _by(self.place[:, :, None] * height + self.row[:, None, :], self.A, len(self.count) * height)
        return means.reshape(len(self.count), -1) / self.count[:, None]

    @cached_property
    def _answers(self) -> Array:
        """Sums of A less its means, by row and row of the image."""
        height, use = self._height, self.use
        answers = _by(self.row[:, :, None] * height + self.row[:, None, :], self.A, height**2)
        there = (self.row * len(self.count) + self.place)[use]
        many = _by(there, np.ones(len(there)), height * len(self.count))
        return np.asarray(answers.reshape(height, -1) - many.reshape(height, -1) @ self._means)


def _curved(at: Ints, away: Array, half: Array, width: Array, moment: Array, gain: Array) -> _Curved:
    """Take a curve from `moment` / `width` (m, k), the middles of rows, which a shift of 1 moves by `gain` (m,).

    `at` are the places (m, k) of the k rows of m dots in the image, `away` those off the centres, `half` half the dots'
    heights (m,), px.
    """
    use = width > LEAST_SHARE * width.max(axis=1, keepdims=True)
    use &= (np.count_nonzero(use, axis=1) >= LEAST_ROWS)[:, None]
    X = (away / half[:, None])[..., None] ** np.arange(CURVE)
    total = np.sum(width, axis=1, where=use, keepdims=True)
    share = np.where(use, width, 0.0) / np.where(total > 0, total, 1.0)
    weighted = np.swapaxes(X * share[..., None], 1, 2)
    normal = weighted @ X + (1 - use.any(axis=1))[:, None, None] * np.eye(CURVE)
    A = share[..., None] * (np.eye(X.shape[1]) - X @ np.linalg.solve(normal, weighted))
    left = (A @ np.where(use, moment / np.where(use, width, 1.0), 0.0)[..., None])[..., 0]
    A = A * np.where(use.any(axis=1), gain, 0.0)[:, None, None]
    place = np.rint(away / BIN_PX).astype(int)
    place -= place.min()
    count = np.maximum(_by(place[use], np.ones(np.count_nonzero(use)), int(place.max()) + 1), 1)
    left = np.where(use, left - (_by(place[use], left[use], len(count)) / count)[place], 0.0)
    return _Curved(at, use, left, A, place, count)


def _by(group: Ints, values: Array, length: int = 0) -> Array:
    """Sums of values by the numbers of their groups, both of one shape."""
    return np.asarray(np.bincount(group.ravel(), values.ravel(), length), np.float64)
