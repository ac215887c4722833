"""Deviations of planes drawn from noise of a known size, with form or gross errors added to them."""

from __future__ import annotations

import numpy as np
import pytest

from core.checks.planes import form_of, plane_concerns
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


def test_form_that_rises_towards_the_rim_is_no_scatter(noise: np.ndarray) -> None:
    """As where a lens is known poorly in the corners: a window's mean lags behind there."""
    v, u = np.mgrid[-1:1:300j, -1:1:400j]
    bent = noise + 0.3 * (u**2 + v**2) ** 2 * u
    assert form_of(bent).rest_mm == pytest.approx(SIGMA, rel=0.05)  # what the low pass takes of the noise is 0.1 %
    assert concerns(bent, 1.0) == []
