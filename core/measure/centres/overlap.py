"""Dots so blurred that their light reaches their neighbours.

A dot with a neighbour on one side alone, as in the board's outermost row, has a background that slopes towards it: at a
blur of 2.5 px, edges 9 px apart, it was drawn outwards by 0.1 px, and c by six of its sigmas.
"""

from __future__ import annotations

import numpy as np

from core.measure.centres.plateau import light_of, true_outlines
from core.measure.centres.profile import Outlines, Profiles, profiles
from core.measure.centres.rays import Rays
from core.model import Array, Floats, Ints
from core.numerics import inverse_2x2

NEAR = 3.0  # blurs from a dot's edge to its neighbour's window: the light there is a thousandth of the dot's
FAR = 3.5  # blurs beyond which it is a five-thousandth
ROUNDS = 4  # the background under a dot's own light is known once its neighbours' is gone
MODELLED = 0.3  # share of what that moves a centre, by which the blur of lenses, no Gaussian's, leaves it uncertain


def told_apart(image: Floats, rays: Rays, spacing: Array, found: Profiles) -> tuple[Floats, Profiles]:
    """Give an image in which no dot's light is seen beyond its own window, and the dots' profiles there.

    `found` are those in the image as it is, `spacing` as for `profiles`. Where no dot's light reaches that far they and
    the image are given themselves.
    """
    rest = image
    for _ in range(ROUNDS):
        reaching = (spacing - found.contour[:, 0] - found.window) * rays.minor < NEAR * found.blur
        reaching &= found.contrast > 0  # and known
        if not reaching.any():
            break
        windows, edges = _beyond(image.shape, rays, found, np.flatnonzero(reaching))
        rest = image - windows
        found = profiles(rest, rays, spacing, image - edges)
    return rest, found


def _beyond(shape: tuple[int, ...], rays: Rays, found: Outlines, dots: Ints) -> tuple[Floats, Floats]:
    """Light of some dots outside their windows, and outside their edges, in images of this shape."""
    lights = np.zeros((2, *shape), np.float32)
    outline, blur, share = true_outlines(rays.ellipse * found.contour[:, 0, None, None], found.blur)
    inverse, unit = inverse_2x2(rays.ellipse), inverse_2x2(outline)
    for dot in dots:
        size = np.abs(outline[dot]).sum(axis=1) + FAR * blur[dot]
        first = np.maximum(np.ceil(rays.centre[dot] - size), 0).astype(int)
        last = np.minimum(np.floor(rays.centre[dot] + size) + 1, shape[1::-1]).astype(int)
        if np.any(first >= last):
            continue
        away = np.stack(np.meshgrid(*map(np.arange, first, last)), axis=-1) - rays.centre[dot]
        radius = np.linalg.norm(away @ inverse[dot].T, axis=2)
        beyond = radius > found.contour[dot, 0]
        part = light_of(outline[dot][None] / blur[dot], away[beyond] @ unit[dot].T)[0]
        part *= found.contrast[dot] / share[dot]
        of_windows, of_edges = lights[:, first[1] : last[1], first[0] : last[0]]
        of_edges[beyond] += part
        of_windows[beyond] += np.where(radius[beyond] > found.window[dot], part, 0)
    return lights[0], lights[1]
