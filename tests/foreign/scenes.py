"""What stands before the sensor: planes with dots or texture, and a relief. Each gives where rays meet it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tests.foreign.optics import Placed

Array = NDArray[np.float64]


def flat(x: Array, y: Array) -> Array:
    return np.zeros_like(x)


def evenly(x: Array, y: Array) -> Array:
    return np.full_like(x, 0.75)


@dataclass(frozen=True)
class Surface:
    """z = height(x, y) in its own frame, whose z points away from the sensor; albedo over (x, y), and light's share."""

    place: Placed
    half: tuple[float, float]
    height: Callable[[Array, Array], Array] = flat
    albedo: Callable[[Array, Array], Array] = evenly
    light: Callable[[Array, Array], Array] = lambda x, y: np.ones_like(x)

    def met_by(self, origin: Array, directions: Array) -> tuple[Array, Array, Array]:
        """Points in the world, their albedo (0 beyond the rim), and the unit normal towards the sensor."""
        o, d = self.place.to_own(origin), directions @ self.place.rotation
        t = -o[2] / d[..., 2]
        if self.height is not flat:
            for _ in range(12):  # a gentle relief: the step is a contraction
                x, y = o[0] + t * d[..., 0], o[1] + t * d[..., 1]
                t = (self.height(x, y) - o[2]) / d[..., 2]
        x, y = o[0] + t * d[..., 0], o[1] + t * d[..., 1]
        inside = (abs(x) < self.half[0]) & (abs(y) < self.half[1]) & (t > 0)
        normal = np.array([0.0, 0.0, -1.0])
        if self.height is not flat:
            e = 1e-3
            slope_x = (self.height(x + e, y) - self.height(x - e, y)) / (2 * e)
            slope_y = (self.height(x, y + e) - self.height(x, y - e)) / (2 * e)
            normal = np.stack([slope_x, slope_y, -np.ones_like(x)], axis=-1)
            normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        world = origin + t[..., None] * directions
        return world, np.where(inside, self.albedo(x, y), 0.0), normal @ self.place.rotation.T


@dataclass(frozen=True)
class Board:
    """A field of dots. `true` holds where they are (rows, columns, 2), mm; the file tells where they should be."""

    rows: int = 11
    columns: int = 15
    pitch_mm: float = 18.0
    diameter_mm: float = 9.0
    irregular_mm: float = 0.15
    white_on_black: bool = True
    soft_mm: float = 0.08
    seed: int = 5
    true: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        off = np.random.default_rng(self.seed).normal(size=(self.rows, self.columns, 2)) * self.irregular_mm
        object.__setattr__(self, "true", self.nominal() + off)

    def nominal(self) -> Array:
        row, column = np.mgrid[0 : self.rows, 0 : self.columns].astype(float)
        x, y = column - (self.columns - 1) / 2, row - (self.rows - 1) / 2
        return np.stack([x, y], axis=-1) * self.pitch_mm

    def albedo(self, x: Array, y: Array) -> Array:
        """Dots with a soft edge, so that few samples a pixel draw them evenly."""
        column = np.clip(np.round(x / self.pitch_mm + (self.columns - 1) / 2), 0, self.columns - 1).astype(int)
        row = np.clip(np.round(y / self.pitch_mm + (self.rows - 1) / 2), 0, self.rows - 1).astype(int)
        centre = self.true[row, column]
        rim = np.hypot(x - centre[..., 0], y - centre[..., 1]) - self.diameter_mm / 2
        dot = np.clip(0.5 - rim / (2 * self.soft_mm), 0, 1)
        return 0.06 + 0.74 * dot if self.white_on_black else 0.80 - 0.74 * dot

    def at(self, place: Placed) -> Surface:
        half = (self.columns * self.pitch_mm / 2 + 10, self.rows * self.pitch_mm / 2 + 10)
        return Surface(place, half, albedo=self.albedo)

    def csv(self) -> str:
        """testfield.csv; y up, as the contract has it."""
        lines = ["# polarity: " + ("white-on-black" if self.white_on_black else "black-on-white")]
        lines.append("row,col,x_mm,y_mm,z_mm,diameter_mm")
        nominal = self.nominal()
        for row, column in np.ndindex(self.rows, self.columns):
            x, y = nominal[row, column]
            lines.append(f"{row},{column},{x:.4f},{-y:.4f},0,{self.diameter_mm}")
        return "\n".join(lines) + "\n"
