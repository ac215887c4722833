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

from core.measure.centres.defocus import WIDE, drawn_centroids, undrawn
from core.measure.centres.grain import PLAIN, Grain, clipped_variance
from core.measure.centres.kernels import in_bands, weighted_moments
from core.measure.centres.profile import Outlines, Profiles
from core.measure.centres.rays import Rays
from core.model import Array
from core.numerics import inverse_2x2

FLOOR = 0.01  # px² per px of diameter: what square pixels leave on noise-free renderings, 0.001 px at 12 px diameter
REACH, TAPER = (2.0, 0.3), 0.3  # blurs and px beyond the edge where weights end; share of that where they begin to fall
BILINEAR = 4 / 9  # variance of a bilinear value at any place, over that of a pixel
CLIPPED = (
    0.01  # px that a clipped top leaves of 10 to 25 px dots at 2 to 20 times full scale, bloomed or not: 0.005..0.012
)
SECOND, SIXTH = np.array([1.0, -2.0, 1.0]), np.array([1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0])
BLURS_TO_EDGE, PIXEL = 2.5, 0.5  # how far a dot's middle pixel must be from its edge: blurs, and px


def centroids(
    image: NDArray[np.float32], rays: Rays, profile: Outlines, light: Array, noise: tuple[float, float]
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
    drawn = light * profile.spread[:, None] / WIDE  # a Gaussian's is a fifth more, a disc's as much less
    cov = cov + (WIDE - 1) ** 2 * drawn[:, :, None] * drawn[:, None, :]
    m, cov = undrawn(m + drawn, cov, profile.spread, share)
    clipped = profile.plateau >= image.max()  # retro-reflective dots and the like
    floor = np.where(clipped, CLIPPED, FLOOR / diameter)
    return m, cov + floor[:, None, None] ** 2 * np.eye(2)


def noise_model(image: NDArray[np.float32], rays: Rays, profile: Profiles, grain: Grain = PLAIN) -> tuple[float, float]:
    """Variance of grey values as ``a + b I``, from second differences along rows in backgrounds and plateaus.

    The second difference ``I(u-1) - 2 I(u) + I(u+1)`` of an even area has the variance 6 σ² about its mean, which small
    dots' tops bend; clipping forgives the few that touch an edge. Where too few dots have a top, sixth differences
    across their middles tell b, for which a blurred dot is smooth enough. Both are of sums over pixels, such as
    centroids, which have `grain` times as much.
    """
    ring = (profile.window * 1.05)[:, None] + np.array([0.0, 0.2, 0.4])
    low = _second_differences(image, rays, ring, np.ones(len(ring), bool))
    flat = profile.contour[:, 0] * rays.minor > BLURS_TO_EDGE * profile.blur + PIXEL
    if np.count_nonzero(flat) < max(3, 0.3 * len(flat)):
        above, rise = _middles(image, rays, profile)
    else:
        # one pixel less for the difference, and what rounding to whole pixels may add: of small dots the middle alone
        deep = (np.maximum(profile.gentle - 1.7, 0.0) / rays.minor)[:, None] * np.array([0.5, 1.0])
        above = _variance(_second_differences(image, rays, deep, flat))
        rise = float(np.median(profile.contrast[flat]))
    slope = grain.slope * (above - _variance(low)) / max(rise, 1e-9)
    return grain.ground * _variance(low) - slope * float(np.median(profile.plane[:, 0])), slope


def _middles(image: NDArray[np.float32], rays: Rays, profile: Profiles) -> tuple[float, float]:
    """Variance of a pixel by sixth differences along rows across the middles of dots, and its height above ground."""
    u, v = np.rint(rays.centre).astype(int).T
    ok = (u >= 3) & (v >= 1) & (u < image.shape[1] - 3) & (v < image.shape[0] - 1)
    if np.count_nonzero(ok) < 3:
        return 0.0, np.inf
    rows, columns = v[ok, None] + np.arange(-1, 2), u[ok, None] + np.arange(-3, 4)
    seen = image[rows[:, :, None], columns[:, None, :]]
    above = (seen - profile.plane[ok, 0, None, None]) @ np.square(SIXTH) / np.sum(np.square(SIXTH))
    return _variance((seen @ SIXTH).ravel(), SIXTH), float(np.median(above))


def _second_differences(image: NDArray[np.float32], rays: Rays, radius: Array, use: NDArray[np.bool_]) -> Array:
    """Second differences along rows at the pixels nearest to radii (m, k) on the rays of the dots to `use`."""
    uv = (rays.centre[:, None, None, :] + rays.offsets(radius))[use].reshape(-1, 2)
    u, v = np.rint(uv[np.all(np.isfinite(uv), axis=1)]).astype(int).T
    ok = (u >= 1) & (v >= 0) & (u < image.shape[1] - 1) & (v < image.shape[0])
    u, v = u[ok], v[ok]
    return np.asarray(image[v, u - 1] - 2.0 * image[v, u] + image[v, u + 1], np.float64)


def _variance(differences: Array, weights: Array = SECOND) -> float:
    """Variance of a pixel from differences by such weights, with a few outliers clipped at three sigma."""
    if not len(differences):
        return 0.0
    rounding = 1 / 12 if np.all(differences == np.rint(differences)) else 0.0  # whole grey values
    return max(clipped_variance(differences) / float(weights @ weights), rounding)
