"""Orders of fringes that noise leaves open in single pixels, told by those around."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.decode import Flag, absolute, decode
from core.patterns import Phase, gray_and_phase

N = 640


def fringes(periods: tuple[float, ...]) -> list[Phase]:
    return [p for p in gray_and_phase("x", N, cell=1, periods=periods) if isinstance(p, Phase)]


@pytest.mark.parametrize(("periods", "gain"), [((16, 17, 18), 40), ((13, 14.3, 16.1), 27)])
def test_surfaces_are_whole_whose_pixels_alone_are_too_noisy(bench, judge, monkeypatch, periods, gain) -> None:
    b, patterns = bench(blur=1.0, height=120, dark=2.0, gain=gain), fringes(periods)
    images = b.take(patterns)
    phase = decode(patterns, images, lines=(N, N))
    result = judge(phase, b.u, min(periods) / 2)
    assert result.gross == 0
    assert result.valid > 0.99
    assert 0.9 < result.sigma_ratio < 1.15
    told = np.isfinite(phase.u)
    assert not np.any(phase.flags[told] & int(Flag.UNSURE | Flag.DISAGREEMENT | Flag.NO_U))
    monkeypatch.setattr(absolute, "ask_neighbours", lambda *args: None)
    assert judge(decode(patterns, images, lines=(N, N)), b.u, 8).valid < 0.85


def test_no_surface_is_prolonged_beyond_its_edge(bench, judge) -> None:
    """Plates whole periods and parts of one before the ground: what their pixels show together speaks against it."""
    b, periods = bench(blur=1.0, height=160, width=500, count=400, dark=2.0, gain=45), (40, 42)
    row, column = np.mgrid[0:160, 0:500]
    plate = (row // 20 % 2 == 0) & (column // 25 % 2 == 0)
    raised = periods[0] * np.array([1, -1, 0.5, 1.02, -2])[(column // 50 + row // 40) % 5]
    b = replace(b, u=np.where(plate, np.clip(b.u + raised, 2, 397), b.u))
    patterns = fringes(periods)
    result = judge(decode(patterns, b.take(patterns), lines=(400, 400)), b.u, 8)
    assert result.gross <= 1.5e-4 * b.u.size  # without looking at them together there are three times as many
    assert result.valid > 0.8
    assert 0.9 < result.sigma_ratio < 1.15
