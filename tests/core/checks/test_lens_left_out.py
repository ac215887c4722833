"""Lens parameters that are not estimated, though the images ask for them; images by OpenCV, which shares no code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import adjust
from core.checks import lens_concerns
from core.model import Interior
from tests.core.calibrate.conftest import CAMERA
from tests.core.calibrate.test_networks_of_many import free_network, through_opencv

MAIN = ("c", "x0", "y0")


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
    return [c.text for c in lens_concerns(adjust(network))]


@pytest.mark.parametrize("k1", [-0.02, 0.02])
def test_distortion_that_is_not_estimated_is_named(k1: float) -> None:
    """k1 of 0.02 moves the corners by 2 px, of which c takes up most: a few sigmas of 0.02 px remain."""
    (text,) = told(k1, seed=1)
    assert text.startswith("cam: ")
    assert "estimating A1, A2, A3, A4, A5, A6 would explain" in text


def test_estimated_in_part_only_the_others_are_named() -> None:
    (text,) = told(0.02, 1, (*MAIN, "A3", "A4"))
    assert "estimating A1, A2, A5, A6 would explain" in text


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("uneven", [0.0, 2.0])
def test_a_lens_without_distortion_needs_no_more(seed: int, uneven: float) -> None:
    """By chance six parameters explain 6 of some 2,500 squares; a tenth of them never."""
    assert told(0.0, seed, uneven=uneven) == []


def test_distortion_is_named_among_sigmas_of_very_different_size() -> None:
    assert len(told(0.05, 1, uneven=1.0)) == 1


def test_nothing_is_asked_for_where_all_is_estimated_or_known_before() -> None:
    assert told(0.02, 1, (*MAIN, "A1", "A2", "A3", "A4", "A5", "A6")) == []
    assert told(0.02, 1, known=Interior(12.1)) == []
