"""Triangles between neighbouring pixels, where the surface is one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.model import PointCloud

STEEPEST = 5.0  # depth step over the distance across: surfaces seen at more than 79° are left open
NOISE = 6.0  # sigmas of the depth that a step may have besides


def triangles(cloud: PointCloud) -> NDArray[np.int64]:
    """Triangles as numbers of valid points in the order of their pixels, (k, 3), counter-clockwise from the camera.

    Two for every square of four pixels; a triangle is left out where a corner has no point, or the depth steps further
    than a steep surface and noise would make it.
    """
    valid = cloud.valid
    number = np.cumsum(valid.ravel()).reshape(valid.shape) - 1
    allowed = 0.0
    if cloud.sigma_depth_mm is not None and valid.any():
        sigma = cloud.sigma_depth_mm[valid]
        sigma = sigma[np.isfinite(sigma)]
        allowed = NOISE * float(np.median(sigma)) if sigma.size else 0.0
    if min(valid.shape) < 2:
        return np.zeros((0, 3), np.int64)
    first, last = slice(None, -1), slice(1, None)
    corners = (first, first), (last, first), (last, last), (first, last)
    found = []
    for chosen in ((0, 1, 2), (0, 2, 3)):
        at = [corners[k] for k in chosen]
        whole = valid[at[0]] & valid[at[1]] & valid[at[2]]
        ends = np.stack([cloud.xyz_mm[a][whole] for a in at], axis=1)  # (k, 3 corners, 3)
        step = np.ptp(ends[..., 2], axis=1)
        across = np.max(np.ptp(ends[..., :2], axis=1), axis=1)
        keep = step <= STEEPEST * across + allowed
        found.append(np.stack([number[a][whole][keep] for a in at], axis=1))
    return np.concatenate(found)
