"""The low-pass of the coordinate maps: noise goes, slope, curvature, borders and gaps stay."""

from __future__ import annotations

import numpy as np
import pytest

from core.calibrate.depth.smooth import smooth_maps

H, W = 120, 160
COLUMNS, ROWS = np.meshgrid(np.arange(W), np.arange(H))
MAP = 600 * (0.4 * COLUMNS + 0.02 * ROWS + 20) / (W + 0.2 * COLUMNS - 0.1 * ROWS)  # a plate seen through two pinholes

SIGMAS = [np.full(MAP.shape, 0.05, np.float32)] * 2


def _noisy(sigma: float = 0.05, seed: int = 3) -> np.ndarray:
    return (MAP + np.random.default_rng(seed).normal(0, sigma, MAP.shape)).astype(np.float32)


def _smoothed(first: np.ndarray, sigma_px: float, modulation: np.ndarray | None = None) -> np.ndarray:
    """Smooth a map that comes with a second one, of the plate 10 lines further on; both maps of the first plane."""
    maps = np.stack([first, (MAP + 10).astype(np.float32)])
    maps[1, np.isnan(first)] = np.nan
    light = np.full(MAP.shape, 50, np.float32) if modulation is None else modulation.astype(np.float32)
    return np.stack([part[0] for part in smooth_maps(maps, [light, light], SIGMAS, sigma_px)[:2]])


def test_the_noise_falls_as_a_gaussian_of_that_width_averages() -> None:
    for sigma_px in (1.5, 3.0):
        rest = _smoothed(_noisy(), sigma_px)[0] - MAP
        inner = rest[20:-20, 20:-20]
        # independent noise under a Gaussian: divided by 2 sigma sqrt(pi)
        assert np.std(inner) == pytest.approx(0.05 / (2 * sigma_px * np.sqrt(np.pi)), rel=0.12)
        assert np.abs(rest).max() < 0.05  # borders too, where half of the Gaussian is missing


def test_a_sloping_map_is_not_bent_at_borders_and_gaps() -> None:
    exact = MAP.astype(np.float32)
    exact[50:70, 60:90] = np.nan
    rest = _smoothed(exact, 4.0)[0] - MAP
    assert np.nanmax(np.abs(rest)) < 0.005  # the map rises by 2 lines a pixel: a plain Gaussian would be 6 off


def test_gaps_of_a_targets_size_are_filled_and_large_ones_are_not() -> None:
    gaps = _noisy(0.01)
    gaps[60:72, 80:92] = np.nan
    gaps[20:60, 10:50] = np.nan
    smoothed, undisturbed = _smoothed(gaps, 2.0)
    np.testing.assert_allclose(smoothed[60:72, 80:92], MAP[60:72, 80:92], atol=0.01)
    assert np.isnan(smoothed[35:45, 25:35]).all()
    kept = np.isfinite(undisturbed)
    np.testing.assert_array_equal(undisturbed[kept], gaps[kept])
    assert kept.mean() > 0.85  # the gaps are 9 %, their rims 2 %


def test_rims_of_targets_and_of_the_lit_field_are_left_out() -> None:
    # a black dot, and the field's end: pixels on the rim mix two brightnesses, which shifts their coordinate
    away = np.hypot(COLUMNS - 90.0, ROWS - 60.0)
    modulation = 50 * (0.1 + 0.9 / (1 + np.exp(-(away - 6) / 0.5))) * (1.0 + 0.002 * COLUMNS)
    measured = _noisy(0.01)
    measured[np.abs(away - 6) < 1.5] += 0.3
    measured[:, :10] = np.nan
    measured[:, 10] += 0.4
    modulation[:, 10] *= 0.5
    smoothed, undisturbed = _smoothed(measured, 2.0, modulation)
    rest = smoothed - MAP
    assert np.abs(rest[45:75, 75:105]).max() < 0.015
    assert np.isnan(undisturbed[np.abs(away - 6) < 1.5]).all()
    assert np.isnan(undisturbed[:, 10]).all()
    assert np.nanmax(np.abs(rest[:, :20])) < 0.03


def test_white_dots_on_a_black_board_tell_it_and_the_noise_that_is_left_is_told() -> None:
    # the board between the dots tells a seventeenth as sharply as they do
    away = np.hypot((COLUMNS - 9) % 36 - 18, (ROWS - 7) % 36 - 18)
    sigma = np.where(away < 7, 0.03, 0.5).astype(np.float32)
    modulation = (6 + 94 / (1 + np.exp((away - 7) / 0.5))).astype(np.float32)
    truth, rng = np.stack([MAP, MAP + 4, MAP + 8]), np.random.default_rng(5)
    maps = (truth + sigma * rng.standard_normal(truth.shape)).astype(np.float32)
    smoothed, _, variance = smooth_maps(maps, [modulation] * 3, [sigma] * 3, 2.0)
    rest = (smoothed - truth)[:, 8:-8, 8:-8]
    assert np.isfinite(rest).mean() > 0.99
    ratio = np.sqrt(np.nanmean(rest**2 / variance[8:-8, 8:-8]))
    assert 0.9 < ratio < 1.15
    assert np.sqrt(np.nanmean(rest[:, away[8:-8, 8:-8] < 3] ** 2)) < 0.03 / 4


@pytest.mark.parametrize("dark", [False, True])
def test_a_board_of_small_dots_close_together_keeps_its_pixels(dark: bool) -> None:
    """Eight pixels across and nine between: next to nothing is farther than two pixels from a rim; 4 % were left."""
    away = np.hypot((COLUMNS - 9) % 17 - 8, (ROWS - 7) % 17 - 8)
    on = 1 / (1 + np.exp((away - 4) / (-0.5 if dark else 0.5)))
    modulation, sigma = (6 + 94 * on).astype(np.float32), (0.03 / (0.1 + 0.9 * on)).astype(np.float32)
    truth, rng = np.stack([MAP, MAP + 4, MAP + 8]), np.random.default_rng(5)
    maps = (truth + sigma * rng.standard_normal(truth.shape)).astype(np.float32)
    smoothed, _, variance = smooth_maps(maps, [modulation] * 3, [sigma] * 3, 2.0)
    rest = (smoothed - truth)[:, 8:-8, 8:-8]
    assert np.isfinite(rest).mean() > 0.99
    assert 0.85 < np.sqrt(np.nanmean(rest**2 / variance[8:-8, 8:-8])) < 1.2


def test_what_moves_but_is_not_the_plate_stays_and_does_not_spread() -> None:
    maps = np.stack([_noisy(0.01), (MAP + 10).astype(np.float32)])
    maps[:, :, :40] = 555.0  # a wall behind the plate, which does not move
    maps[0, :20] = 1500.0  # something else that moves
    smoothed = smooth_maps(maps, [np.full(MAP.shape, 50, np.float32)] * 2, SIGMAS, 3.0)[0][0]
    np.testing.assert_array_equal(smoothed[:15], maps[0, :15])
    np.testing.assert_array_equal(smoothed[25:, :35], 555.0)
    assert np.nanmax(np.abs(smoothed - MAP)[25:, 45:]) < 0.012


def test_a_wrong_code_is_replaced_by_what_surrounds_it() -> None:
    measured = _noisy(0.01)
    measured[60, 100] += 8.0
    smoothed, _ = _smoothed(measured, 2.0)
    assert np.abs(smoothed - MAP)[55:66, 95:106].max() < 0.012


def test_no_width_means_no_change() -> None:
    maps = _noisy()[None]
    smoothed, undisturbed, _ = smooth_maps(maps, [maps[0]], SIGMAS[:1], 0.0)
    assert smoothed is maps
    assert undisturbed is maps
