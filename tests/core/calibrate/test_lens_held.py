"""Lens parameters that are held, though the images ask for them; images by OpenCV, which shares no code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import adjust
from core.model import Interior
from tests.core.calibrate.conftest import CAMERA
from tests.core.calibrate.test_networks_of_many import free_network, through_opencv

MAIN = ("c", "x0", "y0")
ALL = (*MAIN, "A1", "A2", "A3", "A4", "A5", "A6")


def told(
    k1: float, seed: int, estimate: tuple[str, ...] = MAIN, known: Interior | None = None, uneven: float = 0.0
) -> list[str]:
    """What is said of a lens that bends images by k1; sigmas vary by up to e to the power of `uneven`."""
    lens = Interior(12.1, -0.08, 0.11, (k1, *(0.0,) * 8), 0.0, "brown")
    spec = replace(CAMERA, interior=known)
    network, _ = free_network(lambda p, pose: through_opencv(lens, CAMERA, p, pose), spec, seed, estimate=estimate)
    rng = np.random.default_rng(seed)
    worse = np.exp(rng.uniform(0, uneven, network.observation_uv.shape))
    more = rng.normal(size=worse.shape) * network.observation_sigma * np.sqrt(worse**2 - 1)
    sigma = network.observation_sigma * worse
    network = replace(network, observation_uv=network.observation_uv + more, observation_sigma=sigma)
    return [c.text for c in adjust(network).doubts if c.about == "held"]


@pytest.mark.parametrize("k1", [-0.02, 0.02])
def test_distortion_that_is_not_estimated_is_named(k1: float) -> None:
    """k1 of 0.02 moves the corners by 2 px, of which c takes up most: a few sigmas of 0.02 px remain."""
    text, *_ = told(k1, seed=1)
    assert text.startswith("cam.A1 is held at 0, by the observations it is ")
    value, sigma = map(float, text.split("it is ")[1].split(": ")[0].split(" ± "))
    assert abs(value - k1 / 12.1**2) < 5 * sigma


@pytest.mark.parametrize("estimate", [MAIN, (*MAIN, "A1", "A3")])
@pytest.mark.parametrize("uneven", [0.0, 2.0])
def test_what_is_zero_may_be_held_there(estimate: tuple[str, ...], uneven: float) -> None:
    """Limits are 1.6 times those of one network in a thousand: of so few none is doubted."""
    assert [told(0.0, seed, estimate, uneven=uneven) for seed in range(4)] == [[]] * 4


def test_nothing_is_asked_for_where_all_is_estimated_and_of_what_is_known_what_is_wrong() -> None:
    assert told(0.02, 1, ALL) == []
    assert told(0.02, 1, known=Interior(12.1))[0].startswith("cam.A1 is held at 0")
