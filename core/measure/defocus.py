"""Blur that changes across a dot: where a tilted board leaves the depth of field, one edge is softer than the other.

Every point of the board is spread evenly about its own image, so that the mean of all its light stays. Its parts do
not: at a pixel more light arrives from the softer side, and an edge is seen shifted to the sharper one by the change of
the blur's variance per px. Of a plane out of focus that variance is a quadratic function of the image's coordinates:
circles of confusion go with the reciprocal of depth, which is linear over the image of a plane.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.numerics import MEDIAN_OF_NORMAL

Array = NDArray[np.float64]

LEAST = 12  # dots that tell a quadratic function
# px that a centre is drawn to the sharper side per px of `widening`, and how far that depends on how light is spread:
# by a Gaussian or evenly over a disc, whose width is told by its edge
CENTROID, EDGES, DOUBT = 0.37, 0.9, 0.2


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
    one, none = np.ones_like(x), np.zeros_like(x)
    A = np.stack([one, x, y, x * x, x * y, y * y], axis=1)
    fit = np.zeros(6)
    weight = usable / np.maximum(spread, 0.1)  # a width's sigma goes with the width
    for _ in range(5):
        root = weight[usable, None]
        fit[:] = np.linalg.lstsq(A[usable] * root, spread[usable] * root[:, 0], rcond=None)[0]
        off = np.abs(spread - A @ fit) / np.maximum(spread, 0.1)
        usual = max(float(np.median(off[usable])) / MEDIAN_OF_NORMAL, 1e-6)
        weight = usable / np.maximum(spread, 0.1) / (1 + (off / (3 * usual)) ** 2)
    by_x, by_y = [none, one, none, 2 * x, y, none], [none, none, one, none, x, 2 * y]
    return np.stack([np.stack(terms, axis=1) @ fit for terms in (by_x, by_y)], axis=1) / size


def undrawn(centre: Array, cov: Array, spread: Array, share: float) -> tuple[Array, Array]:
    """Centres (m, 2) and covariances (m, 2, 2) of what was drawn to the sharper side by a `share` of the widening."""
    widens = widening(centre, spread)
    return centre + share * widens, cov + DOUBT**2 * widens[:, :, None] * widens[:, None, :]
