"""Blur that changes across a dot: where a tilted board leaves the depth of field, one edge is softer than the other.

A pixel sees, through every part of the aperture, another point of the board. On the softer side these lie further
apart, so that what it sees is centred on a point softer than its own by half the change of the blur's variance per px;
an evenly bright board stays evenly bright. (A board that sent as much light to every part of the aperture would have to
be brighter where it faces away.) All the light of a dot is drawn to the softer side by as much, an edge to the sharper.
Of a plane out of focus that variance is a quadratic function of the image's coordinates: circles of confusion go with
the reciprocal of depth, which is linear over the image of a plane.
"""

from __future__ import annotations

import numpy as np

from core.model import Array
from core.numerics import MEDIAN_OF_NORMAL, median_of, polynomial, polynomial_slopes

LEAST = 12  # dots that tell a quadratic function
# how much wider than a Gaussian's of its variance an edge is, squared: 1.4 for a disc, half-way to a Gaussian
WIDE = 1.2
# px that light, and the fit to a dot's edges, are drawn to the softer side per px of `widening`; and what is not known
LIGHT, EDGES, DOUBT = 0.5 / WIDE, -0.4, 0.2
# a pupil halfway from a Gaussian to a disc of its variance: offsets (32, 2), of a variance of 1 along either axis
SHARE = (np.arange(4) + 0.5) / 4
AWAY, AROUND = np.sqrt(2 * SHARE - np.log(1 - SHARE)), (np.arange(8) + 0.5) * np.pi / 4
PUPIL = np.stack([np.outer(AWAY, np.cos(AROUND)).ravel(), np.outer(AWAY, np.sin(AROUND)).ravel()], axis=1)
PUPIL /= PUPIL.std(axis=0)


def widening(uv: Array, spread: Array) -> Array:
    """Change per px of the variance of the edges (m,), px², at every dot: shape (m, 2), px; 0 where too few tell.

    Examples
    --------
    >>> uv = np.stack(np.meshgrid(np.arange(5) * 40.0, np.arange(4) * 40.0), axis=-1).reshape(-1, 2)
    >>> np.round(widening(uv, 0.5 + (0.01 * uv[:, 0] - 0.5) ** 2)[2], 4) + 0  # 2 * 0.01 * (0.8 - 0.5)
    array([0.006, 0.   ])
    """
    usable = np.isfinite(spread) & np.isfinite(uv).all(axis=1)
    if np.count_nonzero(usable) < LEAST:
        return np.zeros_like(uv)
    middle, size = uv[usable].mean(axis=0), float(np.ptp(uv[usable], axis=0).max()) / 2
    x, y = np.nan_to_num((uv - middle) / size).T
    A = polynomial(x, y, 2)
    fit = np.zeros(6)
    weight = usable / np.maximum(spread, 0.1)  # a width's sigma goes with the width
    for _ in range(5):
        root = weight[usable, None]
        fit[:] = np.linalg.lstsq(A[usable] * root, spread[usable] * root[:, 0], rcond=None)[0]
        off = np.abs(spread - A @ fit) / np.maximum(spread, 0.1)
        usual = max(median_of(off[usable]) / MEDIAN_OF_NORMAL, 1e-6)
        weight = usable / np.maximum(spread, 0.1) / (1 + (off / (3 * usual)) ** 2)
    return (polynomial_slopes(x, y, 2) @ fit).T / size


def undrawn(centre: Array, cov: Array, spread: Array, share: Array | float) -> tuple[Array, Array]:
    """Centres (m, 2) and covariances (m, 2, 2) of what was drawn to the softer side by a `share` of the widening."""
    widens = widening(centre, spread)
    return centre - np.reshape(share, (-1, 1)) * widens, cov + DOUBT**2 * widens[:, :, None] * widens[:, None, :]


def drawn_centroids(radius: Array, spread: Array, taper: Array) -> Array:
    """Share of the widening (m,) that draws centroids whose weights fall from 1 to 0 between two radii (m, 2), px.

    Through the point a of the pupil, the rim of a disc of radius r is seen moved by ``-(q r)(a n)`` along its normal n,
    where the blur's width changes by q. Without a taper the disc's centroid goes by ``q E[a a]``, which is LIGHT of the
    widening. Weights that end in the blur take from the softer side what lies outside.

    Examples
    --------
    >>> share = drawn_centroids(np.array([10.0]), np.array([2.0]), np.array([[90.0, 99.0]]))  # nothing cut off
    >>> print(np.allclose(share, LIGHT))
    True
    """
    sigma = np.sqrt(spread / WIDE)[:, None]
    out, beside = radius[:, None] + sigma * PUPIL[:, 0], sigma * PUPIL[:, 1]
    t = np.clip((np.hypot(out, beside) - taper[:, :1]) / (taper[:, 1:] - taper[:, :1]), 0, 1)
    weighted = (1 - t * t * (3 - 2 * t)) * out
    return LIGHT * radius * (weighted * PUPIL[:, 0]).mean(axis=1) / (sigma[:, 0] * weighted.mean(axis=1))
