"""The low-pass of the coordinate maps: noise goes, slope, curvature, borders and gaps stay."""

from __future__ import annotations

import numpy as np
import pytest

from core.calibrate.depth_smooth import smooth_maps

H, W = 120, 160
COLUMNS, ROWS = np.meshgrid(np.arange(W), np.arange(H))
MAP = 600 * (0.4 * COLUMNS + 0.02 * ROWS + 20) / (W + 0.2 * COLUMNS - 0.1 * ROWS)  # a plate seen through two pinholes


def _noisy(sigma: float = 0.05, seed: int = 3) -> np.ndarray:
    return (MAP + np.random.default_rng(seed).normal(0, sigma, MAP.shape)).astype(np.float32)


def _first_of_two(measured: np.ndarray, sigma_px: float) -> np.ndarray:
    """Smooth a map that comes with a second one, of the plate 10 lines further on."""
    return smooth_maps(np.stack([measured, (MAP + 10).astype(np.float32)]), sigma_px)[0]


def test_the_noise_falls_as_a_gaussian_of_that_width_averages() -> None:
    for sigma_px in (1.5, 3.0):
        rest = _first_of_two(_noisy(), sigma_px) - MAP
        inner = rest[20:-20, 20:-20]
        # independent noise under a Gaussian: divided by 2 sigma sqrt(pi)
        assert np.std(inner) == pytest.approx(0.05 / (2 * sigma_px * np.sqrt(np.pi)), rel=0.12)
        assert np.abs(rest).max() < 0.05  # borders too, where half of the Gaussian is missing


def test_a_sloping_map_is_not_bent_at_borders_and_gaps() -> None:
    exact = MAP.astype(np.float32)
    exact[50:70, 60:90] = np.nan
    rest = _first_of_two(exact, 4.0) - MAP
    assert np.nanmax(np.abs(rest)) < 0.005  # the map rises by 2 lines a pixel: a plain Gaussian would be 6 off


def test_small_gaps_are_filled_and_large_ones_are_not() -> None:
    gaps = _noisy(0.01)
    gaps[60:62, 80:82] = np.nan
    gaps[20:50, 20:50] = np.nan
    smoothed = _first_of_two(gaps, 3.0)
    np.testing.assert_allclose(smoothed[60:62, 80:82], MAP[60:62, 80:82], atol=0.01)
    assert np.isnan(smoothed[25:45, 25:45]).all()


def test_pixels_off_the_plate_stay_and_do_not_spread() -> None:
    measured = np.stack([_noisy(0.01), (MAP + 10).astype(np.float32)])
    measured[:, :, :40] = 555.0  # a wall behind the plate, which does not move
    measured[0, :20] = 1500.0  # something else that moves
    measured[0, 60, 100] += 8.0  # a wrong code
    smoothed, measured = smooth_maps(measured, 3.0)[0], measured[0]
    np.testing.assert_array_equal(smoothed[:20], measured[:20])
    np.testing.assert_array_equal(smoothed[20:, :40], 555.0)
    assert smoothed[60, 100] == measured[60, 100]
    rest = np.abs(smoothed - MAP)
    rest[60, 100] = 0
    assert rest[20:, 40:].max() < 0.012


def test_no_width_means_no_change() -> None:
    maps = _noisy()[None]
    assert smooth_maps(maps, 0.0) is maps
