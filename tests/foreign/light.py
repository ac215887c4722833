"""Patterns as the contract words them, and what a projector's and a camera's response make of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]
FINE = 32  # places at which light is tabulated within a line


def levels(pattern: dict[str, Any], count: int) -> Array:
    """What each of `count` lines was told, 0 to 1."""
    i = np.arange(count)
    kind = pattern["kind"]
    if kind in ("white", "black"):
        return np.full(count, float(kind == "white"))
    if kind == "level":
        return np.full(count, float(pattern["value"]))
    if kind == "lines":
        return np.array([float(value) for value in pattern["values"]])
    if kind == "line":
        return ((i >= pattern["index"]) & (i < pattern["index"] + pattern["width"])).astype(float)
    if kind == "phase":
        wave = np.cos(2 * np.pi * (i + 0.5) / pattern["period"] - pattern["shift_rad"])
        return 0.5 + 0.5 * wave if pattern["profile"] == "sine" else (wave > 0).astype(float)
    k = i // pattern["cell"]
    word = k ^ (k >> 1) if kind == "gray" else k
    on = (word >> (pattern["bits"] - 1 - pattern["bit"])) & 1
    return (on ^ pattern["inverse"]).astype(float)


def sequence(lines: tuple[int, int], period: float = 20.0, steps: int = 4, cell: int = 8) -> list[dict[str, Any]]:
    """White, black, and for each axis Gray bits and sine steps."""
    patterns: list[dict[str, Any]] = [{"kind": "white"}, {"kind": "black"}]
    for axis, count in zip("xy", lines, strict=True):
        bits = int(np.ceil(np.log2(np.ceil(count / cell))))
        code = {"kind": "gray", "axis": axis, "bits": bits, "cell": cell, "inverse": False}
        wave = {"kind": "phase", "axis": axis, "period": period, "steps": steps, "profile": "sine"}
        patterns += [code | {"bit": bit} for bit in range(bits)]
        patterns += [wave | {"step": k, "shift_rad": 2 * np.pi * k / steps} for k in range(steps)]
    return patterns


@dataclass(frozen=True)
class Light:
    """How a projector shines and a room is lit."""

    blur: float = 0.7  # standard deviation, lines
    gamma: float = 1.0
    grey: float = 150.0  # of a white surface at the working distance
    ambient: float = 12.0

    def table(self, pattern: dict[str, Any], count: int) -> Array:
        """Light over the places -1 to count, `FINE` a line: lines are blurred boxes; none is beyond the last."""
        told = np.pad(levels(pattern, count) ** self.gamma, 8)
        return gaussian_filter1d(np.repeat(told, FINE), self.blur * FINE, mode="constant")


@dataclass(frozen=True)
class Sensor:
    """How a camera turns light into grey values."""

    blur: float = 0.45  # standard deviation, pixels
    dark: float = 1.5  # grey values squared
    shot: float = 0.012  # grey values squared a grey value
    bits: int = 8
    gamma: float = 1.0

    def read(self, light: Array, rng: np.random.Generator) -> NDArray[Any]:
        """Grey values of light in units of 8-bit grey values."""
        top = 2**self.bits - 1
        grey = light + rng.standard_normal(light.shape, np.float32) * np.sqrt(self.dark + self.shot * light)
        grey = 255 * (np.clip(grey, 0, 255) / 255) ** self.gamma
        return np.clip(np.round(grey * top / 255), 0, top).astype(np.uint8 if self.bits <= 8 else np.uint16)
