"""Light sections: how far the centroid of discrete lines is off depends on a blur that the sweep itself tells."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

from core.decode import decode
from core.patterns import Black, Line, White
from tests.core.decode.conftest import Bench


@pytest.mark.parametrize(
    ("width", "pitch", "blur"),
    [(1, 1, 0.3), (2, 2, 0.4), (2, 2, 0.9), (3, 1, 0.6), (4, 4, 0.6), (4, 4, 1.0), (2, 4, 0.5), (2, 4, 0.7)],
)
def test_sigma_holds_the_ripple_of_any_blur(width: int, pitch: int, blur: float) -> None:
    """Lines as exact boxes under a Gaussian; with one rig's blur for all, errors were 0.14 to 1.1 sigmas.

    Between lines with gaps there is no light, and the sigmas were NaN.
    """
    rng, (y, x) = np.random.default_rng(2), np.mgrid[:60, :160]
    u = 46 + 0.43 * x + 0.06 * y + 0.4 * np.sin(y / 7)
    patterns = [*(Line("x", i, width) for i in range(40, 128, pitch)), Black()]
    images = []
    for pattern in patterns:
        light = np.zeros(u.shape)
        if isinstance(pattern, Line):
            ends = pattern.index - 0.5, pattern.index + width - 0.5
            light = 0.5 * (erf((u - ends[0]) / (blur * 2**0.5)) - erf((u - ends[1]) / (blur * 2**0.5)))
        images.append(np.uint8(np.rint(12 + 130 * light + rng.normal(size=u.shape))))
    phase = decode(patterns, images, lines=(200, 200))
    good = np.isfinite(phase.u)
    assert good.mean() > (0.95 if pitch == width or width > pitch else 0.6)
    assert 0.65 < np.sqrt(np.mean(np.square((phase.u - u)[good] / phase.sigma_u[good]))) < 1.25


@pytest.mark.parametrize(
    ("first", "last", "width", "pitch"), [(70, 90, 1, 1), (64, 96, 4, 4), (70, 199, 1, 1), (66, 94, 2, 1)]
)
def test_lines_that_a_sweep_leaves_out_are_no_lines_of_it(first: int, last: int, width: int, pitch: int) -> None:
    """What lies beside the sweep is lit by the blur of its first and last line, which were its coordinates."""
    _, x = np.mgrid[:40, :300]
    bench = Bench(40 + 0.55 * x, lines=(200, 200), blur=0.7, ambient=12.0, gain=150.0)
    patterns = [*(Line("x", i, width) for i in range(first, last, pitch)), White(), Black()]
    images = bench.take(patterns)
    phase = decode(patterns, images, lines=(200, 200))
    alone = decode(patterns, images)  # nor does it say more where nobody knows how many lines there are
    assert np.array_equal(np.isfinite(alone.u), np.isfinite(phase.u))
    good = np.isfinite(phase.u)
    assert np.abs(phase.u - bench.u)[good].max() < max(1.0, width / 2)
    assert 0.65 < np.sqrt(np.mean(np.square((phase.u - bench.u)[good] / phase.sigma_u[good]))) < 1.25
    assert good[(bench.u > first + 2 * width + 2) & (bench.u < last - 2 * width - 3)].mean() > 0.995
    beside = (bench.u < first - 1) | (bench.u > last + 1)
    assert not good[beside].any()
