"""The light of a curved, blurred edge in square pixels, and how surely its pixels tell where it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from core.model import Array, Ints

PIXEL_PX2 = 1 / 12  # variance of a pixel's square along any direction
LEAST_BLUR_PX = 0.15  # of a lens: below it three places do not stand for a whole pixel
STRAIGHT = 1e4  # blurs: the radius of an edge that counts as straight
MOST_LEVERAGE, LEAST_NOISE = 0.9, 0.05  # of a residual that the fit takes; of its square that is each pixel's own


class Lay(NamedTuple):
    """How an edge lies in the pixels (n,) along it."""

    curvature: Array  #: 1/px
    slope_u: Array  #: change of the distance from the edge by u
    slope_v: Array


def light_within(away: Array, lay: Lay, lens_px: float) -> Array:
    """Share of the light of a disc that pixels (n,) see, whose middles are so far outside its edge, px.

    The lens blurs as a Gaussian. A pixel is a square: across the edge three places stand for its trapezoid, and at each
    the edge recedes by the square's width along it. Both have the square's moments up to the fourth.
    """
    blur, fourths = float(np.hypot(lens_px, LEAST_BLUR_PX)), lay.slope_u**4 + lay.slope_v**4
    squared = 0.25 - fourths / 10  # of the outer places: fourth moment over variance
    weight, place = PIXEL_PX2 / (2 * squared), np.sqrt(squared)
    along = ((3 * fourths - 2) / 144 + (1 - fourths) / 80) / PIXEL_PX2  # variance along the edge, at the outer places
    inner, along = (PIXEL_PX2 - 2 * weight * along) / (1 - 2 * weight) * lay.curvature / 2, along * lay.curvature / 2
    outer = sum(_blurred(away + along + side, lay.curvature, blur) for side in (-place, place))
    return np.asarray(weight * outer + (1 - 2 * weight) * _blurred(away + inner, lay.curvature, blur))


def width_px(lens_px: float) -> float:
    """Standard deviation of the blur by lens and pixels together."""
    return float(np.sqrt(lens_px**2 + LEAST_BLUR_PX**2 + PIXEL_PX2))


def _blurred(away: Array, curvature: Array, blur: float) -> Array:
    """Share of the light of a disc, whose edge is so far away, that a Gaussian blur leaves.

    That is the non-central chi-squared distribution of two degrees of freedom, by Sankaran's approximation,
    doi:10.1093/biomet/50.1-2.199; to 0.002 where the radius is three blurs.
    """
    from scipy.special import ndtr

    radius = 1 / np.maximum(curvature * blur, 1 / STRAIGHT)
    squared = np.maximum(radius + away / blur, 0.0) ** 2
    mean, p = 2 + squared, 2 * (1 + squared) / (2 + squared) ** 2
    h = 1 - mean * (2 + 3 * squared) / (6 * (1 + squared) ** 2)
    m = (h - 1) * (1 - 3 * h)
    middle = 1 + h * p * (h - 1 - (2 - h) * m * p / 2)
    return np.asarray(ndtr(((radius**2 / mean) ** h - middle) / (h * np.sqrt(2 * p) * (1 + m * p / 2))))


def covariance(J: Array, rest: Array, moved: Array, row: Ints) -> Array:
    """Covariance of a fit's parameters (k, k) by its slopes (n, k) and residuals (n,) in grey values.

    The sandwich form, of residuals enlarged by what the fit took of them: few pixels tell an edge, and each draws it.
    `moved` (n,) is how the grey values change where an image row is shifted, as rows of video are, all pixels of a
    `row` alike. Its variance is told by the products of residuals that share a row; what is fitted is counted out.
    """
    N, column = np.linalg.pinv(J.T @ J), moved[:, None]
    row = np.unique(row, return_inverse=True)[1]
    leverage = np.einsum("ij,jk,ik->i", J, N, J)
    squares = rest**2 / (1 - np.minimum(leverage, MOST_LEVERAGE))
    by_row = np.zeros((row.max() + 1, J.shape[1]))  # of the slopes, as all pixels of a row are shifted
    np.add.at(by_row, row, J * column)
    # the matrix of pairs, moved_i moved_j of unlike pixels of a row, is never made: it is of pixels by pixels
    paired = by_row[row] * column - J * column**2
    among = J.T @ paired
    taken = np.einsum("ij,jk,ik->i", J, N @ among @ N, J) - 2 * np.einsum("ij,jk,ik->i", J, N, paired)
    apart = _pairs(row, moved**2) - 2 * np.sum(N * (paired.T @ paired)) + np.trace(N @ among @ N @ among)
    products = _pairs(row, moved * rest) - float(taken @ squares)
    shift2 = max(products / max(float(apart), 1e-300), 0.0)
    noise2 = max(float(np.mean(squares - shift2 * moved**2)), LEAST_NOISE * float(np.mean(squares)))
    own = squares * noise2 / np.maximum(noise2 + shift2 * moved**2, 1e-300)
    return np.asarray(N @ ((J.T * own) @ J + shift2 * by_row.T @ by_row) @ N)


def _pairs(row: Ints, values: Array) -> float:
    """Sum of the products of values (n,) that share a row, without their squares."""
    return float(np.sum(np.bincount(row, values) ** 2) - np.sum(values**2))
