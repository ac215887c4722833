"""How much of its brightness a small dot's middle still shows where the blur of its edge reaches it.

A dot that looks smaller shows less. Across a tilted board that would pass for a change of the light: at a radius of 2.6
blurs it moved centres by 0.003 px.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from core.measure.centres.profile import EDGE, PLATEAU
from core.measure.centres.rays import DIRECTIONS
from core.model import Array
from core.numerics import row_median

SHARP = 4.5  # blurs of radius from which the middle shows all
RADII = np.linspace(1.6, 5.0, 69)  # blurs
INSIDE = (PLATEAU[:, None, None] * DIRECTIONS[::3]).reshape(-1, 2)  # places that tell the plateau, in the unit disc


def plateau_share(contour: Array, blur: Array) -> Array:
    """Share (m,) of their contrast that the plateaus of dots show, by the outlines at half of that (m, 2, 2) px.

    `blur`, (m,) px, is the sigma of their edges, by where they fall from 80 to 20 % of it.
    """
    return true_outlines(contour, blur)[2]


def true_outlines(contour: Array, blur: Array) -> tuple[Array, Array, Array]:
    """Outlines of dots before the blur (m, 2, 2) px, its sigma (m,) px, and the share that their plateaus show."""
    size = np.sqrt(np.abs(np.linalg.det(contour))) / blur
    share, outline, sigma = np.ones(len(size)), contour.copy(), blur.astype(np.float64)
    soft = size < SHARP
    if soft.any():
        seen, *by_seen = _as_seen()
        by_radius, by_blur = (np.interp(size[soft], seen, part) for part in by_seen)
        outline[soft] *= by_radius[:, None, None]
        sigma[soft] *= by_blur
        share[soft] = row_median(light_of(outline[soft] / sigma[soft, None, None], INSIDE))
    return outline, sigma, share


def light_of(ellipse: Array, places: Array) -> Array:
    """Light (m, k) at places (k, 2) in units of evenly bright ellipses (m, 2, 2), in blurs.

    A blur is the divergence of (1 - exp(-r²/2)) / r² times the vector r: what leaves through the outline lies within.
    """
    unit = np.swapaxes(ellipse, 1, 2)
    away = (DIRECTIONS @ unit)[:, None] - (places @ unit)[:, :, None]  # (m, k, directions, 2)
    along = (DIRECTIONS @ [[0, 1], [-1, 0]] @ unit)[:, None]
    square = np.maximum(np.sum(away**2, axis=3), 1e-12)
    outward = away[..., 0] * along[..., 1] - away[..., 1] * along[..., 0]
    return np.abs((-np.expm1(-square / 2) / square * outward).mean(axis=2))  # also of mirrored ones


@cache
def _as_seen() -> tuple[Array, Array, Array]:
    """Of blurred discs the radius as seen over the blur as seen, and the true ones over those as seen."""
    at = np.linspace(0.2, 2.6, 161)
    discs = RADII[:, None, None] * np.eye(2)
    light, shown = light_of(discs, np.stack([at, np.zeros_like(at)], axis=1)), row_median(light_of(discs, INSIDE))
    outer, radius, inner = (
        RADII * [np.interp(-part * top, -each, at) for top, each in zip(shown, light, strict=True)]
        for part in (0.2, 0.5, 0.8)
    )
    blur = (outer - inner) / EDGE
    return radius / blur, RADII / radius, 1 / blur
