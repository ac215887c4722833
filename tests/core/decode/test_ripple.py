"""Sine fringes of evenly bright lines through little blur, by the renderer of `conftest.py`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.decode import decode
from core.decode.waves.ripple import take_ripple_out
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


@pytest.mark.parametrize("blur", [0.02, 0.1, 0.2])
def test_sigmas_hold_where_phases_stand_still_over_lines(bench, blur: float) -> None:
    """So little blur leaves coordinates at the lines' middles: at 0.02 lines their errors are even over a line.

    From 0.2 lines on a part of the ripple is taken out, but all of it doubted.
    """
    y, x = np.mgrid[:200, :400]
    b = replace(bench(blur=blur, dark=0.2), u=30.3 + 0.21 * x + 0.017 * y)
    patterns = gray_and_phase("x", N, cell=8, periods=[16])
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    error = phase.u - b.u
    assert np.isfinite(error).mean() > 0.99
    assert 0.7 < np.sqrt(np.nanmean((error / phase.sigma_u) ** 2)) < 1.1


def test_ripple_that_changes_across_the_image_is_doubted_where_it_is_not_even(bench) -> None:
    """A lens that blurs the middle of the image least: what no plane follows is part of sigma."""
    y, x = np.mgrid[:200, :640]
    u = 30.3 + 0.51 * x + 0.017 * y
    parts = [replace(bench(blur=blur, dark=0.2, seed=k), u=u) for k, blur in enumerate((0.4, 0.25, 0.25, 0.4))]
    patterns = gray_and_phase("x", N, cell=4, periods=[8])
    quarters = [np.array_split(np.array(b.take(patterns)), 4, axis=2)[k] for k, b in enumerate(parts)]
    phase = decode(patterns, list(np.concatenate(quarters, axis=2)), lines=(N, N))
    assert 0.9 < np.sqrt(np.nanmean(((phase.u - u) / phase.sigma_u) ** 2)) < 1.1


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


def test_a_small_scene_in_step_with_the_lines_is_no_ripple() -> None:
    """All tiles were one, whose crowding then seemed to be sixteen times as certain."""
    y, x = np.mgrid[:48, :64]
    noise = 0.02 * np.random.default_rng(4).standard_normal(x.shape)
    u = (150 + y - 0.04 * x + 5 * np.sin(x / 80) + noise).astype(np.float32)
    before = u.copy()
    take_ripple_out(u, np.full(u.shape, 0.02, np.float32))
    np.testing.assert_array_equal(u, before)


def test_steps_of_whole_lines_over_pixels_of_whole_lines_are_no_ripple() -> None:
    """A pixel as wide as a line sees none; sigmas grew tenfold, and errors threefold."""
    y, x = np.mgrid[:300, :400]
    u = (40 + 2 * x + 5 * ((x // 37 + y // 29) % 3)).astype(np.float32)
    u += np.float32(0.03) * np.random.default_rng(4).standard_normal(u.shape, np.float32)
    before = u.copy()
    take_ripple_out(u, np.full(u.shape, 0.03, np.float32))
    np.testing.assert_array_equal(u, before)
