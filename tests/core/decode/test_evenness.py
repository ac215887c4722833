"""The evenly lit image under fringes that a response bends, against the even light that they have in common."""

from __future__ import annotations

import numpy as np

from core.decode import decode
from core.patterns import Lines, brightness, gray_and_phase
from tests.core.decode.conftest import Bench

PERIOD, COUNT = 16.0, 320


def test_fringes_that_a_response_leaves_in_the_mean_of_four_steps_are_taken_out() -> None:
    """Of gamma 1.4 it is the fourth harmonic, a quarter of a grey value: it moved bright dots by 0.004 px."""
    y, x = np.mgrid[:160, :240]
    b = Bench(u=20.3 + 0.9 * x + 0.3 * y, v=62 + y - 0.2 * x, lines=(COUNT, COUNT), blur=0.4, gain=150.0, dark=1.0)
    patterns = [p for axis in "xy" for p in gray_and_phase(axis, COUNT, cell=8, periods=[PERIOD], steps=4)]
    shown = [Lines.of(p.axis, brightness(p, np.arange(COUNT)) ** 1.4) for p in patterns]
    image = decode(patterns, b.take(shown), lines=(COUNT, COUNT)).image
    for place in (b.u, b.v):
        turn = 4 * 2 * np.pi * (place + 0.5) / PERIOD
        design = np.stack([np.ones_like(turn), np.cos(turn), np.sin(turn)]).reshape(3, -1).T
        _, cosine, sine = np.linalg.lstsq(design, image.ravel(), rcond=None)[0]
        assert np.hypot(cosine, sine) < 0.08  # 0.25 without; the noise leaves 0.003
