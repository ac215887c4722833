"""What virtual devices look at: a scene of the virtual bench, or a flat board rendered in a millisecond."""

from __future__ import annotations

from dataclasses import field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.devices.protocol import Pixels, refuse_grey
from core.lazy import dataclass
from core.model import Array
from core.patterns import Pattern, axis_of, brightness

Lines = NDArray[np.bool_]


class Scene(Protocol):
    """Something that a virtual projector lights and a virtual camera sees."""

    @property
    def camera_size(self) -> tuple[int, int]:
        """Width and height, px."""

    @property
    def projector_size(self) -> tuple[int, int]:
        """Columns and rows, lines."""

    @property
    def bits(self) -> int:
        """How many bits of a grey value are used."""

    @property
    def sequence(self) -> tuple[Pattern, ...] | None:
        """The sequence it is made for; None: the reference sequence of its size."""

    def refusal(self, pattern: Pattern) -> str | None:
        """Why the projector of this scene cannot show a pattern; None if it can."""

    def frame(self, pattern: Pattern, seed: int) -> Pixels:
        """Render the scene lit by a pattern."""

    def frame_lines(self, columns: Lines, rows: Lines, seed: int) -> Pixels:
        """Render the scene lit by column lines XOR row lines."""


@dataclass(frozen=True)
class FlatScene:
    """A board with dots that fills the view, seen askew, without lenses: for trying devices, not for measuring.

    Every pixel sees projector coordinates (u, v) that are linear in its own; lines are blurred by `blur_lines`. The
    grey value is ``albedo (ambient + gain (light))`` with noise of `noise` grey values.

    Examples
    --------
    >>> from core.patterns import White
    >>> FlatScene().frame(White(), seed=1).shape
    (72, 96)
    """

    camera_size: tuple[int, int] = (96, 72)
    projector_size: tuple[int, int] = (64, 64)
    bits: int = 8
    grey: bool = True
    blur_lines: float = 0.5
    noise: float = 1.0
    lamp: float = 150.0
    ambient: float = 15.0
    shift_px: float = 0.0
    sequence: tuple[Pattern, ...] | None = None
    maps: tuple[Array, Array, Array] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        (w, h), (columns, rows) = self.camera_size, self.projector_size
        y, x = np.mgrid[0:h, 0:w].astype(float)
        s, t = (x + self.shift_px) / w, y / h
        u = columns * (0.06 + 0.86 * s + 0.05 * t) - 0.5
        v = rows * (0.05 - 0.03 * s + 0.90 * t) - 0.5
        dots = (np.cos(2 * np.pi * 7 * s) + np.cos(2 * np.pi * 5 * t)) > 1.2
        object.__setattr__(self, "maps", (u, v, np.where(dots, 0.45, 1.0) * (0.9 - 0.25 * s * t)))

    def refusal(self, pattern: Pattern) -> str | None:
        return None if self.grey else refuse_grey(pattern)

    def frame(self, pattern: Pattern, seed: int) -> Pixels:
        axis = axis_of(pattern) or "x"
        lines = brightness(pattern, np.arange(self.projector_size[0 if axis == "x" else 1]))
        return self._expose(self._sample(lines, axis), seed)

    def frame_lines(self, columns: Lines, rows: Lines, seed: int) -> Pixels:
        a, b = self._sample(columns.astype(float), "x"), self._sample(rows.astype(float), "y")
        return self._expose(a + b - 2 * a * b, seed)

    def _sample(self, lines: Array, axis: str) -> Array:
        reach = int(np.ceil(3 * self.blur_lines))
        kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / self.blur_lines) ** 2)
        soft = np.convolve(np.pad(lines, reach, mode="edge"), kernel / kernel.sum(), mode="valid")
        return np.interp(self.maps[0 if axis == "x" else 1], np.arange(len(lines)), soft)

    def _expose(self, light: Array, seed: int) -> Pixels:
        gain = 2 ** (self.bits - 8)
        signal = gain * self.maps[2] * (self.ambient + self.lamp * light)
        noisy = signal + gain * self.noise * np.random.default_rng(seed).standard_normal(light.shape)
        grey = np.clip(np.rint(noisy), 0, 2**self.bits - 1)
        return grey.astype(np.uint8 if self.bits <= 8 else np.uint16)
