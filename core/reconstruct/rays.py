"""The viewing directions of all camera pixels, worked out once per calibration."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from core.geometry import ray_directions
from core.model import Array, DeviceSpec, Floats, Interior
from core.parallel import run_in_bands

NODES = 20
ROUNDING = 1e-9  # of a direction, a sixtieth of float32's
ROWS_AT_ONCE = 32  # their float64 work arrays stay in the processor's cache


@lru_cache(maxsize=3)
def camera_rays(spec: DeviceSpec, interior: Interior) -> Floats:
    """Give X and Y of the directions, Z = -1, in which a camera's pixels look, distortion removed: (H, W, 2) float32.

    NaN where the distortion cannot be inverted. Rounding to float32 moves a point at 1 m by less than 0.06 µm per unit
    of direction. Read-only, shared between callers.
    """
    rays = np.empty((spec.height, spec.width, 2), np.float32)
    columns, rows = np.arange(float(spec.width)), np.arange(float(spec.height))
    smooth = _smooth(spec, interior)

    def band(start: int, stop: int) -> None:
        for first in range(start, stop, ROWS_AT_ONCE):
            last = min(first + ROWS_AT_ONCE, stop)
            some = rows[first:last]
            rays[first:last] = _exact(spec, interior, columns, some) if smooth is None else smooth(columns, some)

    run_in_bands(band, spec.height, ROWS_AT_ONCE)
    rays.setflags(write=False)
    return rays


def _exact(spec: DeviceSpec, interior: Interior, columns: Array, rows: Array) -> Array:
    return ray_directions(spec, interior, np.stack(np.meshgrid(columns, rows), axis=-1))[..., :2]


def _smooth(spec: DeviceSpec, interior: Interior) -> Callable[[Array, Array], Array] | None:
    """Polynomials through exact directions at `NODES` places along either side; None where they do not hold between.

    They take a tenth of the time of inverting the distortion for every pixel.
    """
    if min(spec.width, spec.height) < NODES:
        return None
    at = np.cos(np.pi * np.arange(NODES) / (NODES - 1))  # Chebyshev's: no overshoot at the ends
    size = np.array([spec.width - 1, spec.height - 1]) / 2
    order = np.arange(NODES)
    inverse = np.linalg.inv(np.cos(order * np.arccos(at)[:, None]))

    def weights(places: Array, half: float) -> Array:
        return np.cos(order * np.arccos(np.clip(places / half - 1, -1, 1))[:, None]) @ inverse

    nodes = np.moveaxis(_exact(spec, interior, size[0] * (1 + at), size[1] * (1 + at)), -1, 0)

    def directions(columns: Array, rows: Array) -> Array:
        return np.moveaxis(weights(rows, size[1]) @ nodes @ weights(columns, size[0]).T, 0, -1)

    between = 1 + np.cos(np.pi * (order[1:] - 0.5) / (NODES - 1))
    columns, rows = size[0] * between, size[1] * between
    off = np.abs(directions(columns, rows) - _exact(spec, interior, columns, rows))
    return directions if np.all(off < ROUNDING) else None  # never where the distortion cannot be inverted


def flat(vectors: Floats) -> Floats:
    """View (H, W, k) as (H, W k): loops over pixels are compiled for several at once if their distance is known."""
    return vectors.reshape(len(vectors), -1)
