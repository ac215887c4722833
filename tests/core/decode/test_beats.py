"""Neighbouring periods are bent alike by light by a second way: the amplitude tells, and orders are not trusted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from core.decode import Flag, decode
from core.decode.pairs import TILES, look_at
from core.model import PhaseMap
from core.patterns import Black, Phase, White, gray_and_phase
from tests.core.decode.conftest import Array, Bench

HEIGHT, WIDTH = 240, 500
PERIODS = [27.0, 28.0]
PATTERNS = [
    *(p for p in gray_and_phase("x", 640, cell=24, periods=PERIODS, steps=8) if isinstance(p, Phase)),
    White(),
    Black(),
]


def taken(direct: Bench, second: Bench, part: float | Array) -> PhaseMap:
    """Decode frames to which a second way adds `part` of the light of other lines."""
    images = []
    for pattern, image in zip(PATTERNS, direct.take(PATTERNS), strict=True):
        more = part * second.gain * second.light(pattern)
        images.append(np.clip(np.round(image + more), 0, 255).astype(np.uint8))
    return decode(PATTERNS, images, lines=(640, 640))


def other(direct: Bench, far: float, slope: float) -> Bench:
    """Lines so far from those that come straight, and farther across the image."""
    across = np.linspace(-0.5, 0.5, WIDTH) + 0.3 * np.linspace(-0.5, 0.5, HEIGHT)[:, None]
    return replace(direct, u=direct.u + far + slope * across)


def score(phase: PhaseMap, u: Array) -> float:
    """Error over sigma, r.m.s."""
    return float(np.sqrt(np.nanmean(np.square((phase.u - u) / phase.sigma_u))))


@pytest.mark.parametrize(("far", "slope", "part"), [(60.0, 100.0, 0.08), (-90.0, 120.0, 0.15), (40.0, 60.0, 0.08)])
def test_sigma_holds_what_bends_neighbouring_periods_alike(
    far: float, slope: float, part: float, bench: Callable[..., Bench]
) -> None:
    """A quarter: over the field sines and cosines of the way have nearly the same mean square, as is assumed."""
    direct = bench(height=HEIGHT, width=WIDTH, blur=0.7, dark=1.0)
    phase = taken(direct, other(direct, far, slope), part)
    assert 0.75 < score(phase, direct.u) < 1.25  # by the contradiction alone 3.2, 4.4 and 4.1
    assert any("second way" in note for note in phase.notes)


@pytest.mark.filterwarnings("error")
def test_frames_in_any_order_overflow_nothing(bench: Callable[..., Bench]) -> None:
    """White may be darker than black then."""
    waves = [Phase("x", p, 6, k, np.pi / 3 * k, "sine") for p in (40.0, 41.0, 640.0) for k in range(6)]
    patterns = [*waves, White(), Black()]
    images = bench(height=HEIGHT, width=WIDTH, gain=90.0, dark=0.5).take(patterns)
    for seed in (0, 2, 4, 5):
        order = np.random.default_rng(seed).permutation(len(images))
        decode(patterns, [images[k] for k in order], lines=(640, 480))


def test_amplitude_alone_is_no_second_light(bench: Callable[..., Bench]) -> None:
    """A surface that scatters light has half the amplitude, beside one that does not."""
    direct = bench(height=HEIGHT, width=WIDTH, blur=0.7, dark=1.0)
    soft = replace(direct, blur=7.0)
    scatters = np.arange(WIDTH) > WIDTH / 2
    images = [np.where(scatters, b, a) for a, b in zip(direct.take(PATTERNS), soft.take(PATTERNS), strict=True)]
    phase = decode(PATTERNS, images, lines=(640, 640))
    inside = (direct.u > 50) & (direct.u < 590)  # at the rim so much blur cuts fringes
    assert 0.93 < score(phase, np.where(inside, direct.u, np.nan)) < 1.07
    assert not phase.notes


def test_orders_are_not_trusted_where_distances_to_the_next_are_not_about_zero(bench: Callable[..., Bench]) -> None:
    """The beat is bent by more than half an order, and noise leaves most orders open besides."""
    direct = bench(height=HEIGHT, width=WIDTH, blur=0.7, dark=6.0)
    mirrored = replace(direct, u=655.0 - direct.u + np.linspace(0, 12, HEIGHT)[:, None])
    phase = taken(direct, mirrored, 0.2)
    wrong = np.abs(phase.u - direct.u) > PERIODS[0] / 2
    assert np.mean(wrong) < 2e-3  # 0.035 by pixels about halfway alone
    assert np.mean(phase.flags & (Flag.DISAGREEMENT | Flag.UNSURE) > 0) > 0.5


@pytest.mark.parametrize("turned", [False, True])
def test_pairs_lie_along_the_stripes(turned: bool) -> None:
    place: NDArray[np.float32] = np.tile(np.arange(320, dtype=np.float32), (240, 1))
    pairs = look_at(place.T.copy() if turned else place)
    assert pairs.axis == (1 if turned else 0)
    one, other = pairs.split(np.ones(pairs.shape))
    assert pairs.around(one + other).shape == (TILES, TILES)
    along = (pairs.rows, pairs.columns)[pairs.axis]
    assert np.all(along[1::2] - along[::2] == 2)
