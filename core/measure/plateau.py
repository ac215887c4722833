"""How much of its brightness a small dot's middle still shows where the blur of its edge reaches it.

A dot that looks smaller shows less. Across a tilted board that would pass for a change of the light: at a radius of 2.6
blurs it moved centres by 0.003 px.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from core.measure.profile import EDGE, PLATEAU
from core.measure.rays import DIRECTIONS
from core.model import Array
from core.numerics import inverse_2x2, row_median

SHARP = 4.5  # blurs of radius from which the middle shows all
RADII = np.linspace(1.6, 5.0, 69)  # blurs
INSIDE = (PLATEAU[:, None, None] * DIRECTIONS[::3]).reshape(-1, 2)  # places that tell the plateau, in the unit disc


def plateau_share(contour: Array, blur: Array) -> Array:
    """Share (m,) of their contrast that the plateaus of dots show, by the outlines at half of that (m, 2, 2) px.

    `blur`, (m,) px, is the sigma of their edges, by where they fall from 80 to 20 % of it.
    """
    size = np.sqrt(np.abs(np.linalg.det(contour))) / blur
    share = np.ones(len(size))
    soft = size < SHARP
    if soft.any():
        seen, by_radius, by_blur = _as_seen()
        factor = np.interp(size[soft], seen, by_radius / by_blur) / blur[soft]
        share[soft] = row_median(_blurred(contour[soft] * factor[:, None, None], INSIDE, DIRECTIONS))
    return share


def _blurred(ellipse: Array, places: Array, directions: Array) -> Array:
    """Light (m, k) at places (k, 2) in units of evenly bright ellipses (m, 2, 2), in blurs.

    Around each place the blur lies in rings: in each direction those count that lie within the ellipse.
    """
    along = directions @ np.swapaxes(inverse_2x2(ellipse), 1, 2)  # (m, directions, 2): what a blur is in the unit disc
    square = np.sum(along**2, axis=2)[:, None]
    half = places @ np.swapaxes(along, 1, 2)  # (m, k, directions)
    root = np.sqrt(np.maximum(half**2 + square * (1 - np.sum(places**2, axis=1)[:, None]), 0))
    begin, end = (np.maximum((sign * root - half) / square, 0) for sign in (-1, 1))
    return np.asarray((np.exp(-(begin**2) / 2) - np.exp(-(end**2) / 2)).mean(axis=2))


@cache
def _as_seen() -> tuple[Array, Array, Array]:
    """Of blurred discs the radius as seen over the blur as seen, and the true ones over those as seen."""
    at = np.linspace(0.2, 2.6, 481)
    discs, turn = RADII[:, None, None] * np.eye(2), np.linspace(0, 2 * np.pi, 360, endpoint=False)
    light = _blurred(discs, np.stack([at, np.zeros_like(at)], axis=1), np.stack([np.cos(turn), np.sin(turn)], axis=1))
    shown = row_median(_blurred(discs, INSIDE, DIRECTIONS))
    outer, radius, inner = (
        RADII * [np.interp(-part * top, -each, at) for top, each in zip(shown, light, strict=True)]
        for part in (0.2, 0.5, 0.8)
    )
    blur = (outer - inner) / EDGE
    return radius / blur, RADII / radius, 1 / blur
