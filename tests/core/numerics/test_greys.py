"""Where the grey values of a camera end."""

from __future__ import annotations

import numpy as np
import pytest

from core.numerics import cut_off

LIGHT = np.random.default_rng(3)


@pytest.mark.parametrize("noise", [0.5, 1.0, 4.0])
@pytest.mark.parametrize(("end", "step"), [(235, 1), (3900, 1), (65520, 16)])
def test_a_camera_that_ends_below_full_scale_is_found(end: int, step: int, noise: float) -> None:
    """A tenth of the light is beyond; half of the scene is dark."""
    light = np.where(np.arange(40000) < 20000, 0.04, LIGHT.uniform(0.1, 1.25, 40000)) * end
    grey = np.rint((light + noise * step * LIGHT.standard_normal(40000)) / step) * step
    assert cut_off(np.clip(grey, 0, end))
    assert not cut_off(np.clip(grey, 0, None))


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("dark", [0.0, 12.3])
def test_an_evenly_bright_scene_is_not_cut_off(dark: float, noise: float) -> None:
    """Sine fringes and fields of one brightness, with and without noise."""
    shown = np.concatenate([0.5 + 0.5 * np.cos(np.linspace(0, 700, 20000)), np.repeat([0.0, 1.0], 10000)])
    grey = np.rint(dark + 200 * shown + noise * LIGHT.standard_normal(shown.size))
    assert not cut_off(np.clip(grey, 0, 255))
