"""Gray code without phases: at the edge between two cells the bits decide, and neither side is preferred."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from core.decode import DecodeOptions, decode
from core.patterns import Black, Code, White, brightness, gray_and_phase
from tests.core.decode.conftest import Bench

LINES, FINE = 128, 20
PARTS = [1, 1, 0.98, 0.97, 0.95, 0.92, 0.85, 0.75, 0.4]  # of the light that stripes of 256 lines to one show


def taken(blur_lines: float, contrast: object, cell: int, u: np.ndarray, rng: np.random.Generator) -> tuple:
    """Patterns of a Gray code and its inverse, and grey values where u is seen, with noise of two."""
    patterns = gray_and_phase("x", LINES, cell=cell, periods=[], inverse=True)
    places = (np.arange(LINES * FINE) - (FINE - 1) / 2) / FINE
    images = []
    for pattern in patterns:
        light = gaussian_filter1d(np.repeat(brightness(pattern, np.arange(LINES)), FINE), blur_lines * FINE)
        grey = 20 + contrast * np.interp(u, places, light) + rng.normal(0, 2, u.shape)
        images.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    return patterns, images


def places(rows: int, rng: np.random.Generator) -> np.ndarray:
    """Coordinates of pixels, lines, evenly over the cells."""
    return np.linspace(4, LINES - 5, 500)[None, :] + rng.uniform(-0.5, 0.5, (rows, 1))


@pytest.mark.parametrize(("blur_lines", "contrast", "cell"), [(0.5, 15, 1), (0.8, 25, 1), (1.2, 15, 2)])
def test_pixels_at_blurred_edges_fall_to_both_sides_alike(blur_lines: float, contrast: float, cell: int) -> None:
    rng = np.random.default_rng(4)
    u = places(200, rng)
    phase = decode(*taken(blur_lines, contrast, cell, u, rng), lines=(LINES, 1))
    error = (phase.u - u)[np.isfinite(phase.u)]
    assert len(error) > 0.9 * u.size
    # an error within a cell has a standard deviation of 0.3 cells; five of those of the mean
    assert abs(np.mean(error)) < 5 * 0.3 * cell / np.sqrt(len(error))


@pytest.mark.parametrize("blur_lines", [0.5, 0.8, 1.6])
def test_dim_bits_claim_no_more_than_a_cell(blur_lines: float) -> None:
    """From 5 standard deviations of the noise up, where a bit looks as at an edge wherever it is."""
    rng = np.random.default_rng(1)
    u, contrast = places(300, rng), np.geomspace(10, 40, 300)[:, None]
    phase = decode(*taken(blur_lines, contrast, 1, u, rng), lines=(LINES, 1))
    known = np.isfinite(phase.u)
    error = np.abs(phase.u - u)[known] / phase.sigma_u[known]
    assert known.mean() > 0.7
    assert np.count_nonzero(error > 6) < 1e-4 * np.count_nonzero(known)  # with other noise 0 to 5 of 120,000
    assert 0.5 < np.sqrt(np.mean(error**2)) < 1.1


@pytest.mark.parametrize("blur_lines", [5.0, 8.0])
def test_bits_of_which_two_edges_are_blurred_into_each_other_leave_a_wider_cell(blur_lines: float) -> None:
    """Stripes of 1, 2 and 4 lines are not resolved, and near edges of those of 8 those of 16 are unsure, too.

    A quarter of the pixels had no coordinate.
    """
    rng = np.random.default_rng(4)
    u = places(200, rng)
    phase = decode(*taken(blur_lines, 100, 1, u, rng), lines=(LINES, 1))
    known = np.isfinite(phase.u)
    assert known.mean() > 0.99
    assert np.all(np.abs(phase.u - u)[known] < 4 * phase.sigma_u[known])
    assert np.quantile(phase.sigma_u[known], 0.7) < 1.01 * 8 / np.sqrt(12)  # and no wider than need be


@pytest.mark.parametrize("gamma", [0.6, 1.4, 2.2])
def test_a_cameras_gamma_does_not_move_edges(gamma: float) -> None:
    """Without inverse frames the threshold is halfway between white and black in grey values, not in light.

    Errors were 1.7 times as large as without a gamma of 2.2, and 1.6 times sigma.
    """
    patterns, u = (
        [*gray_and_phase("x", LINES, cell=1, periods=[]), White(), Black()],
        places(200, np.random.default_rng(4)),
    )
    fine, rms = (np.arange(LINES * FINE) - (FINE - 1) / 2) / FINE, []
    for power in (1.0, 1 / gamma):
        rng, images = np.random.default_rng(5), []
        for pattern in patterns:
            light = gaussian_filter1d(
                np.repeat(brightness(pattern, np.arange(LINES)), FINE), 0.7 * FINE, mode="nearest"
            )
            grey = 255 * (0.06 + 0.8 * np.interp(u, fine, light)) ** power + rng.normal(0, 2, u.shape)
            images.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
        phase = decode(patterns, images, lines=(LINES, 1))
        known = np.isfinite(phase.u)
        error = (phase.u - u)[known]
        assert known.mean() > 0.99
        assert 0.8 < np.sqrt(np.mean(np.square(error / phase.sigma_u[known]))) < 1.1
        rms.append(np.sqrt(np.mean(error**2)))
    assert rms[1] < 1.2 * rms[0]


@pytest.mark.parametrize(
    ("cell", "first", "last", "blur"), [(32, 10, 110, 0.6), (16, 30, 75, 0.6), (32, 40, 100, 0.6), (16, 40, 88, 4.0)]
)
def test_few_wide_stripes_are_read_though_more_of_them_are_lit(cell: int, first: int, last: int, blur: float) -> None:
    """Of sharp stripes the middle pixel is black or white; read about that, up to half the pixels were a cell off.

    Of blurred ones it is between: coordinates were up to 20 lines off.
    """
    patterns = [*gray_and_phase("x", LINES, cell=cell, periods=[]), White(), Black()]
    u = np.tile(np.linspace(first, last, 200), (60, 1))
    phase = decode(patterns, Bench(u, lines=(LINES, 1), blur=blur).take(patterns), lines=(LINES, 1))
    assert np.isfinite(phase.u).all()
    assert np.abs(phase.u - u).max() < 0.5 * cell + 2


@pytest.mark.parametrize("inverse", [True, False])
@pytest.mark.parametrize(("blur_lines", "gamma"), [(2.0, 1.0), (5.0, 1.6)])
def test_binary_code_without_its_blurred_bits_tells_wide_cells(blur_lines: float, gamma: float, inverse: bool) -> None:
    """Bits of stripes that blur hides are anything. They were read all the same: four in five were off by 5 sigma."""
    codes = gray_and_phase("x", LINES, cell=1, periods=[], inverse=inverse)
    patterns = [White(), Black(), *(replace(p, kind="binary") for p in codes if isinstance(p, Code))]
    u = places(100, np.random.default_rng(4))
    images = Bench(u, lines=(LINES, 1), blur=blur_lines, gain=150).take(patterns)
    images = [np.rint(255 * (image / 255) ** (1 / gamma)).astype(np.uint8) for image in images]  # of the camera
    phase = decode(patterns, images, lines=(LINES, 1))
    known = np.isfinite(phase.u)
    error = np.abs(phase.u - u)[known] / phase.sigma_u[known]
    assert known.mean() > 0.8
    assert np.mean(error > 4) < 0.005
    assert np.sqrt(np.mean(error**2)) < 1.2


def test_pixels_that_white_alone_lights_hide_no_blurred_bits() -> None:
    """White scatters light that stripes do not; where these are constant, contrast divides nothing.

    All bits were then taken for resolved, and a quarter of the pixels lost.
    """
    codes = gray_and_phase("x", LINES, cell=1, periods=[], inverse=True)
    patterns = [White(), Black(), *codes]
    u = places(200, np.random.default_rng(4))
    white, black, *stripes = Bench(u, lines=(LINES, 1), blur=5.0, gain=60).take(patterns)
    for image in stripes:
        image[:20] = 15
    phase = decode(patterns, [white + np.uint8(60), black, *stripes], lines=(LINES, 1))
    known = np.isfinite(phase.u[25:])
    assert known.mean() > 0.9
    assert np.all(np.abs(phase.u - u)[25:][known] < 4 * phase.sigma_u[25:][known])


@pytest.mark.parametrize("gamma", [0.6, 2.2])
def test_bits_that_blur_hides_show_half_the_light_however_few_cells_are_seen(gamma: float) -> None:
    """Unresolved bits are all on, or all off, by a camera's gamma: their words look like few cells.

    The threshold stayed halfway between black and white then, and three of five pixels were off by more than 4 sigma.
    """
    patterns = [White(), Black(), *gray_and_phase("x", 64, cell=1, periods=[])]
    u = np.tile(np.linspace(5, 45, 320), (100, 1))
    images = Bench(u, lines=(64, 1), blur=6.0, gain=180, dark=1.0).take(patterns)
    images = [np.rint(255 * (image / 255) ** (1 / gamma)).astype(np.uint8) for image in images]  # of the camera
    phase = decode(patterns, images, lines=(64, 1))
    known = np.isfinite(phase.u)
    assert known.mean() > 0.9
    assert np.mean(np.abs(phase.u - u)[known] > 4 * phase.sigma_u[known]) < 0.002


@pytest.mark.parametrize("estimate", [False, True])
def test_stripes_may_be_darker_than_white_the_finer_the_more(estimate: bool) -> None:
    """A lamp that follows the picture, and lines finer than a projector can show, dim bits by parts of their own.

    Held against the middle of white and black, fine bits were all off: a third of the pixels were off by 4 sigma.
    """
    patterns = [White(), Black(), *gray_and_phase("x", 512, cell=1, periods=[])]
    u = np.tile(np.linspace(30, 400, 320), (100, 1))
    white, black, *stripes = Bench(u, lines=(512, 1), blur=3.0, gain=180).take(patterns)
    dimmed = [black + (image - 1.0 * black) * 0.8 * part for image, part in zip(stripes, PARTS, strict=True)]
    images = [white, black, *(np.rint(image).astype(np.uint8) for image in dimmed)]
    phase = decode(patterns, images, lines=(512, 1), options=DecodeOptions(estimate=estimate))
    known = np.isfinite(phase.u)
    error = np.abs(phase.u - u)[known]
    assert known.mean() > 0.97
    assert np.mean(error > 4 * phase.sigma_u[known]) < 0.003
    assert np.sqrt(np.mean(error**2)) < (0.3 if estimate else 1.3)


@pytest.mark.parametrize(("kind", "cell", "period"), [("gray", 8, 16), ("gray", 32, 32), ("binary", 8, 16)])
def test_white_may_be_brighter_than_all_other_frames(kind: Literal["gray", "binary"], cell: int, period: int) -> None:
    """A lamp that follows the picture: of what white shows, bits and fringes show half.

    A fifth to a half of the pixels decoded, up to 4 % of them wrong by a cell or more.
    """
    patterns = [White(), Black(), *gray_and_phase("x", 640, cell=cell, periods=[period], kind=kind)]
    u = np.linspace(30, 600, 400) + np.random.default_rng(0).uniform(-0.5, 0.5, (60, 1))
    white, black, *others = Bench(u, lines=(640, 1), blur=0.6, gain=160).take(patterns)
    images = [white, black, *(np.rint(0.5 * image + 0.5 * black).astype(np.uint8) for image in others)]
    phase = decode(patterns, images, lines=(640, 1))
    known = np.isfinite(phase.u)
    score = (phase.u - u)[known] / phase.sigma_u[known]
    assert known.mean() > 0.99
    assert np.sqrt(np.mean(score**2)) < 1.1
    assert np.abs(score).max() < 6


def test_sigma_holds_stripes_that_a_projector_of_fewer_lines_draws() -> None:
    """It shows three lines by two of its own, which moves edges by up to half a line: errors were 1.9 times sigma."""
    rng, lines = np.random.default_rng(4), 240
    u = np.linspace(6, lines - 7, 301)[None, :] + np.linspace(0, 6, 200)[:, None]
    fine, images = (np.arange(lines * FINE) - (FINE - 1) / 2) / FINE, []
    patterns = gray_and_phase("x", lines, cell=1, periods=[], inverse=True)
    for pattern in patterns:
        drawn = np.repeat(brightness(pattern, np.arange(0.5, lines, 1.5).astype(int)), 3 * FINE // 2)
        light = gaussian_filter1d(drawn, 0.5 * FINE, mode="nearest")
        images.append(np.rint(20 + 150 * np.interp(u, fine, light) + rng.normal(0, 2, u.shape)).astype(np.uint8))
    phase = decode(patterns, images, lines=(lines, 1))
    known = np.isfinite(phase.u)
    error = (phase.u - u)[known] / phase.sigma_u[known]
    assert known.mean() > 0.9
    assert 0.8 < np.sqrt(np.mean(error**2)) < 1.25


@pytest.mark.parametrize(
    ("kind", "cell", "period", "first", "part"),
    [("binary", 64, 128, 454.4, 0.6), ("gray", 64, 64, 134.4, 0.6), ("binary", 4, None, 56, 1.0)],
)
def test_bits_of_the_only_cells_seen_are_not_taken_for_half_lit(
    kind: Literal["gray", "binary"], cell: int, period: int | None, first: float, part: float
) -> None:
    """Where few cells are seen, a bit's single level may be that of on, or of stripes that blur makes nearly dark.

    The thresholds moved there: 3 % of the pixels decoded, or a quarter wrong.
    """
    lines = 640 if cell > 4 else 128
    patterns = [White(), Black(), *gray_and_phase("x", lines, cell=cell, periods=[period] if period else [], kind=kind)]
    u = np.linspace(first, first + (50 if period else 6), 320) + np.random.default_rng(0).uniform(-0.2, 0.2, (60, 1))
    white, black, *others = Bench(u, lines=(lines, 1), blur=0.4 if period else 3.0, gain=90).take(patterns)
    images = [white, black, *(np.rint(black + part * (1.0 * image - black)).astype(np.uint8) for image in others)]
    phase = decode(patterns, images, lines=(lines, 1))
    known = np.isfinite(phase.u)
    assert known.mean() > 0.97
    assert np.mean(np.abs(phase.u - u)[known] > 6 * phase.sigma_u[known]) < 0.001


@pytest.mark.parametrize(("blur", "part"), [(0.7, 0.6), (1.0, 0.8)])
def test_coarse_bits_are_dimmed_with_the_first_one_that_shows_on_and_off(blur: float, part: float) -> None:
    """Between the bits that blur hides and those that are clear lie some that show neither.

    Their thresholds then passed to the coarse ones with the wrong on and off: 6 % and 1 % of the pixels were wrong.
    """
    patterns = [White(), Black(), *gray_and_phase("x", 640, cell=1, periods=[])]
    u = np.linspace(30, 600, 160) + np.random.default_rng(0).uniform(-0.5, 0.5, (40, 1))
    white, black, *bits = Bench(u, lines=(640, 1), blur=blur, gain=180).take(patterns)
    images = [white, black, *(np.rint(black + part * (1.0 * image - black)).astype(np.uint8) for image in bits)]
    phase = decode(patterns, images, lines=(640, 1))
    assert np.isfinite(phase.u).mean() > 0.99
    assert np.nanmax(np.abs(phase.u - u) / phase.sigma_u) < 6


def test_a_white_frame_may_be_saturated_on_two_thirds_of_the_object() -> None:
    """Cut off, white hides that blurred bits are half lit; dark pixels see them so, and both have one threshold.

    It stayed halfway, and a fifth of the pixels were wrong.
    """
    patterns = [White(), Black(), *gray_and_phase("x", 256, cell=1, periods=[])]
    u = np.linspace(10, 200, 160) + np.random.default_rng(0).uniform(-0.5, 0.5, (80, 1))
    bright, dark = (
        Bench(u, lines=(256, 1), blur=2, gain=300 * light, ambient=30 * light, seed=seed).take(patterns)
        for seed, light in enumerate((1.0, 0.5))
    )
    upper = np.arange(80)[:, None] < 25
    phase = decode(patterns, [np.where(upper, b, a) for a, b in zip(bright, dark, strict=True)], lines=(256, 1))
    known = np.isfinite(phase.u)
    assert known.mean() > 0.99
    assert np.mean(np.abs(phase.u - u)[known] > 6 * phase.sigma_u[known]) < 0.01


@pytest.mark.parametrize("period", [None, 16.0])
def test_a_median_among_noise_between_on_and_off_moves_no_threshold(period: float | None) -> None:
    """Of sharp stripes few pixels are half lit; where a bit is on in 43 % of them, noise fills the gap.

    Off was taken for half the light then: 4 of 10 pixels were lost, and 9 % of the others wrong without phases.
    """
    periods = [period] if period else []
    patterns = [White(), Black(), *gray_and_phase("x", 256, cell=16, periods=periods, kind="binary")]
    columns = np.concatenate([np.linspace(0, 144, 300), np.linspace(66, 78, 9)])
    u = columns + np.random.default_rng(0).uniform(-0.5, 0.5, (100, 1))
    phase = decode(patterns, Bench(u, lines=(256, 1), blur=0.6, gain=28, dark=6.0).take(patterns), lines=(256, 1))
    known = np.isfinite(phase.u)
    assert known.mean() > (0.88 if period else 0.95)
    assert np.mean(np.abs(phase.u - u)[known] > 6 * phase.sigma_u[known]) < 0.003
