"""Devices after OpenCV's model: another lens formula, another frame and another way to solve it than the program's.

The frame has X right, Y down and looks along +Z. `u = fx x'' + cx`, `v = fy y'' + cy`, where (x'', y'') is the pinhole
image with k1, k2 (radial) and p1, p2 (tangential). What that is in c, x0, y0, A1..A6 follows in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def turned(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Array:
    """Rotation by degrees about x, then y, then z."""
    (cx, cy, cz), (sx, sy, sz) = (f(np.deg2rad([x, y, z])) for f in (np.cos, np.sin))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ about_y @ about_x


@dataclass(frozen=True)
class Placed:
    """Where something stands: ``world = rotation @ own + origin``, mm."""

    rotation: Array
    origin: Array

    def to_world(self, own: Array) -> Array:
        return own @ self.rotation.T + self.origin

    def to_own(self, world: Array) -> Array:
        return (world - self.origin) @ self.rotation


@dataclass(frozen=True, eq=False)
class Optics:
    """A camera, or a projector as an inverse camera."""

    width: int
    height: int
    pitch_mm: float
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    p1: float
    p2: float
    place: Placed

    def image(self, world: Array) -> Array:
        """Pixels (..., 2) of points in the world (..., 3)."""
        own = self.place.to_own(world)
        x, y = self._distorted(own[..., 0] / own[..., 2], own[..., 1] / own[..., 2])
        return np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=-1)

    def rays(self, u: Array, v: Array) -> Array:
        """Directions in the world, not of unit length, through pixels."""
        xd, yd = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        x, y = xd.copy(), yd.copy()
        for _ in range(8):  # each step gains more than a digit at 10 % of distortion
            x_seen, y_seen = self._distorted(x, y)
            x += xd - x_seen
            y += yd - y_seen
        return np.stack([x, y, np.ones_like(x)], axis=-1) @ self.place.rotation.T

    def _distorted(self, x: Array, y: Array) -> tuple[Array, Array]:
        r2 = x * x + y * y
        radial = 1 + r2 * (self.k1 + r2 * self.k2)
        return (
            x * radial + 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x),
            y * radial + 2 * self.p2 * x * y + self.p1 * (r2 + 2 * y * y),
        )

    def interior(self, r0_mm: float) -> dict[str, float]:
        """The same lens as c, x0, y0 (mm) and A1..A6 (powers of mm): exact, no fit."""
        scaled = self.pitch_mm * (self.fx + self.fy) / 2  # c reduced by what A1 and A2 give at the axis
        g = 1.0
        for _ in range(50):
            c = scaled / g
            a1, a2 = g * self.k1 / c**2, g * self.k2 / c**4
            g = 1 - a1 * r0_mm**2 - a2 * r0_mm**4
        a3 = (self.fx - self.fy) / (self.fx + self.fy)
        x0 = self.pitch_mm * (self.cx - (self.width - 1) / 2) / (1 + a3)
        y0 = -self.pitch_mm * (self.cy - (self.height - 1) / 2) / (1 - a3)
        return {
            "c_mm": c,
            "x0_mm": x0,
            "y0_mm": y0,
            "A1": a1,
            "A2": a2,
            "A3": a3,
            "A4": 0.0,
            "A5": -scaled * self.p1 / c**2,
            "A6": scaled * self.p2 / c**2,
        }

    def document(self) -> dict[str, object]:
        """As project.json has a device; its nominal c is 1 % off, as a data sheet's is."""
        return {
            "width": self.width,
            "height": self.height,
            "pitch_mm": [self.pitch_mm, self.pitch_mm],
            "nominal_c_mm": round(1.01 * self.pitch_mm * self.fx, 2),
        }


def optics(
    width: int,
    height: int,
    pitch_mm: float,
    c_mm: float,
    place: Placed,
    lens: tuple[float, float, float, float],
    off: tuple[float, float],
) -> Optics:
    """A device by c and pitch, its principal point `off` the middle by pixels; lens: k1, k2, p1, p2."""
    f = c_mm / pitch_mm
    return Optics(
        width, height, pitch_mm, f * 1.0003, f, (width - 1) / 2 + off[0], (height - 1) / 2 + off[1], *lens, place
    )


def looking(origin: Array, target: Array, roll: float = 0.0) -> Placed:
    """At `origin`, +Z towards `target`, Y as far down as can be, then rolled by degrees."""
    z = (target - origin) / np.linalg.norm(target - origin)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return Placed(np.stack([x, np.cross(z, x), z], axis=1) @ turned(z=roll), np.asarray(origin, float))
