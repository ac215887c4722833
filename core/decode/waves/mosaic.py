"""What phases err otherwise in every kind of pixel of a colour camera's mosaic, seen between neighbours and taken out.

Grey values interpolated from a mosaic of filters are blurred otherwise in even and odd rows and columns. What a
response adds to the fringes is dimmed otherwise there, and so is what it bends of their phases: a wave of N or 2 N
cycles a period, N being the steps, has one size in each of the four kinds of pixel. A surface does not alternate from
pixel to pixel: what does, and follows the phase the same way all over the image, are such waves.
"""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np

from core.decode.chosen import middles
from core.decode.tables import Singles
from core.decode.waves.folded import (
    DEGREE,
    FEWEST,
    FULL,
    GROSS,
    LEAST,
    SEEN,
    SHOWN,
    Wave,
    Windows,
    slopes_of,
    subtract,
    waves_by,
)
from core.model import Array
from core.numerics import MEDIAN_OF_NORMAL, polynomial, row_median
from core.parallel import run_in_bands

Kind = tuple[int, int]

TILES, SMALLEST, SIDE = 12, 8, 16  # of the image along each axis, pixels along each of these, and those looked at
KINDS: tuple[Kind, ...] = (
    (1, 0),
    (0, 1),
    (1, 1),
)  # whether the sign of a wave changes from column to column, and from row to row


def take_kinds_out(u: Singles, periods: list[tuple[float, int]]) -> float:
    """Correct, in place, coordinates, shape (H, W), lines, for waves of the phases of `periods` (lines) in N steps.

    What tiles show of them besides is given, as a variance (lines²).
    """
    found, left = _find_kinds(u, periods)
    for period in {wave.period for _, wave in found}:
        for down, right in product(range(2), repeat=2):
            mine = [
                wave.turned if (across * right + along * down) % 2 else wave
                for (across, along), wave in found
                if wave.period == period
            ]
            kind = u[down::2, right::2]
            run_in_bands(partial(subtract, kind, mine, period), len(kind))
    return left


def _find_kinds(u: Singles, periods: list[tuple[float, int]]) -> tuple[list[tuple[Kind, Wave]], float]:
    """Waves whose sign changes from pixel to pixel, with how it does, if worth it, and what is left of them."""
    steep = float(np.hypot(*slopes_of(u)))
    waves = [
        (period, order)
        for period, steps in periods
        for order in (steps, 2 * steps)
        if order / period < SHOWN and 0 < order / period * steep < SEEN
    ]
    told = _tiles(u, waves) if waves and min(u.shape) >= TILES * SMALLEST else None
    if told is None:
        return [], 0.0
    found, left = waves_by(told, len(KINDS) * waves, periods)
    return [(KINDS[n // len(waves)], wave) for n, wave in found], left


def _tiles(u: Singles, waves: list[tuple[float, int]]) -> Windows | None:
    """What tiles of the image tell of waves of every kind: by how much pixels differ from the mean of their neighbours
    to both sides, and of those above and below; None where few have coordinates."""
    sides = [min(SIDE, size // TILES) for size in u.shape]
    firsts = [np.linspace(0, size - side, TILES).astype(int) for size, side in zip(u.shape, sides, strict=True)]
    rows, columns = (first[:, None] + np.arange(side) for first, side in zip(firsts, sides, strict=True))
    at = rows[:, None, :, None], columns[None, :, None, :]
    place = u[at].reshape(-1, *sides)
    centres = (middles(at + side // 2, size) for at, side, size in zip(firsts, sides, u.shape, strict=True))
    down, across = (each.ravel() for each in np.meshgrid(*centres, indexing="ij"))
    full = np.isfinite(place).mean(axis=(1, 2)) >= FULL
    if np.count_nonzero(full) < FEWEST:
        return None
    below, right = (np.broadcast_to(1 - 2 * (each % 2), u[at].shape).reshape(place.shape)[full] for each in at)
    place = place[full]
    turns = np.float32(2 * np.pi) * (np.nan_to_num(place) + np.float32(0.5))
    shapes = np.array([f(np.float32(k / p) * turns) for p, k in waves for f in (np.cos, np.sin)])
    signs = np.array([right**i * below**j for i, j in KINDS], np.float32)
    shapes = (signs[:, None] * shapes).reshape(-1, *place.shape).swapaxes(0, 1)
    normal, seen = np.zeros((len(place), shapes.shape[1], shapes.shape[1])), np.zeros(shapes.shape[:2])
    for axis in (-1, -2):
        away, design = (_beside(each, axis) for each in (place, shapes))
        away, design = away.reshape(len(place), -1), design.reshape(*seen.shape, -1)
        scale = np.maximum(np.nan_to_num(row_median(np.abs(away))) / MEDIAN_OF_NORMAL, LEAST).astype(np.float32)[
            :, None
        ]
        weight = (np.abs(away) < GROSS * scale) / np.square(scale)
        weighted = design * weight[:, None]
        normal += weighted @ design.transpose(0, 2, 1)
        seen += (weighted @ np.nan_to_num(away)[..., None])[..., 0]
    return Windows(normal, seen, polynomial(across, down, DEGREE)[full])


def _beside(values: Array, axis: int) -> Array:
    """Values less the mean of those to either side along an axis."""
    values = np.moveaxis(values, axis, -1)
    return np.asarray(values[..., 1:-1] - (values[..., 2:] + values[..., :-2]) / 2)
