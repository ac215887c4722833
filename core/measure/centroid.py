"""Weighted centroids with their covariance.

Notes
-----
The weight of a pixel is ``w = (I - B) / L`` with the background plane B under the dot and the relative brightness L of
the light across it. The centroid m solves ``sum(g w (x - m)) = 0`` with g(|x - m|) falling smoothly to 0 where the
blurred dot ends: odd about the centre, it is right for every dot that is even about it. Its covariance is
``sum(g² var_I (x - m)(x - m)') / s²``, s being what the sum loses for each px of m, see Trinder (1989), *Precision of
digital target location*; and what the background's slopes add. L matters: a disc of radius r under a light that changes
by h per pixel has its grey centroid h r²/4 off. The light was there before the blur s, so that dividing the blurred dot
by it takes h s² too much, which is given back. Nothing cuts grey values off: a threshold bends the foot of the edge,
which pixels then undersample. At 5 % of the contrast it left 0.002 px at a diameter of 18 px, at 10 % 0.003 px, the
same in every image of a scene and of one sign over regions, where g leaves less than 0.001 px without more noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.measure.defocus import drawn_centroids, undrawn
from core.measure.kernels import in_bands, weighted_moments
from core.measure.profile import Profiles
from core.measure.rays import Rays
from core.model import Array
from core.numerics import MEDIAN_OF_NORMAL, inverse_2x2, median_of, nearest, normal_equations, row_median

FLOOR = 0.01  # px² per px of diameter: what square pixels leave on noise-free renderings, 0.001 px at 12 px diameter
REACH, TAPER = (2.0, 0.3), 0.3  # blurs and px beyond the edge where weights end; share of that where they begin to fall
BILINEAR = 4 / 9  # variance of a bilinear value at any place, over that of a pixel
CLIPPED = (
    0.01  # px that a clipped top leaves of 10 to 25 px dots at 2 to 20 times full scale, bloomed or not: 0.005..0.012
)
BLURS_TO_EDGE, PIXEL = 2.5, 0.5  # how far a dot's middle pixel must be from its edge: blurs, and px
NEIGHBOURS, LEAST_NEIGHBOURS = 20, 6  # dots that tell the light's gradient
PRINTS = 0.01  # share by which dots' prints differ, to begin with
# how much light's logarithm usually changes over the neighbours' reach, by the terms of a cubic: a bound for few dots
USUAL, UNUSUAL = np.repeat([2.0, 4.0, 4.0, 4.0], [1, 2, 3, 4]), 1.5


def centroids(
    image: NDArray[np.float32],
    rays: Rays,
    profile: Profiles,
    light: Array,
    noise: tuple[float, float],
) -> tuple[Array, Array]:
    """Weighted centroids (m, 2) and covariances (m, 2, 2), px, of bright dots with approximate centres.

    `light`, (m, 2), is the relative change of the light per px; the variance of a grey value I is ``noise[0] + noise[1]
    I``.
    """
    centre, inverse = rays.centre, np.ascontiguousarray(inverse_2x2(rays.ellipse))
    # the variance at background level, then its growth above it
    at_background = np.maximum(noise[0] + noise[1] * profile.plane[:, 0], 0.0)
    variance = np.ascontiguousarray(np.stack([at_background, np.full(len(centre), noise[1])], axis=1))
    edge, beyond = profile.contour[:, 0], (REACH[0] * profile.blur + REACH[1]) / rays.minor
    stop = np.minimum(edge + beyond, profile.window)
    taper = np.stack([np.minimum(edge + TAPER * beyond, 0.9 * stop), stop], axis=1)
    m, sums, gradient = centre.copy(), np.empty((len(centre), 9)), np.ascontiguousarray(light)
    for _ in range(4):
        plane = profile.plane.copy()
        plane[:, 0] += np.sum(plane[:, 1:] * (m - centre), axis=1)
        of_dots = m, inverse, taper, plane, gradient, variance, sums
        in_bands(weighted_moments, image, *of_dots)
        with np.errstate(all="ignore"):
            shift = sums[:, 1:3] / sums[:, :1]
            m = m + shift
            by_pixels = sums[:, [3, 4, 4, 5]].reshape(-1, 2, 2) / sums[:, 0, None, None] ** 2
            by_slope = sums[:, [6, 7, 7, 8]].reshape(-1, 2, 2) / sums[:, 0, None, None]
            slopes = BILINEAR * at_background[:, None, None] * profile.slopes
            cov = by_pixels + by_slope @ slopes @ by_slope
    diameter = 2.0 * np.sqrt(np.abs(np.linalg.det(rays.ellipse)))
    share = drawn_centroids(edge * diameter / 2, profile.spread, taper * diameter[:, None] / 2)
    m, cov = undrawn(m + light * profile.spread[:, None], cov, profile.spread, share)
    clipped = profile.plateau >= image.max()  # retro-reflective dots and the like
    floor = np.where(clipped, CLIPPED, FLOOR / diameter)
    return m, cov + floor[:, None, None] ** 2 * np.eye(2)


def light_gradient(
    uv: Array, contrast: Array, inside: Array, weight: Array, shadowed: NDArray[np.bool_] | None = None
) -> tuple[Array, Array]:
    """Relative change of the light per px at every bright dot, shape (m, 2), and its covariance (m, 2, 2).

    A cubic through the logarithms of the contrasts of the dots around, and through the changes seen `inside` them
    (m, 2), whose variances go with 1 / `weight` (m,): a dot alone tells too little, and prints differ at random. A
    quadratic leaves 0.002 px at a testfield's corners, where all neighbours are on one side and the light falls off
    fastest. What either kind is worth follows from how well it fits. A contrast of NaN does not count: where the light
    ends in the ring round a dot, its background is too dark and its contrast too high. Dots that are `shadowed` (m,)
    and dots that are not say nothing of each other's light.
    """
    k = min(NEIGHBOURS, len(uv))
    if k < LEAST_NEIGHBOURS:
        return np.zeros_like(uv), np.zeros((len(uv), 2, 2))
    near = nearest(uv, k)
    scale = np.linalg.norm(uv[near[:, -1]] - uv, axis=1, keepdims=True)
    x, y = np.moveaxis((uv[near] - uv[:, None, :]) / scale[..., None], 2, 0)
    one, none = np.ones_like(x), np.zeros_like(x)
    value = [one, x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3]
    by_x = [none, one, none, 2 * x, y, none, 3 * x * x, 2 * x * y, y * y, none]
    by_y = [none, none, one, none, x, 2 * y, none, x * x, 2 * x * y, 3 * y * y]
    A = np.concatenate([np.stack(terms, axis=2) for terms in (value, by_x, by_y)], axis=1)
    bright = np.log(np.maximum(contrast, 1e-6))[near]
    bright = bright - row_median(bright)[:, None]
    valid = np.abs(bright) < UNUSUAL
    if shadowed is not None:
        valid &= shadowed[near] == shadowed[:, None]
    # near ones count most: over all of them a cubic follows light that falls steeply only in part
    share = np.tile((1 - np.minimum(np.hypot(x, y), 0.999) ** 3) ** 3, (1, 3))
    seen = np.nan_to_num(np.concatenate([bright, inside[near, 0] * scale, inside[near, 1] * scale], axis=1))
    told = np.concatenate([valid, *2 * [valid * weight[near] / scale**2]], axis=1)
    variance = [PRINTS**2, PRINTS**2]
    doubt, own = np.ones(told.shape), [0, k, 2 * k]
    for _ in range(3):
        known = told / np.repeat(variance, (k, 2 * k))
        counted = known * doubt * share
        N, b = normal_equations(A, counted, seen[..., None])
        C = np.linalg.inv(N + np.diag(1 / USUAL**2))
        fit = C @ b
        square = (seen - (A @ fit)[..., 0]) ** 2 * known
        doubt = 1 / (1 + square / 9)
        # of a dot's own values, which the fit has drawn to itself
        drawn = np.einsum("mni,mij,mnj->mn", A[:, own], C, A[:, own]) * known[:, own]
        left = np.where(known[:, own] > 0, square[:, own] / np.maximum(1 - drawn, 0.1), np.nan)
        for i, part in enumerate((left[:, :1], left[:, 1:])):
            if np.isfinite(part).any():
                variance[i] = max(variance[i] * median_of(part) * MEDIAN_OF_NORMAL**-2, 1e-8)
    cov = C @ (normal_equations(A, counted * share, seen[..., None])[0] + np.diag(1 / USUAL**2)) @ C
    return fit[:, 1:3, 0] / scale, cov[:, 1:3, 1:3] / scale[..., None] ** 2


def noise_model(image: NDArray[np.float32], rays: Rays, profile: Profiles) -> tuple[float, float]:
    """Variance of grey values as ``a + b I``, from second differences along rows in backgrounds and plateaus.

    The second difference ``I(u-1) - 2 I(u) + I(u+1)`` of an even area has the variance 6 σ² about its mean, which small
    dots' tops bend; clipping forgives the few that touch an edge. Where too few dots have a top, b is 0.
    """
    ring = (profile.window * 1.05)[:, None] + np.array([0.0, 0.2, 0.4])
    low = _second_differences(image, rays, ring, np.ones(len(ring), bool))
    flat = profile.contour[:, 0] * rays.minor > BLURS_TO_EDGE * profile.blur + PIXEL
    if np.count_nonzero(flat) < max(3, 0.3 * len(flat)):
        return _variance(low), 0.0
    # one pixel less for the difference, and what rounding to whole pixels may add: of small dots the middle alone
    deep = (np.maximum(profile.gentle - 1.7, 0.0) / rays.minor)[:, None] * np.array([0.5, 1.0])
    high = _second_differences(image, rays, deep, flat)
    rise = float(np.median(profile.contrast[flat]))
    slope = (_variance(high) - _variance(low)) / max(rise, 1e-9)
    return _variance(low) - slope * float(np.median(profile.plane[:, 0])), slope


def _second_differences(image: NDArray[np.float32], rays: Rays, radius: Array, use: NDArray[np.bool_]) -> Array:
    """Second differences along rows at the pixels nearest to radii (m, k) on the rays of the dots to `use`."""
    uv = (rays.centre[:, None, None, :] + rays.offsets(radius))[use].reshape(-1, 2)
    u, v = np.rint(uv[np.all(np.isfinite(uv), axis=1)]).astype(int).T
    ok = (u >= 1) & (v >= 0) & (u < image.shape[1] - 1) & (v < image.shape[0])
    u, v = u[ok], v[ok]
    return np.asarray(image[v, u - 1] - 2.0 * image[v, u] + image[v, u + 1], np.float64)


def _variance(differences: Array) -> float:
    """Variance of a pixel from second differences, with a few outliers clipped at three sigma."""
    if not len(differences):
        return 0.0
    rounding = 1 / 12 if np.all(differences == np.rint(differences)) else 0.0  # whole grey values
    square = (differences - median_of(differences)) ** 2
    spread = 2.2 * median_of(square)  # the median of a squared Gaussian is 0.455 of its variance
    for _ in range(3):  # the median of whole numbers is coarse: go on with means
        spread = float(np.mean(square[square <= 9 * spread + 1e-12])) / 0.973
    return max(spread / 6, rounding)
