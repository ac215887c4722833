"""Places where four squares of a chessboard meet, and three by three of them as they lie on a board."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from core.model import Array

SIGMA_PX = 1.5  # of the smoothing, in pixels of each size that the image is looked at in
SIZES = (1, 2, 4)  # times a pixel
REACH = 2.0  # sigmas from a saddle's middle at which its four quadrants are looked at
NOISES = 6.0  # of a quadrant's grey value: by which bright ones are brighter than dark ones
MOST = 600  # saddles of a size, the strongest
NEIGHBOURS = 9  # among which the next ones along both edges are
EVEN = 0.25  # of a square: that those on both sides of a corner are apart from the same distance
ASTRIDE = 0.9  # cosine of twice the angle by which quadrants may lie off the middle between both edges
LEAST_ANGLE = 0.3  # sine of that between both edges


def blocks_of_crossings(grey: NDArray[np.uint8]) -> Iterator[Array]:
    """Blocks (3, 3, 2) of corners' places, px, in the order of their rows; the strongest of every size first.

    A corner is a saddle of the smoothed grey values: its quadrants lie along the eigenvectors of the second
    derivatives. From one corner to the next along an edge, dark and bright change places.
    """
    for size in SIZES:
        small = cv2.resize(grey, None, fx=1 / size, fy=1 / size, interpolation=cv2.INTER_AREA) if size > 1 else grey
        if min(small.shape) < 16:
            return
        uv, axis = _saddles(small)
        for block in _blocks(uv, axis):
            yield (block + 0.5) * size - 0.5


def _saddles(grey: NDArray) -> tuple[Array, Array]:
    """Places (n, 2) of saddles, the strongest first, and the directions (n,) of their bright quadrants, doubled."""
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), SIGMA_PX)
    xx, yy, xy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2), (1, 1)))
    strength = xy * xy - xx * yy
    top = (strength == cv2.dilate(strength, np.ones((5, 5), np.uint8))) & (strength > 0)
    v, u = np.nonzero(top)
    order = np.argsort(-strength[v, u])[: 4 * MOST]
    v, u = v[order], u[order]
    # the larger of the second derivatives is along half the angle of (xx - yy, 2 xy)
    twice = np.arctan2(2 * xy[v, u], xx[v, u] - yy[v, u]).astype(np.float64)
    values = []
    for turn in (0.0, np.pi / 2):
        step = REACH * SIGMA_PX * np.column_stack([np.cos(twice / 2 + turn), np.sin(twice / 2 + turn)])
        for sign in (1, -1):
            x, y = (np.stack([u, v], axis=1) + sign * step).astype(np.float32).T
            values.append(cv2.remap(smooth, x[:, None].copy(), y[:, None].copy(), cv2.INTER_LINEAR).ravel())
    apart = np.minimum(values[0], values[1]) - np.maximum(values[2], values[3])
    noise = float(np.median(np.abs(np.diff(smooth[::3], axis=1))))
    keep = np.flatnonzero(apart > max(NOISES * noise, 2.0))[:MOST]
    return np.column_stack([u, v])[keep].astype(np.float64), twice[keep]


def _blocks(uv: Array, axis: Array) -> Iterator[Array]:
    if len(uv) < 9:
        return
    gap = uv[None] - uv[:, None]
    distance = np.linalg.norm(gap, axis=2)
    swapped = np.cos(axis[None] - axis[:, None]) < 0
    for i in range(len(uv)):
        others = np.flatnonzero(swapped[i])
        others = others[np.argsort(distance[i, others])][:NEIGHBOURS]
        edges = _edges(gap[i, others])
        if edges is None:
            continue
        (left, right), (up, down) = others[edges[0]], others[edges[1]]
        turned = float(np.sum(np.arctan2(gap[i, [right, down], 1], gap[i, [right, down], 0]))) - axis[i]
        if abs(np.cos(turned)) < ASTRIDE:
            continue
        if np.linalg.det(np.stack([gap[i, right], gap[i, down]])) < 0:
            left, right = right, left
        ends = [uv[h] + uv[w] - uv[i] for h in (up, down) for w in (left, right)]
        near = np.linalg.norm(uv[None] - np.array(ends)[:, None], axis=2)
        corner = near.argmin(axis=1)
        square = min(distance[i, left], distance[i, up])
        if np.all(near.min(axis=1) < EVEN * square) and not swapped[i, corner].any() and len(set(corner)) == 4:
            yield uv[[corner[0], up, corner[1], left, i, right, corner[2], down, corner[3]]].reshape(3, 3, 2)


def _edges(steps: Array) -> list[list[int]] | None:
    """Two pairs of opposite steps (n, 2), the shortest that do not lie along one line; None where there are not two."""
    pairs: list[list[int]] = []
    length = np.linalg.norm(steps, axis=1)
    for a in range(len(steps)):
        off = np.linalg.norm(steps + steps[a], axis=1)
        b = int(off.argmin())
        if off[b] > EVEN * length[a] or b < a:
            continue
        if pairs:
            first = steps[pairs[0][0]]
            sine = abs(first[0] * steps[a, 1] - first[1] * steps[a, 0]) / (np.linalg.norm(first) * length[a])
            if sine < LEAST_ANGLE:
                continue
        pairs.append([a, b])
        if len(pairs) == 2:
            return pairs
    return None
