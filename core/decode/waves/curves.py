"""Response curves: how much light a projector makes of a level, and what that makes of its waves.

A curve is a family of few parameters that contains all power laws and bends into S-shapes:

    g'(l) = l^(p-1) (1-l)^(q-1) exp(a1 T1(2l-1) + a2 T2(2l-1) + a3 T3(2l-1)),   g(0) = 0, g(1) = 1

with Chebyshev polynomials T; it rises everywhere, and is a straight line where all parameters (ln p, ln q, a1, a2, a3)
are 0. Over the phase of a cosine, ``l = (1 + cos psi) / 2``, it is smooth also where a power law is steep, and its
terms there are the harmonics of the wave that the projector shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.model import Array
from core.patterns import Pattern, brightness, grey_reason, use_of

Waves = NDArray[np.complex128]

NODES = 256  # steps of half a period
PARAMETERS = 5
HIGHEST = 33  # harmonic that is counted
SPREAD = np.array([0.8, 0.3, 0.4, 0.5, 0.25])  # of the parameters over projectors, standard deviations
LEVELS = (1 - np.cos(np.pi * np.arange(NODES + 1) / NODES)) / 2
DISCRETE = 32.0  # lines: a wave of more lines is as good as continuous


@lru_cache(maxsize=1)
def _middles() -> tuple[Array, Array, Array]:
    """Logarithms of level and 1 - level in the middles between `LEVELS`, and the polynomials there with the slope."""
    psi = np.pi * (np.arange(NODES) + 0.5) / NODES
    x = -np.cos(psi)
    return np.log((1 + x) / 2), np.log((1 - x) / 2), np.array([x, 2 * x**2 - 1, 4 * x**3 - 3 * x, np.log(np.sin(psi))])


@lru_cache(maxsize=1)
def _cosines() -> Array:
    """Matrix from light at `LEVELS` to the amplitudes of the harmonics of the wave, shape (HIGHEST + 1, NODES + 1)."""
    weight = np.full(NODES + 1, 1.0 / NODES)
    weight[[0, -1]] /= 2
    psi = np.pi * (1 - np.arange(NODES + 1) / NODES)  # level 0 is half a period from the crest
    return np.cos(np.outer(np.arange(HIGHEST + 1), psi)) * weight


def light_of(parameters: Array) -> Array:
    """Light (0 to 1) at `LEVELS` by the family's curve.

    Examples
    --------
    >>> square = light_of(np.array([np.log(2.0), 0, 0, 0, 0]))
    >>> float(np.abs(square - LEVELS**2).max()) < 1e-4
    True
    """
    low, high, terms = _middles()
    p, q, *a = parameters
    slope = np.exp(np.expm1(p) * low + np.expm1(q) * high + np.array([*a, 1.0]) @ terms)
    light = np.concatenate([[0.0], np.cumsum(slope)])
    return np.asarray(light / light[-1])


def light_at(table: Array, level: Array) -> Array:
    """Light at any levels (0 to 1) of a curve tabulated at `LEVELS`."""
    return np.asarray(np.interp(_places(level), np.arange(NODES + 1), table))


def _places(level: Array) -> Array:
    """Where levels lie among `LEVELS`."""
    return np.asarray(np.arccos(np.clip(1 - 2 * np.asarray(level, float), -1, 1)) * (NODES / np.pi))


def waves(patterns: Sequence[Pattern], period: float, table: Array) -> Waves:
    """What frames show over a period: the terms of ``exp(2 pi i m (u + 1/2) / P)``, m = 0 to HIGHEST.

    Of whole lines without blur, (frames, HIGHEST + 1), from the light at `LEVELS`; beside square waves of whole lines,
    whatever fits them.
    """
    return _waves(tuple(patterns), float(period), table.tobytes())


@lru_cache(maxsize=256)  # every search for a response begins with the same
def _waves(patterns: tuple[Pattern, ...], period: float, curve: bytes) -> Waves:
    table = np.frombuffer(curve)
    m = np.arange(HIGHEST + 1)
    lines = round(period)
    square = any(use_of(p) == "phase" and grey_reason(p) is None for p in patterns)
    if (period <= DISCRETE or square) and abs(period - lines) < 1e-6:
        places, terms = _of_lines(patterns, period)
        return _fixed(np.asarray(np.interp(places, np.arange(NODES + 1), table) @ terms, complex))
    even = _cosines() @ table * np.sinc(m / period)
    shift = np.array([getattr(p, "shift_rad", 0.0) for p in patterns])
    return _fixed(np.asarray(even * np.exp(-1j * np.outer(shift, m)), complex))


@lru_cache(maxsize=32)
def _of_lines(patterns: tuple[Pattern, ...], period: float) -> tuple[Array, Waves]:
    """Where among `LEVELS` whole lines of a period are, (frames, lines), and what leads from their light to terms."""
    lines, m = np.arange(round(period)), np.arange(HIGHEST + 1)
    turned = np.exp(-2j * np.pi * np.outer(lines + 0.5, m) / period)
    terms = np.asarray(turned * (np.sinc(m / period) / period), complex)
    return _places(np.array([brightness(p, lines) for p in patterns])), terms


def _fixed(terms: Waves) -> Waves:
    terms.setflags(write=False)
    return terms


def dimming(period: float, blur: float) -> Array:
    """What is left of every harmonic after a Gaussian blur of variance `blur` (lines²), shape (HIGHEST + 1,)."""
    return np.asarray(np.exp(-2 * (np.pi * np.arange(HIGHEST + 1) / period) ** 2 * max(blur, 0.0)))


def both_sides(terms: Waves) -> Waves:
    """Terms from -HIGHEST to HIGHEST of those from 0 on, of waves that are real."""
    return np.concatenate([terms[..., :0:-1].conj(), terms], axis=-1)
