"""What an image shows at places of a board's lattice: dots, however faint, or bare ground.

Where there is neither, something covers the board, its light or the image ends, or the board itself does.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.measure.identity.blobs import SMALLEST_PX
from core.model import Array, Floats
from core.numerics import MEDIAN_OF_NORMAL, four_pixels, from_neighbours

STANDS_OUT = 6.0  # a faint dot stands out from its surroundings by so many sigmas
OUT = (0.5, 0.65, 0.8, 1.0)  # of the way to within a dot
ACROSS = (-0.3, -0.15, 0.0, 0.15, 0.3)  # steps beside it, whose mean is looked at
FINE = 0.8  # px of the reduced image by which the ground is smoothed: noise counts less, and dots stay where they are
INSIDE = 0.6  # radii from a dot's centre to where bare ground must reach: its edge is blurred
BETWEEN = 12  # places between dots that foretell the ground beyond them
AS_LIT, SIGMAS = 0.12, 4.0  # of its light, and of the noise, that bare ground may be off what those between dots show
MOSTLY = 0.5  # of the places beside a line of dots: what covers the rest may be as bright in some
TELLING = 3.0  # times as much light as that, for lit ground to be told from darkness

Lattice = Callable[[Array], Array]  # image of cells (n, 2), row and column or between them, px


@dataclass(frozen=True)
class Reduced:
    """An image in which dots are bright, reduced as their size allows, and smoothed to what is as large as they are."""

    fine: Floats
    smooth: Floats
    factor: int  # px of the image a pixel of it
    noise: tuple[float, float]  # sigma of fine and smooth values
    dark: float  # the value without light
    size: tuple[int, int]  # of the image, width and height

    def at(self, uv: Array) -> Array:
        """Fine values (...) at places (..., 2) px, NaN outside the image."""
        rows, columns, weight = four_pixels(self.fine.shape, (uv + 0.5) / self.factor - 0.5)
        return np.asarray((weight * self.fine[rows, columns]).sum(axis=0)).reshape(uv.shape[:-1])


def reduced(grey: Floats, factor: int) -> Floats:
    """Means over factor × factor pixels."""
    size = (max(1, grey.shape[1] // factor), max(1, grey.shape[0] // factor))
    return grey if factor == 1 else np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.float32)


def noise_of(image: Floats) -> float:
    """Noise of an image in grey values, from second differences along its rows."""
    return float(np.median(np.abs(np.diff(image, 2)))) / (MEDIAN_OF_NORMAL * np.sqrt(6))


def reduced_to(grey: Floats, radius_px: float, *, dark: bool) -> Reduced:
    """Reduce an image in which dots of a radius are bright; it is turned over where they are `dark`."""
    factor = max(1, int(radius_px / SMALLEST_PX))
    small = reduced(grey, factor)
    sigma = max(0.5 * radius_px / factor, 0.7)
    noise = noise_of(small) / (2 * np.sqrt(np.pi))
    fine, smooth = (np.asarray(cv2.GaussianBlur(small, (0, 0), s), np.float32) for s in (FINE, sigma))
    darkness = float(smooth.max() if dark else smooth.min())
    return Reduced(fine, smooth, factor, (noise / FINE, noise / sigma), darkness, grey.shape[::-1])


def dots_at(image: Reduced, uv: Array, unit: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where dots are, however faint, at places (n, 2) px; and where the image can tell.

    A dot is brighter than what is round it in every direction, which edges of board and light are not. `unit` (n, 2, 2)
    maps the unit disc to its image, px.
    """
    angle = np.arange(8) * np.pi / 4
    ring = 1.8 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    grid = np.linspace(-0.8, 0.8, 5)
    tries = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    on_board = tries[:, None, :] + np.concatenate([np.zeros((1, 2)), ring])
    at = uv[:, None, None, :] + np.einsum("nij,tkj->ntki", unit, on_board)
    with np.errstate(invalid="ignore"):
        inside = np.all((at > 0) & (at < np.array(image.size) - 1.0), axis=(1, 2, 3))
    place = (np.where(inside[:, None, None, None], at, 0.0) + 0.5) / image.factor - 0.5
    u, v = np.rint(place).astype(np.int64).reshape(-1, 2).T
    height, width = image.smooth.shape
    value = image.smooth[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)].reshape(place.shape[:3])
    stands_out = (value[:, :, 0] - value[:, :, 1:].max(axis=2)).max(axis=1)
    return inside & (stands_out > max(STANDS_OUT * image.noise[1], 0.25)), inside


def bare_ground(image: Reduced, lattice: Lattice, there: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """Which cells next to dots show the board's ground, as it is lit there, to well within where a dot would be.

    `there`, (rows, columns), says which cells have a dot; its `radius` is in steps of the lattice.
    """
    cells = np.moveaxis(np.indices(there.shape), 0, -1)
    ways = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
    between = np.concatenate([cells[there & _beside(there, -way)] + way / 2 for way in ways[:2]])
    level = image.at(lattice(between))
    between, level = between[np.isfinite(level)], level[np.isfinite(level)]
    bare = np.zeros(there.shape, bool)
    if len(between) < BETWEEN:
        return bare
    spread = (1 / len(ACROSS) + 2 / BETWEEN) ** 0.5  # of the mean, and of what is foretold
    along = np.array(OUT) * (1 - INSIDE * radius)
    for way in ways:
        free = np.argwhere(~there & _beside(there, way))
        if not len(free):
            continue
        out = (along[:, None, None] - 1) * way + np.array(ACROSS)[:, None] * way[::-1]
        places = free[:, None, None] + out
        level_there, slope = from_neighbours(between, level[:, None], free.astype(float), BETWEEN)
        expected = level_there + slope[..., 0] @ out.mean(axis=1).T
        seen = image.at(lattice(places.reshape(-1, 2)).reshape(places.shape)).mean(axis=2)
        light = np.abs(expected - image.dark)
        off = AS_LIT * light + SIGMAS * image.noise[0] * spread
        alike = ((np.abs(seen - expected) < off) & (light > TELLING * off)).all(axis=1)
        line = free @ np.abs(way)
        told = np.isfinite(seen).all(axis=1)
        share = np.bincount(line, alike) / np.maximum(np.bincount(line, told), 1)
        bare[tuple(free.T)] |= alike & (share[line] > MOSTLY)
    return bare


def _beside(there: NDArray[np.bool_], way: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which cells have a dot one step back."""
    wide = np.pad(there, 1)
    return wide[1 - way[0] : wide.shape[0] - 1 - way[0], 1 - way[1] : wide.shape[1] - 1 - way[1]]
