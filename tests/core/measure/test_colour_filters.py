"""Centres of dots in images of colour cameras: raw mosaics, and grey that was interpolated from them."""

from functools import cache

import cv2
import numpy as np
import pytest
from scipy.special import ndtr

from core.measure import measure_targets
from core.measure.centres.grain import balanced, grain
from core.measure.centres.rays import Rays
from core.model import DeviceSpec, PhaseMap, Seed, Testfield

FINE = 100  # steps of a grey value, so that rounding is no noise
GAINS = np.array([[0.7, 1.0], [1.0, 0.55]])
ROWS, COLUMNS, PITCH, DIAMETER, BLUR = 8, 10, 29.37, 12.4, 0.5  # px


@cache
def board():
    """Grey values of a turned board seen straight on, means of 5 x 5 samples a pixel, and its centres (n, 2) px."""
    row, column = (each.ravel() for each in np.mgrid[0:ROWS, 0:COLUMNS])
    turn = np.array([[0.99, 0.141], [-0.141, 0.99]])
    centre = PITCH * np.stack([column, row], axis=1) @ turn + [30.3, 78.7]
    v, u = np.mgrid[0 : 5 * 330, 0 : 5 * 350] / 5 - 0.4
    on_board = (np.stack([u, v], axis=-1) - [30.3, 78.7]) @ np.linalg.inv(PITCH * turn)
    nearest = np.clip(np.rint(on_board), 0, [COLUMNS - 1, ROWS - 1])
    away = np.linalg.norm((on_board - nearest) @ (PITCH * turn), axis=-1)
    image = 12 + 140 * ndtr((DIAMETER / 2 - away) / BLUR)
    return image.reshape(330, 5, 350, 5).mean(axis=(1, 3)), row, column, centre


def centres(change, noise: float):
    """Errors (2n,) and sigmas of the centres as a camera shows them that makes `change` of a mosaic's pixels."""
    clean, row, column, true = board()
    more = noise * np.random.default_rng(2).standard_normal(clean.shape)
    image = change(clean, more).astype(np.float32)
    nothing = np.full(image.shape, np.nan, np.float32)
    phase = PhaseMap(nothing, nothing, nothing, nothing, 0 * image, image, np.zeros(image.shape, np.uint8))
    field = Testfield(row, column, np.stack([20.0 * column, -20.0 * row, 0.0 * row], axis=1), np.full(len(row), 8.4))
    corners = [n for n in range(len(row)) if row[n] in (0, ROWS - 1) and column[n] in (0, COLUMNS - 1)]
    seeds = [Seed(int(row[n]), int(column[n]), *true[n]) for n in corners]
    camera = DeviceSpec(image.shape[1], image.shape[0], (0.006, 0.006), 12.0)
    found = measure_targets(phase, field, seeds, camera)
    error = found.camera_uv - true[found.row * COLUMNS + found.col]
    return error.ravel(), np.sqrt(np.diagonal(found.camera_cov, axis1=1, axis2=2)).ravel()


def mosaic(clean, noise):
    gain = np.tile(GAINS, (clean.shape[0] // 2 + 1, clean.shape[1] // 2 + 1))[: clean.shape[0], : clean.shape[1]]
    return gain * clean + noise


@pytest.mark.parametrize("way", [cv2.COLOR_BayerRG2BGR, cv2.COLOR_BayerRG2BGR_EA], ids=["bilinear", "along edges"])
@pytest.mark.parametrize("noise", [0.5, 3.0])
def test_noise_that_interpolation_spread_counts_whole(way: int, noise: float) -> None:
    def interpolated(clean, more):
        raw = np.rint(FINE * np.clip(clean + more, 0, None)).astype(np.uint16)
        return cv2.cvtColor(cv2.cvtColor(raw, way), cv2.COLOR_BGR2GRAY) / FINE

    error, sigma = centres(interpolated, noise)
    assert len(error) > 110
    # what a lattice of every other pixel leaves is foreseen to a quarter
    assert 0.7 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.3


def test_a_mosaic_of_unlike_pixels_is_no_noise() -> None:
    error, sigma = centres(mosaic, 1.0)
    plain_error, plain_sigma = centres(lambda clean, noise: clean + 1.4 * noise, 1.0)
    assert len(error) == len(plain_error)
    assert 0.85 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.2
    assert np.median(sigma) < 1.2 * np.median(plain_sigma)


@pytest.mark.parametrize("radius", [2.0, 2.5, 3.0])
@pytest.mark.parametrize("pitch", [10, 12, 16, 30])
def test_small_dots_on_an_even_raster_are_no_mosaic(pitch: int, radius: float) -> None:
    """Seen straight on, pixels of a kind show the same part of all dots: up to 30 % off their neighbours."""
    v, u = np.mgrid[0:240, 0:320]
    away = np.hypot(u % pitch - 5.3, v % pitch - 5.6)
    image = (12 + 140 * ndtr((radius - away) / 0.5)).astype(np.float32)
    assert balanced(image) is image


def test_few_small_dots_of_a_large_image_tell_their_noise_as_well_as_cut_out() -> None:
    """Bands of it, which tell that of many dots, left a scatter of a sixth."""
    rng = np.random.default_rng(5)
    centre = 40.0 * np.stack(np.meshgrid(np.arange(1, 10), np.arange(1, 8)), axis=-1).reshape(-1, 2)
    rays, one = Rays(centre, np.tile(8 * np.eye(2), (len(centre), 1, 1))), np.ones(len(centre))
    image = cv2.blur(rng.normal(0, 30, (2400, 3200)).astype(np.float32), (3, 3))
    whole, part = (grain(each, rays, 1.4 * one, 0.5 * one).ground for each in (image, image[:320, :400]))
    assert part > 3
    assert whole == pytest.approx(part, rel=1e-6)
