"""Light over a second surface bends the phases of one period: the code's frames show it, and sigma holds it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf

from core.decode import decode
from core.decode.pairs import TILES
from core.decode.surface.detours import _scattered
from core.decode.surface.moved import _evenly, _fitted
from core.patterns import Black, Code, Pattern, White, gray_and_phase
from tests.core.decode.conftest import Bench, field

HEIGHT, WIDTH = 240, 1000
FOLDED = np.arange(HEIGHT) >= HEIGHT // 2
NEAR = np.abs(np.arange(HEIGHT) - HEIGHT // 2) < 3 * HEIGHT // 16  # tiles that see both
SEQUENCES = {
    "sine": [*gray_and_phase("x", 640, cell=8, periods=[16.0]), White(), Black()],
    "sine alone": gray_and_phase("x", 640, cell=8, periods=[16.0]),
    "square": [*gray_and_phase("x", 640, cell=2, periods=[4], profile="square", first_shift_rad=np.pi / 2)],
}


TWO_SINES = gray_and_phase("x", 640, cell=8, periods=[16.0, 24.0])


def decoded(
    patterns: Sequence[Pattern],
    part: float,
    bench: Callable[..., Bench],
    gain: np.ndarray | float = 120.0,
    away: float | None = None,
):
    """Phase map where in the lower half `part` of the light comes from another line, and the truth.

    Another line is `away`, or the mirror image's.
    """
    direct = bench(height=HEIGHT, blur=0.6, gain=gain, dark=0.5)
    other = field(HEIGHT, WIDTH, 640)[:, ::-1] * 0.83 + 31.0 if away is None else direct.u + away
    mirrored = replace(direct, u=other)
    images = []
    for pattern, image in zip(patterns, direct.take(patterns), strict=True):
        second = part * mirrored.gain * mirrored.light(pattern)
        images.append(np.clip(np.round(image + np.where(FOLDED[:, None], second, 0)), 0, 255).astype(np.uint8))
    return decode(patterns, images, lines=(640, 480)), direct.u


@pytest.mark.parametrize("name", SEQUENCES)
@pytest.mark.parametrize("part", [0.08, 0.3])
def test_sigma_holds_light_by_a_second_way(name: str, part: float, bench: Callable[..., Bench]) -> None:
    """A quarter, told by few bits, and as if it came from anywhere; square waves of four lines are told by fewer."""
    phase, truth = decoded(SEQUENCES[name], part, bench)
    score = (phase.u - truth) / phase.sigma_u
    assert np.isfinite(phase.u).mean() > 0.98
    plain, bent = (float(np.sqrt(np.nanmean(np.square(score[rows & ~NEAR])))) for rows in (~FOLDED, FOLDED))
    assert 0.85 < plain < 1.15
    assert 0.75 < bent < (1.6 if name == "square" else 1.25)  # 3 to 20 without
    assert any("second way" in note for note in phase.notes)


@pytest.mark.parametrize("cell", [1, 2])
def test_sigma_of_a_code_alone_holds_light_by_a_second_way(cell: int, bench: Callable[..., Bench]) -> None:
    """It moves edges; what blur leaves of them is told with some caution, as without it. 1.2 and 1.6 without."""
    bits = 11 - cell
    patterns = [*(Code("gray", "x", bit, bits, cell) for bit in range(bits)), White(), Black()]
    assert not decoded(patterns, 0.0, bench)[0].notes
    phase, truth = decoded(patterns, 0.3, bench)
    score = (phase.u - truth) / phase.sigma_u
    assert np.isfinite(phase.u).mean() > 0.98
    plain, bent = (float(np.sqrt(np.nanmean(np.square(score[rows & ~NEAR])))) for rows in (~FOLDED, FOLDED))
    assert 0.75 < plain < 1.1
    assert 0.75 < bent < 1.1
    assert any("second way" in note for note in phase.notes) == (cell == 1)  # wide cells tell less than it changes


@pytest.mark.parametrize("cell", [1, 2, 8])
def test_levels_of_a_code_without_white_are_about_their_middle(cell: int, bench: Callable[..., Bench]) -> None:
    """Only the bits tell it: taken for 0, dark and bright bits were levels of one, and a second way was told."""
    bits = int(np.ceil(np.log2(640 / cell)))
    patterns = [Code("gray", "x", bit, bits, cell) for bit in range(bits)]
    phase, truth = decoded(patterns, 0.0, bench)
    assert not phase.notes
    assert 0.7 < np.sqrt(np.nanmean(np.square((phase.u - truth) / phase.sigma_u))) < 1.1
    if cell == 1:
        assert any("second way" in note for note in decoded(patterns, 0.3, bench)[0].notes)


def test_noise_of_a_camera_with_a_gamma_is_no_second_light(bench: Callable[..., Bench]) -> None:
    """Darkness is then by far noisier than any straight line over the grey values says."""
    patterns, rng = SEQUENCES["sine"], np.random.default_rng(3)
    direct = bench(height=HEIGHT, blur=0.4, gain=150.0, ambient=0.0, dark=0.0)
    light = [direct.gain * direct.light(p) + rng.normal(size=(HEIGHT, WIDTH)) for p in patterns]
    images = [np.uint8(np.round(255 * (np.clip(grey, 0, 255) / 255) ** (1 / 2.2))) for grey in light]
    assert not decode(patterns, images, lines=(640, 480)).notes


@pytest.mark.parametrize("name", SEQUENCES)
def test_nothing_is_added_to_straight_light(name: str, bench: Callable[..., Bench]) -> None:
    """Nor on a surface of dark and bright patches."""
    albedo = np.where((np.arange(HEIGHT)[:, None] // 23 + np.arange(WIDTH) // 31) % 2, 1.0, 0.2)
    phase, truth = decoded(SEQUENCES[name], 0.0, bench, gain=120.0 * albedo)
    score = (phase.u - truth) / phase.sigma_u
    assert 0.93 < np.sqrt(np.nanmean(score**2)) < 1.07
    assert not phase.notes


@pytest.mark.parametrize("away", [3.0, 11.0])
@pytest.mark.parametrize("part", [0.08, 0.3])
@pytest.mark.parametrize("name", ["sine", "sine alone", "two sines"])
def test_sigma_holds_light_from_as_few_lines_off_everywhere(
    name: str, part: float, away: float, bench: Callable[..., Bench]
) -> None:
    """No bit level far from edges shows it, but edges no longer lie where phases say. 2.9 to 19 without.

    Edges move as well, less where the light comes straight; of that their two sides tell most.
    """
    phase, truth = decoded({**SEQUENCES, "two sines": TWO_SINES}[name], part, bench, away=away)
    score = (phase.u - truth) / phase.sigma_u
    plain, bent = (float(np.sqrt(np.nanmean(np.square(score[rows & ~NEAR])))) for rows in (~FOLDED, FOLDED))
    assert 0.85 < plain < 1.15
    # what periods contradict each other is taken for the error of both; edges that are moved far, by 0.8 lines where
    # 0.3 of the light comes from 11 lines off, count as moved less
    assert 0.55 < bent < (2.4 if (part, away) == (0.3, 11.0) else 1.3)
    assert any("second way" in note for note in phase.notes)


def test_edges_seen_from_one_side_are_where_they_are() -> None:
    """Levels rise as a blurred edge does; in one corner nearly all pixels lie on its dark side."""
    rng, n = np.random.default_rng(5), 4000
    tile, sign = rng.integers(0, TILES**2, n), rng.choice([-1.0, 1.0], n)
    x = rng.uniform(-1, 1, n)
    corner = (tile % TILES > TILES - 4) & (tile // TILES > TILES - 4)
    x[corner] = rng.uniform(-0.9, 0.05, np.count_nonzero(corner))
    y = erf(x / 0.6) + rng.normal(0, 0.05, n)
    for odd, least, most in ((x, 8.0, np.inf), (_evenly(x, y, sign), 0.0, 4.0)):
        (offset, *_), variance = _fitted(tile, y, sign, odd)
        assert least < abs(offset[-2, -2]) / np.sqrt(variance[-2, -2]) < most


def test_pixels_that_are_looked_at_see_all_places_of_a_line_on_any_slope() -> None:
    """Of multiples of the golden ratio every second fell on the same place, on a board seen at 0.48 lines a pixel."""
    row, column = _scattered((512, 640))
    tile = row // 32 * TILES + column // 40
    assert (np.bincount(tile.ravel(), minlength=TILES**2) >= 16).all()
    draw, widest = np.random.default_rng(1), []
    for across, down in [(0.482, -0.067), *draw.uniform(-1.5, 1.5, (200, 2))]:
        phase = np.sort((across * column + down * row)[35:50, 50:65].ravel() % 8)
        widest.append(np.max(np.diff(phase, append=phase[0] + 8)))
    assert np.quantile(widest, 0.95) < 0.5
    assert widest[0] < 0.5
