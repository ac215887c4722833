"""A forward model of its own: patterns as light over continuous lines, blurred, with noise, in grey values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

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
            across = np.ones_like(self.u) if self.v is None else _blurred(pattern, self.lines[1], self.blur, self.v)
            return across * _blurred(pattern, self.lines[0], self.blur, self.u)
        place, count = (self.u, self.lines[0]) if axis == "x" else (self.v, self.lines[1])
        assert place is not None
        return _blurred(pattern, count, self.blur, place)

    def take(self, patterns: Sequence[Pattern]) -> list[NDArray[np.uint8] | NDArray[np.uint16]]:
        """One image per pattern."""
        rng = np.random.default_rng(self.seed)
        images = []
        for pattern in patterns:
            grey = self.ambient + self.gain * self.light(pattern)
            grey = grey + rng.normal(size=grey.shape) * np.sqrt(self.dark + self.shot * grey)
            whole = np.clip(np.round(grey), 0, 2**self.bits - 1).astype(np.uint16) << self.shift
            images.append(whole.astype(np.uint8 if self.bits <= 8 else np.uint16))
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


def _blurred(pattern: Pattern, count: int, blur: float, place: Array) -> Array:
    profile = _profile(pattern, count, blur)
    at = np.clip((place + 10) * FINE, 0, len(profile) - 2)
    below = at.astype(np.intp)
    return profile[below] + (at - below) * (profile[below + 1] - profile[below])


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
