"""The way back from a camera's grey values to light."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import DecodeOptions
from core.decode.waves.camera import TERMS, bend, rises, unbend


@pytest.mark.parametrize("full", [255.0, 4095.0, 65535.0])
def test_light_comes_back_and_what_is_saturated_is_no_brighter_than_the_scale(full: float) -> None:
    """Means of frames, some of them saturated, tell the noise: more than full scale would be taken for steep light."""
    curve, light = np.zeros(TERMS), np.linspace(0, full, 1000)
    curve[:2] = 0.8, -0.2
    grey = np.rint(bend(light, curve, full).grey).astype(np.uint8 if full == 255 else np.uint16)
    (back,), steps = unbend([grey], curve, full)
    # half a grey value where the curve is a third as steep, and half a step
    assert np.abs(back / steps - light).max() < 2.0
    assert back.max() == steps * full
    assert (back[grey < full] < steps * full).all()


def test_finer_steps_of_finer_steps_are_told_in_grey_values() -> None:
    """Exposures made one image, and then even steps of the light."""
    finest = DecodeOptions(min_modulation=3.0).in_steps(16, 4080.0).in_steps(2, 8160.0)
    assert (finest.steps, finest.min_modulation, finest.saturation) == (32, 96.0, 8160.0)


@pytest.mark.parametrize("gamma", [0.6, 1.0, 1.8, 2.2, 2.6])
def test_a_camera_with_a_gamma_rises(gamma: float) -> None:
    light = np.linspace(0.003, 1, 500)
    terms = np.polynomial.chebyshev.chebvander(2 * light - 1, TERMS - 1) * (light * (1 - light))[:, None]
    assert rises(np.linalg.lstsq(terms, light ** (1 / gamma) - light, rcond=None)[0])


def test_a_curve_that_goes_up_and_down_is_no_cameras() -> None:
    """As was taken for one: in four steps and a code of one axis alone, by a camera whose grey values were even."""
    assert not rises(np.array([1.741, 1.762, -0.974, -3.279, -1.646]))
