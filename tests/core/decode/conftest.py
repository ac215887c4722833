"""A forward model of its own: patterns as light over continuous lines, blurred, with noise, in grey values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import erf

from core.model import PhaseMap
from core.patterns import Pattern, brightness

Array = NDArray[np.float64]
FINE = 32  # steps a line of what is tabulated


@dataclass(frozen=True)
class Bench:
    """What a camera sees: ambient light plus `gain` times the blurred pattern, var = dark + shot g, quantised."""

    u: Array
    v: Array | None = None
    lines: tuple[int, int] = (640, 640)
    blur: float = 0.6
    ambient: float = 15.0
    gain: float = 70.0
    dark: float = 4.0
    shot: float = 0.0
    bits: int = 8
    shift: int = 0
    seed: int = 1

    def light(self, pattern: Pattern) -> Array:
        """Part of full light at every pixel: rectangular lines, blurred by a Gaussian of `blur` lines; none outside."""
        axis = getattr(pattern, "axis", None)
        if axis is None:
            across = np.ones_like(self.u) if self.v is None else self._blurred(pattern, 1)
            return across * self._blurred(pattern, 0)
        return self._blurred(pattern, int(axis == "y"))

    def _blurred(self, pattern: Pattern, way: int) -> Array:
        profile = _profile(pattern, self.lines[way], self.blur)
        below, part = self._places[way]
        return profile[below] + part * (profile[below + 1] - profile[below])

    @cached_property
    def _places(self) -> list[tuple[NDArray[np.intp], Array]]:
        """Where in the tables each pixel looks, along either axis: the entry below, and how far beyond it."""
        found = []
        for place, count in zip([self.u] if self.v is None else [self.u, self.v], self.lines, strict=False):
            at = np.clip((place + 10) * FINE, 0, (count + 20) * FINE - 2)
            below = at.astype(np.intp)
            found.append((below, at - below))
        return found

    def take(self, patterns: Sequence[Pattern]) -> list[NDArray[np.uint8] | NDArray[np.uint16]]:
        """One image per pattern."""
        rng = np.random.default_rng(self.seed)
        images = []
        for pattern in patterns:
            grey = self.ambient + self.gain * self.light(pattern)
            noise = rng.standard_normal(grey.shape)
            noise *= np.sqrt(self.dark + self.shot * grey) if self.shot else np.sqrt(self.dark)
            grey += noise
            np.clip(np.rint(grey, out=grey), 0, 2**self.bits - 1, out=grey)
            whole = grey.astype(np.uint8 if self.bits <= 8 else np.uint16)
            images.append(whole << self.shift)
        return images


@lru_cache(maxsize=256)
def _profile(pattern: Pattern, count: int, blur: float) -> Array:
    """Light of a pattern in steps of a line over FINE, from 10 lines before the first to 10 after the last."""
    shown = brightness(pattern, np.arange(count))
    rises = np.zeros((count + 20) * FINE)
    rises[np.arange(10 * FINE - FINE // 2, (count + 10) * FINE, FINE)] = np.diff(np.concatenate([[0.0], shown, [0.0]]))
    reach = int(8 * blur * FINE) + 1
    edge = np.diff(0.5 * (1 + erf(np.arange(-reach - 1, reach + 1) / (FINE * blur * np.sqrt(2)))))
    size = 2 ** int(np.log2(len(rises) + len(edge)) + 1)
    blurred = np.fft.irfft(np.fft.rfft(rises, size) * np.fft.rfft(edge, size), size)
    return np.cumsum(blurred)[reach : reach + len(rises)]


def field(height: int, width: int, lines: float, margin: float = 4.0) -> Array:
    """A coordinate that runs over nearly all lines, at changing slopes, so that no phase is preferred."""
    y, x = np.mgrid[0:height, 0:width].astype(float)
    t = x / (width - 1)
    return margin + (lines - 1 - 2 * margin) * (t + 0.08 * np.sin(2 * np.pi * t) / np.pi) + 0.7 * np.sin(y / 5.3)


@dataclass(frozen=True)
class Score:
    """How a decoded coordinate compares with the truth."""

    valid: float
    gross: int
    sigma_ratio: float
    rms: float


def score(phase: PhaseMap, truth: Array, tolerance: float, axis: str = "x") -> Score:
    """Valid part, number of errors beyond `tolerance` lines, observed over predicted standard deviation of the rest."""
    place, sigma = (phase.u, phase.sigma_u) if axis == "x" else (phase.v, phase.sigma_v)
    good = np.isfinite(place)
    error = (place - truth)[good]
    fine = np.abs(error) <= tolerance
    z = error[fine] / sigma[good][fine]
    return Score(float(good.mean()), int((~fine).sum()), float(np.sqrt(np.mean(z**2))), float(error[fine].std()))


@pytest.fixture
def bench() -> Callable[..., Bench]:
    """Make a bench whose coordinate u runs over 640 lines in 40 × 1000 px, unless told otherwise."""

    def make(height: int = 40, width: int = 1000, count: int = 640, both: bool = False, **more: object) -> Bench:
        u = field(height, width, count)
        v = field(width, height, count).T if both else None
        return Bench(u, v, (count, count), **more)  # type: ignore[arg-type]

    return make


@pytest.fixture
def judge() -> Callable[..., Score]:
    """Compare with the truth."""
    return score
