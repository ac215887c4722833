"""Light over a second surface bends the phases of all periods differently: sigma holds that, where it is so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from core.decode import Flag, decode
from core.decode.surface.agreement import TILES
from core.patterns import Pattern, Phase, gray_and_phase
from tests.core.decode.conftest import Bench, field

HEIGHT, WIDTH = 240, 1000
FOLDED = np.arange(HEIGHT) >= HEIGHT // 2


def taken(patterns: Sequence[Pattern], part: float, direct: Bench) -> list[NDArray[np.uint8]]:
    """Frames in whose lower half `part` of the light comes from another line."""
    mirrored = replace(direct, u=field(HEIGHT, WIDTH, 640)[:, ::-1] * 0.83 + 31.0, ambient=0.0, dark=0.0, seed=2)
    images = []
    for pattern, image in zip(patterns, direct.take(patterns), strict=True):
        second = part * mirrored.gain * mirrored.light(pattern)
        images.append(np.clip(np.round(image + np.where(FOLDED[:, None], second, 0)), 0, 255).astype(np.uint8))
    return images


def ratios(steps: int, part: float, bench: Callable[..., Bench]) -> tuple[float, float]:
    """Observed over predicted error where the light is direct only, and where `part` comes from another line."""
    patterns = gray_and_phase("x", 640, cell=24, periods=[16.0, 24.0], steps=steps)
    direct = bench(height=HEIGHT, blur=0.7, dark=0.5)
    phase = decode(patterns, taken(patterns, part, direct), lines=(640, 480))
    score = (phase.u - direct.u) / phase.sigma_u
    assert np.isfinite(phase.u).mean() > 0.98
    plain, bent = (float(np.sqrt(np.nanmean(np.square(score[rows])))) for rows in (~FOLDED, FOLDED))
    return plain, bent


@pytest.mark.parametrize("steps", [3, 4])
def test_sigma_holds_what_the_periods_contradict_each_other(steps: int, bench: Callable[..., Bench]) -> None:
    """A quarter: of two periods only the difference is seen, and that both are as wrong as each other is assumed."""
    plain, bent = ratios(steps, 0.08, bench)
    assert 0.85 < plain < 1.15
    assert 0.75 < bent < 1.25


def test_nothing_is_added_where_they_agree(bench: Callable[..., Bench]) -> None:
    plain, same = ratios(4, 0.0, bench)
    assert 0.93 < plain < 1.05
    assert 0.93 < same < 1.05


def test_orders_that_a_contradiction_leaves_open_are_refused(bench: Callable[..., Bench]) -> None:
    """A tenth by a second way turns the difference of neighbouring periods by up to 0.86 of a fringe's 1/27 turn."""
    patterns = gray_and_phase("x", 640, cell=24, periods=[27.0, 28.0], steps=8)
    patterns = [p for p in patterns if isinstance(p, Phase)]
    direct = bench(height=HEIGHT, blur=0.7, dark=0.5)
    phase = decode(patterns, taken(patterns, 0.1, direct), lines=(640, 480))
    valid, wrong = np.isfinite(phase.u), np.abs(phase.u - direct.u) > 2
    assert wrong.mean() < 5e-4  # 0.15 without the test
    beyond = HEIGHT // TILES  # what tells it is taken over the tiles beside, too; two more were refused
    assert valid[: HEIGHT // 2 - beyond].mean() > 0.99
    assert np.mean(phase.flags[FOLDED][~valid[FOLDED]] & Flag.DISAGREEMENT > 0) > 0.5
