"""Sine fringes of evenly bright lines through little blur, by the renderer of `conftest.py`."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import decode
from core.decode.ripple import take_ripple_out
from core.patterns import gray_and_phase

N = 640


def ripple(error: np.ndarray, u: np.ndarray) -> float:
    """Amplitude of what follows the place within lines."""
    good = np.isfinite(error)
    return float(abs(2 * np.mean(error[good] * np.exp(2j * np.pi * u[good]))))


@pytest.mark.parametrize(("period", "steps"), [(8, 4), (16, 8), (20, 5)])
def test_lines_that_are_seen_leave_a_tenth_of_their_ripple(bench, period: int, steps: int) -> None:
    """A closed form says what is there to take out; sigmas hold afterwards."""
    b = bench(height=200, blur=0.3, dark=0.2)
    patterns = gray_and_phase("x", N, cell=period // 2, periods=[period], steps=steps)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    copies = [np.exp(-2 * (np.pi * b.blur) ** 2 * (1 + s * 2 / period)) / (1 + s / period) for s in (-1, 1)]
    there = sum(copies) / (2 * np.pi)
    error = phase.u - b.u
    assert there > 0.04
    assert ripple(error, b.u) < 0.1 * there
    assert 0.9 < np.sqrt(np.nanmean((error / phase.sigma_u) ** 2)) < 1.1


def test_coordinates_without_ripple_stay_as_they_are() -> None:
    """Scenes at rest with the lines, in step with them, or seen in dots; noise of a third of a line."""
    rng, (y, x) = np.random.default_rng(4), np.mgrid[:300, :400]
    for slope in (0.3517, 0.5, 1.0, 1.003):
        for noise in (0.01, 0.3):
            u = (40.3 + slope * x + 0.01 * y + noise * rng.standard_normal(x.shape)).astype(np.float32)
            u[np.hypot(x % 20 - 10, y % 20 - 10) > 5] = np.nan
            before = u.copy()
            take_ripple_out(u, np.full(u.shape, noise, np.float32))
            np.testing.assert_array_equal(u, before)
