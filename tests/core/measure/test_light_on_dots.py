"""Dots rendered under light that falls off, by cameras that are not black without light, against their true places."""

import cv2
import numpy as np
import pytest

from core.measure import measure_targets
from core.measure.centres.lighting import light_of_ground
from core.model import DeviceSpec, PhaseMap, Seed, Testfield

SIZE, RADIUS, SPACING, FINE = (280, 240), 7.0, 40.0, 8  # px; parts of a pixel
PRINTS = {"white-on-black": (0.9, 0.08), "black-on-white": (0.08, 0.9)}  # of dots, of the board


def fall(x, y):
    """Light that changes by up to 0.009 of itself per px."""
    return np.exp(-0.004 * x + 0.001 * y) * (1 - (x**2 + y**2) / 400**2)


def rendered(polarity, level, seed=0):
    """An image with blur and noise, its board, and the dots' places."""
    rng, (width, height) = np.random.default_rng(seed), SIZE
    row, col = (k.ravel() for k in np.mgrid[:5, :6])
    places = np.stack([40 + SPACING * col, height - 40 - SPACING * row], axis=1) + rng.uniform(-0.5, 0.5, (30, 2))
    x, y = ((np.arange(n * FINE) + 0.5) / FINE - 0.5 for n in SIZE)
    away = np.full((len(y), len(x)), 1e9)
    for u, v in places:
        i, j = (slice(int((k - 12) * FINE), int((k + 12) * FINE)) for k in (v, u))
        away[i, j] = np.hypot(x[j] - u, y[i, None] - v)
    dot, board = PRINTS[polarity]
    print_ = board + (dot - board) * np.clip((RADIUS - away) * FINE + 0.5, 0, 1)
    lit = cv2.GaussianBlur(print_ * fall(x - width / 2, y[:, None] - height / 2), (0, 0), 0.5 * FINE)
    image = level + 80 * cv2.resize(lit, SIZE, interpolation=cv2.INTER_AREA) + rng.normal(0, 0.2, (height, width))
    field = Testfield(
        row, col, np.stack([SPACING * col, SPACING * row, 0.0 * row], axis=1), np.full(30, 14.0), polarity=polarity
    )
    return image.astype(np.float32), field, places


@pytest.mark.parametrize("polarity", PRINTS)
@pytest.mark.parametrize("level", [0.0, 4.0, -2.0])
def test_centres_are_not_drawn_to_the_light(polarity, level):
    off, sigmas, slopes = [], [], []
    for seed in range(3):
        image, field, places = rendered(polarity, level, seed)
        nothing = np.full(image.shape, np.nan, np.float32)
        phase = PhaseMap(nothing, nothing, nothing, nothing, 0.4 * image, image, np.zeros(image.shape, np.uint8))
        seeds = [Seed(int(field.row[k]), int(field.col[k]), *places[k]) for k in (0, 5, 29, 24)]
        found = measure_targets(phase, field, seeds, DeviceSpec(*SIZE, (0.006, 0.006), 30.0))
        assert len(found.row) > 25
        which = found.row * 6 + found.col
        off.append(found.camera_uv + found.eccentricity_px - places[which])
        sigmas.append(np.sqrt(np.diagonal(found.camera_cov, axis1=1, axis2=2)))
        x, y = (places[which] - np.array(SIZE) / 2).T
        away = [np.log(fall(x + 1, y) / fall(x - 1, y)) / 2, np.log(fall(x, y + 1) / fall(x, y - 1)) / 2]
        slopes.append(np.stack(away, axis=1))
    error, sigma, slope = (np.concatenate(each) for each in (off, sigmas, slopes))
    # uncorrected radius² / 4 = 12 px²; 4 grey values of 72 that are no light left 0.9, 0.1 of noise
    assert abs(np.sum(error * slope) / np.sum(slope**2)) < 0.3
    assert np.sqrt(np.mean((error / sigma) ** 2)) < 1.25


def test_light_that_is_nearly_even_leaves_open_what_is_no_light():
    rng = np.random.default_rng(1)
    light = 80.0 + rng.normal(0, 0.3, 60)
    plane = np.stack([light + 3.0, 1e-3 * light, 0.0 * light], axis=1)
    contrast = 0.9 * light * (1 + 0.01 * rng.standard_normal(60))
    found, cov = light_of_ground(plane, contrast)
    assert np.all(np.abs(found[:, 0] - 1e-3) < 3 * np.sqrt(cov[:, 0, 0]))
    assert np.sqrt(cov[:, 0, 0]).max() < 1e-4


def test_prints_that_differ_tell_what_is_no_light_as_well_as_its_sigma_says():
    ratios = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        light = np.linspace(50.0, 100.0, 60)
        plane = np.stack([light + 4.0, 3e-3 * light, 0.0 * light], axis=1)
        contrast = 0.9 * light * (1 + 0.01 * rng.standard_normal(60))
        contrast[rng.choice(60, 3, replace=False)] *= 0.6  # dots in a shadow
        found, cov = light_of_ground(plane, contrast)
        ratios.append((found[30, 0] - 3e-3) / np.sqrt(cov[30, 0, 0]))
    assert 0.75 < np.sqrt(np.mean(np.square(ratios))) < 1.3  # of 40
