"""Deviations of planes drawn from noise of a known size, with form or gross errors added to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.checks import planes
from core.checks.planes import form_of, is_noise, pair_concerns, plane_concerns, plane_words
from core.model import PlaneEvaluation

SIGMA = 0.05


def evaluation(deviation: np.ndarray, sigma: float = SIGMA) -> PlaneEvaluation:
    rms = float(np.sqrt(np.mean(deviation**2)))
    of_each = np.full(deviation.shape, sigma, np.float32)
    plane, worst = np.array([0.0, 0.0, 1.0, -700.0]), float(np.abs(deviation).max())
    return PlaneEvaluation(
        "plane", 0.0, "photogrammetric", deviation.size, rms, worst, float(deviation.min()), sigma, 0, "", plane,
        deviation.astype(np.float32), of_each,
    )  # fmt: skip


def concerns(deviation: np.ndarray, calibration_rms_mm: float = 0.0) -> list:
    e = evaluation(deviation)
    return plane_concerns(e, form_of(e.deviation_mm), calibration_rms_mm)


@pytest.fixture(scope="module")
def noise() -> np.ndarray:
    return SIGMA * np.random.default_rng(2).standard_normal((300, 400))


def test_noise_as_predicted_is_no_concern(noise: np.ndarray) -> None:
    assert concerns(noise) == []


@pytest.mark.parametrize(("deviation", "told"), [(0.3, True), (0.5, False)])
def test_deviations_far_below_their_prediction_are_told(noise, deviation: float, told: bool) -> None:
    found = concerns(deviation * noise, 0.5)
    assert [c.state for c in found] == ["doubtful"] * told
    assert all("0.3 times what the noise predicts" in c.text and "sigmas are too large" in c.text for c in found)


def test_a_few_pixels_may_lie_nearer_to_the_plane_than_their_noise_by_chance(noise: np.ndarray) -> None:
    e = evaluation(0.38 * noise[:8, :8])
    assert plane_concerns(e, form_of(e.deviation_mm)) == []


@pytest.mark.parametrize("calibration_rms_mm", [0.0, 0.5])
def test_gross_errors_are_told_however_uncertain_the_calibration_is(noise, calibration_rms_mm: float) -> None:
    """A calibration bends a plane; it scatters no pixels."""
    spoilt = noise.copy()
    spoilt.flat[np.random.default_rng(3).choice(noise.size, 240, replace=False)] += 4.0
    (concern,) = concerns(spoilt, calibration_rms_mm)
    assert concern.state == "failed"
    assert "240 of 120000 pixels are more than 6 sigmas off, the others are as their noise says" in concern.text


def test_form_is_excused_by_the_calibrations_sigma_alone(noise: np.ndarray) -> None:
    v, u = np.mgrid[0:300, 0:400]
    bent = noise + 0.2 * np.sin(u / 60) * np.cos(v / 50)
    assert concerns(bent, 0.5) == []
    assert "the calibration does not hold" in concerns(bent)[0].text


def test_noise_dominates_only_where_form_does_not(noise: np.ndarray) -> None:
    v, u = np.mgrid[0:300, 0:400]
    for height, source in ((0.0, "noise dominates"), (1.2 * SIGMA, "within three sigmas of the calibration")):
        e = evaluation(noise + height * np.sin(u / 60) * np.cos(v / 50))
        assert concerns(e.deviation_mm, 0.5) == []
        e = replace(e, noisy=is_noise(e, form_of(e.deviation_mm)))
        assert plane_words(e)[0].startswith(source)


@pytest.mark.parametrize(("height", "doubtful"), [(0.4, False), (1.2, True)])
def test_form_below_the_noise_is_told_where_it_is_sure(noise, height: float, doubtful: bool) -> None:
    """A bend of half the noise makes the whole r.m.s. a tenth larger only."""
    v, u = np.mgrid[0:300, 0:400]
    bent = noise + height * SIGMA * np.sin(u / 60) * np.cos(v / 50)
    assert [c.state for c in concerns(bent)] == ["doubtful"] * doubtful
    assert concerns(bent, SIGMA / 2) == []


def test_form_that_rises_towards_the_rim_is_no_scatter(noise: np.ndarray) -> None:
    """As where a lens is known poorly in the corners: a window's mean lags behind there."""
    v, u = np.mgrid[-1:1:300j, -1:1:400j]
    bent = noise + 0.3 * (u**2 + v**2) ** 2 * u
    assert form_of(bent).rest_mm == pytest.approx(SIGMA, rel=0.05)  # what the low pass takes of the noise is 0.1 %
    assert concerns(bent, 1.0) == []


def turned(*tilts: tuple[float, float, float]) -> list[PlaneEvaluation]:
    """Planes tilted by degrees about an axis at degrees from x, with the angle_deg that they claim."""
    planes = []
    for k, (angle, about, claimed) in enumerate(tilts):
        a, b = np.radians([angle, about])
        normal = np.array([np.sin(a) * np.sin(b), -np.sin(a) * np.cos(b), np.cos(a)])
        one = replace(evaluation(np.zeros((2, 2))), capture=f"p{k}", angle_deg=claimed, plane=np.array([*normal, -700]))
        planes.append(one)
    return planes


@pytest.mark.parametrize(
    "tilts",
    [
        [(30, 0, 30), (-30, 90, -30)],
        [(0, 0, 0), (30, 0, 30), (-30, 90, -30), (30, 45, 30), (20, 135, -20)],
        [(30, 0, 30), (-30, 0, 30), (0, 0, 0)],  # amounts without signs: too few planes to tell
        [(-20, 60, -20), (-10, 60, -10), (0, 60, 0), (10, 60, 10), (20, 60, 20)],
        [(-20, 60, 20), (-10, 60, 10), (0, 60, 0), (10, 60, -10)],  # the other way round, all of them
    ],
)
def test_planes_may_be_tilted_about_any_axes(tilts: list[tuple[float, float, float]]) -> None:
    assert pair_concerns(turned(*tilts)) == []


@pytest.mark.parametrize(
    ("tilts", "capture", "cause"),
    [
        ([(0, 0, 0), (15, 40, 21)], "p0 and p1", "correct angle_deg"),
        ([(0, 0, 0), (30, 0, 30), (-30, 90, -30), (20, 45, 8)], "p3", "correct angle_deg"),
        ([(0, 20, 0), (-15, 20, 15), (10, 20, 10), (20, 20, 20)], "p1", "sign of angle_deg is reversed"),
        ([(0, 0, 0), (15, 0, 15), (10, 90, 7)], "p0 and p2", "correct angle_deg"),
        ([(0, 20, 0), (-15, 20, -15), (20, 20, -20)], "p1 or p2", "sign of angle_deg is reversed"),
        ([(-15, 20, -15), (10, 20, 16), (20, 20, 20), (-25, 20, -25)], "p1", "correct angle_deg"),
    ],
)
def test_an_angle_that_no_axis_allows_is_told(
    tilts: list[tuple[float, float, float]], capture: str, cause: str
) -> None:
    (concern,) = pair_concerns(turned(*tilts))
    assert concern.text.startswith(f"{capture}: ")
    assert cause in concern.text


@pytest.mark.parametrize("shape", [(576, 748), (301, 403), (61, 83)])
def test_a_wave_passes_the_low_pass_as_a_gaussian_lets_it(shape: tuple[int, int]) -> None:
    """Of a sine of wavelength λ remains exp(-2 (π σ / λ)²); in the middle of the image, where the rim is far."""
    sigma = max(shape) / 40
    wavelength = 8 * sigma
    wave = np.sin(2 * np.pi * np.arange(shape[1]) / wavelength)
    low = planes._blurred(np.broadcast_to(wave, shape).astype(np.float32), sigma)[shape[0] // 2]
    far = int(4 * sigma)
    expected = np.exp(-2 * (np.pi * sigma / wavelength) ** 2) * wave
    assert np.abs(low - expected)[far:-far].max() < 0.005
