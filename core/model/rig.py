"""The devices of a rig, their interior orientation, and the project that holds them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from core.model.arrays import Array

INTERIOR_NAMES = ("c", "x0", "y0", "A1", "A2", "A3", "A4", "A5", "A6")


@dataclass(frozen=True)
class DeviceSpec:
    """A camera or projector before calibration: its pixel (or line) raster and the maker's focal length."""

    width: int
    height: int
    pitch_mm: tuple[float, float]
    nominal_c_mm: float
    r0_mm: float | None = None

    @property
    def zero_radius_mm(self) -> float:
        """Where the radial parameters are zero: the given r0, else 2/3 of half the image diagonal."""
        if self.r0_mm is not None:
            return self.r0_mm
        return float(np.hypot(self.width * self.pitch_mm[0], self.height * self.pitch_mm[1]) / 3)


@dataclass(frozen=True)
class Interior:
    """Interior orientation (c, x0, y0) and the six additional parameters A1..A6 of a device."""

    c_mm: float
    x0_mm: float = 0.0
    y0_mm: float = 0.0
    a: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    r0_mm: float = 0.0

    @property
    def vector(self) -> Array:
        """(c, x0, y0, A1..A6) as an array of shape (9,)."""
        return np.array([self.c_mm, self.x0_mm, self.y0_mm, *self.a])

    @staticmethod
    def from_vector(values: Array, r0_mm: float) -> Interior:
        """Make the orientation from (c, x0, y0, A1..A6), shape (9,)."""
        c, x0, y0, a1, a2, a3, a4, a5, a6 = (float(v) for v in values)
        return Interior(c, x0, y0, (a1, a2, a3, a4, a5, a6), r0_mm)


@dataclass(frozen=True)
class ScaleBar:
    """A measured distance between two targets of the testfield, (row, col) each."""

    start: tuple[int, int]
    stop: tuple[int, int]
    length_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class Project:
    """A project folder: the rig and the list of its captures (folders; read each with `core.project`)."""

    path: Path
    name: str
    camera: DeviceSpec
    projector: DeviceSpec
    scale: ScaleBar | None
    captures: tuple[Path, ...]
    reference: str | None = None  # a published experiment this rig repeats: a file name in resources/reference
