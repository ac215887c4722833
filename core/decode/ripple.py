"""The ripple of whole lines on sine fringes, found in the coordinates themselves and taken out.

Each line is evenly bright: a wave of lines is a staircase, whose steps blur softens. Beside the wave there are copies
of it at ``1/P + k`` per line, k a whole number, and all of them follow the phase shift, so no number of steps tells
them from the wave. With the blur b (lines) they displace the coordinate u by ``-A sin(2 pi u)``,

    A ~ (exp(-2 pi² b² (1 - 2/P)) / (1 - 1/P) + exp(-2 pi² b² (1 + 2/P)) / (1 + 1/P)) / 2 pi,

whatever the period P. Displaced coordinates crowd about the lines' middles: the mean of ``exp(2 pi i u)`` over a scene
that favours no place within lines is ``J1(2 pi A) ~ pi A``, less what noise makes of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.decode.tables import Singles
from core.model import Array
from core.parallel import run_in_bands

TILES, SIDE = 4, 64  # tiles of the image along each axis, and pixels along each of theirs
FEWEST_PIXELS, FEWEST_TILES = 400, 8
SIGNIFICANT = 6.0  # standard errors by 8 to 16 tiles: once in 6,000 to 100,000 axes by chance
HIDDEN = 0.3  # lines, noise beyond which no place within lines is seen
LEAST, MOST = 0.003, 0.1  # lines: less is not worth it, more comes from a scene in step with the lines
TURN = np.float32(2 * np.pi)
ROUNDS = 5  # of the fixed point, which leaves less than a hundredth of a line at `MOST`


def take_ripple_out(u: Singles, sigma: Singles) -> None:
    """Correct, in place, coordinates of sine fringes, shape (H, W), and their sigmas, lines, where they crowd."""
    plane = _amplitude(u, sigma)
    if plane is None:
        return
    along = (plane[2] * np.arange(u.shape[1])).astype(np.float32)

    def band(first: int, last: int) -> None:
        seen, spread = u[first:last], sigma[first:last]
        down = (plane[0] + plane[1] * np.arange(first, last)).astype(np.float32)
        # of a place that noise hides, the ripple in the mean
        own = np.clip(down[:, None] + along, 0, MOST) * np.exp(np.float32(-0.5) * np.square(TURN * spread))
        place = seen
        for _ in range(ROUNDS):
            place = seen + own * np.sin(TURN * place)
        spread /= 1 - TURN * own * np.cos(TURN * place)
        seen[:] = place

    run_in_bands(band, len(u))


def _amplitude(u: Singles, sigma: Singles) -> Array | None:
    """Find A, lines, as constant and slopes by row and column, from the tiles; None where it is not worth it.

    A scene's own crowding favours no place within lines: its size shows in the imaginary parts.
    """
    places, means = [], []
    for top, left in ((t, f) for t in _begins(u.shape[0]) for f in _begins(u.shape[1])):
        tile = slice(top, top + SIDE), slice(left, left + SIDE)
        seen, spread = u[tile], sigma[tile]
        valid = spread < HIDDEN
        if valid.sum() >= FEWEST_PIXELS:
            part = np.exp(np.float32(-0.5) * np.square(TURN * spread[valid]))
            angle = TURN * (seen[valid] - np.rint(seen[valid]))
            means.append(complex(np.vdot(part, np.cos(angle)), np.vdot(part, np.sin(angle))) / np.vdot(part, part))
            places.append((1.0, top + SIDE / 2, left + SIDE / 2))
    if len(means) < FEWEST_TILES:
        return None
    crowding = np.array(means)
    middle = float(crowding.real.mean())
    by_chance = float(np.sqrt(np.mean(crowding.imag**2) / len(means)))
    if middle < SIGNIFICANT * by_chance or not LEAST < middle / np.pi < MOST:
        return None
    inverse = crowding.real * (1 + 0.5 * crowding.real**2) / np.pi  # of J1
    return np.asarray(np.linalg.lstsq(np.array(places), inverse, rcond=None)[0])


def _begins(size: int) -> NDArray[np.intp]:
    """Where tiles begin, evenly over the image."""
    return np.linspace(0, max(size - SIDE, 0), TILES).astype(np.intp)
