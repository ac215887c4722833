"""The light's gradient across a testfield, from the contrasts of its dots, against the falling-off it was made with."""

import numpy as np
import pytest

from core.measure.centres.lighting import light_gradient


def by_contrasts(uv, contrast):
    return light_gradient(uv, contrast, np.zeros_like(uv), np.zeros(len(uv)))[0]


def test_gradient_follows_a_vignette_up_to_the_corners_of_a_coarse_testfield() -> None:
    row, col = np.mgrid[:6, :9]
    uv = np.stack([(col.ravel() - 4) * 31.0, (row.ravel() - 2.5) * 29.5], axis=-1)
    fall = 0.3 / 200.0**2  # 30 % in the corner of 320 x 240 pixels
    contrast = 1 - fall * np.sum(uv**2, axis=1)
    truth = -2 * fall * uv / contrast[:, None]
    off = (by_contrasts(uv, contrast) - truth) * 14.0**2 / 16  # g r² / 4 for dots of 14 px diameter
    assert np.abs(off).max() < 0.002  # px


def test_gradient_follows_light_that_falls_by_two_thirds_to_the_corners() -> None:
    row, col = np.mgrid[:8, :11]
    uv = np.stack([(col.ravel() - 5) * 40.0, (row.ravel() - 3.5) * 40.0], axis=-1)
    fall, rng, off = 0.69 / 244.0**2, np.random.default_rng(1), []
    away = 1 + fall * np.sum(uv**2, axis=1)  # one over the cosine's square
    light, truth = away**-2, -4 * fall * uv / away[:, None]
    for _ in range(20):
        inside = truth + 5e-4 * rng.standard_normal(uv.shape) / light[:, None]
        found, _ = light_gradient(uv, light * (1 + 0.01 * rng.standard_normal(len(uv))), inside, light**2)
        off.append((found - truth) * 20.0**2 / 16)  # px, for dots of 20 px diameter
    corner = np.linalg.norm(uv, axis=1) > 200
    assert np.abs(np.mean(off, axis=0)[corner]).max() < 0.004
    assert np.sqrt(np.mean(np.square(off)[:, corner])) < 0.01


def test_gradient_over_a_tilted_board_near_a_lamp_at_its_side_is_not_drawn_to_zero() -> None:
    row, col = np.mgrid[:7, :9]
    uv = np.stack([(col.ravel() - 4) * 40.0, (row.ravel() - 3) * 40.0], axis=-1)  # 1 px is 1 mm
    slope, lamp = np.array([0.4, -0.2]), np.array([-100.0, 0.0, 400.0])
    toward = lamp - np.column_stack([uv, uv @ slope])
    distance = np.linalg.norm(toward, axis=1)
    facing = toward @ np.array([*-slope, 1.0])
    # the lamp's height above the board is the same everywhere on it: the light goes with the distance alone, as d^-3
    truth = 3 * (toward[:, :2] + toward[:, 2:] * slope) / distance[:, None] ** 2
    found = by_contrasts(uv, facing / distance**3)
    assert np.abs(found - truth).max() * 14.0**2 / 16 < 0.003  # px, for dots of 14 px diameter
    assert abs(np.sum(found * truth) / np.sum(truth**2) - 1) < 0.005


def test_unequal_prints_leave_what_is_seen_inside_the_dots_and_a_covariance_that_holds() -> None:
    row, col = np.mgrid[:8, :10]
    uv = np.stack([(col.ravel() - 4.5) * 33.0, (row.ravel() - 3.5) * 33.0], axis=-1)
    fall, rng = 0.3 / 200.0**2, np.random.default_rng(0)
    light = 1 - fall * np.sum(uv**2, axis=1)
    truth, weight = -2 * fall * uv / light[:, None], np.exp(rng.normal(0, 0.5, len(uv)))
    ratios, errors, alone = [], [], []
    for _ in range(20):
        printed = light * (1 + 0.03 * rng.standard_normal(len(uv)))
        inside = truth + 3e-4 * rng.standard_normal(uv.shape) / np.sqrt(weight)[:, None]
        found, cov = light_gradient(uv, printed, inside, weight)
        off = found - truth
        ratios.append(np.einsum("ni,nij,nj->n", off, np.linalg.inv(cov), off) / 2)
        errors.append(np.mean(off**2))
        alone.append(np.mean((by_contrasts(uv, printed) - truth) ** 2))
    assert 0.5 < np.mean(ratios) < 1.25  # below 1: the fits over the image and around each dot share their data
    assert np.mean(errors) < 0.2 * np.mean(alone)


@pytest.mark.parametrize(
    ("spot_px", "limit"),
    [
        (None, 1e-4),
        (60.0, 3e-4),
        (120.0, 3e-4),
    ],  # per px; cubics through 20 neighbours alone leave 1.5e-4 or more
)
def test_light_over_the_whole_board_is_told_by_all_dots_and_hot_spots_by_those_around(
    spot_px: float | None, limit: float
) -> None:
    row, col = np.mgrid[:12, :16]
    uv = np.stack([(col.ravel() - 7.5) * 40.0, (row.ravel() - 5.5) * 40.0], axis=-1)
    away = 1 + np.sum(uv**2, axis=1) / 600.0**2
    light, slope = away**-2, -4 * uv / 600.0**2 / away[:, None] ** 3
    if spot_px:
        spot = np.exp(-np.sum(uv**2, axis=1) / 2 / spot_px**2)
        light, slope = light + 2 * spot, slope - 2 * uv / spot_px**2 * spot[:, None]
    truth, rng, off, ratios = slope / light[:, None], np.random.default_rng(0), [], []
    for _ in range(10):
        inside = truth + 1e-3 * rng.standard_normal(uv.shape)
        found, cov = light_gradient(uv, light * (1 + 0.005 * rng.standard_normal(len(uv))), inside, np.ones(len(uv)))
        off.append(found - truth)
        ratios.append(np.einsum("ni,nij,nj->n", off[-1], np.linalg.inv(cov), off[-1]) / 2)
    assert np.sqrt(np.mean(np.square(off))) < limit
    assert 0.3 < np.mean(ratios) < 1.3  # it allows for light with more shape than this, as large as the scatter


def test_dots_in_a_shadow_and_dots_beside_it_each_tell_their_own_light() -> None:
    row, col = np.mgrid[:8, :11]
    uv = np.stack([(col.ravel() - 5) * 44.0, (row.ravel() - 3.5) * 44.0], axis=-1)
    fall, rng = 0.3 / 300.0**2, np.random.default_rng(0)
    light = 1 - fall * np.sum(uv**2, axis=1)
    truth = -2 * fall * uv / light[:, None]
    shadowed = np.hypot(*(uv - [60.0, -40.0]).T) < 80
    contrast = light * np.where(shadowed, 0.4, 1.0) * (1 + 0.002 * rng.standard_normal(len(uv)))
    inside, weight = truth + 4e-4 * rng.standard_normal(uv.shape), np.full(len(uv), 3000.0)
    off = light_gradient(uv, contrast, inside, weight, shadowed)[0] - truth
    assert np.abs(off).max() * 20.0**2 / 16 < 0.04  # px, for dots of 20 px diameter; 0.17 where they are taken together
