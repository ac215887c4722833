"""Several exposures in one capture: what saturates in one is seen in another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.decode import decode
from core.errors import InputError
from core.patterns import Black, White, gray_and_phase

N = 640
PATTERNS = [*gray_and_phase("x", N, cell=8, periods=[16]), White(), Black()]
EXPOSURES = (4.0, 20.0)


def exposed(bench, offset: float = 5.0):
    """Albedo from 0.02 to 1 in bands: no exposure shows all of it. The light grows with it, the offset does not."""
    albedo = np.geomspace(0.02, 1, 40)[:, None]
    patterns, images, exposures = [], [], []
    b = bench(blur=1.0)
    for k, ms in enumerate(EXPOSURES):
        light = albedo * ms * 45
        taken = replace(b, ambient=offset + 0.1 * light, gain=light, dark=1.0, shot=0.02, seed=k).take(PATTERNS)
        patterns, images, exposures = patterns + PATTERNS, images + taken, exposures + [ms] * len(PATTERNS)
    return b, patterns, images, exposures


def test_all_albedos_decode_where_each_exposure_alone_loses_some(bench, judge) -> None:
    b, patterns, images, exposures = exposed(bench)
    fused = judge(decode(patterns, images, lines=(N, N), exposures_ms=exposures), b.u, 8)
    assert fused.gross == 0
    assert fused.valid > 0.99
    assert 0.8 < fused.sigma_ratio < 1.25  # noise is taken to grow evenly with the light, which it does not quite
    for k in range(2):
        mine = slice(k * len(PATTERNS), (k + 1) * len(PATTERNS))
        assert judge(decode(PATTERNS, images[mine], lines=(N, N)), b.u, 8).valid < fused.valid - 0.1


def test_grey_values_are_those_of_the_longest_exposure(bench) -> None:
    _, patterns, images, exposures = exposed(bench)
    phase = decode(patterns, images, lines=(N, N), exposures_ms=exposures)
    truth = np.geomspace(0.02, 1, 40) * EXPOSURES[1] * 45
    assert np.nanmedian(phase.modulation, axis=1) == pytest.approx(0.93 * truth / 2, rel=0.05)  # blur leaves 0.93


def test_equal_exposures_change_nothing(bench) -> None:
    images = bench(blur=1.0).take(PATTERNS)
    plain = decode(PATTERNS, images, lines=(N, N))
    told = decode(PATTERNS, images, lines=(N, N), exposures_ms=[10.0] * len(PATTERNS))
    assert np.array_equal(plain.u, told.u, equal_nan=True)
    assert plain.image.dtype == told.image.dtype


def test_an_exposure_that_is_missing_is_named(bench) -> None:
    _, patterns, images, exposures = exposed(bench)
    with pytest.raises(InputError, match='frame 3: no "exposure_ms"'):
        decode(patterns, images, lines=(N, N), exposures_ms=[*exposures[:3], None, *exposures[4:]])
