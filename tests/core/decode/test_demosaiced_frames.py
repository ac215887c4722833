"""Grey frames of a colour camera, whose pixels were interpolated from a mosaic: unlike noise in odd and even places."""

from dataclasses import replace

import cv2
import numpy as np

from core.decode import decode
from core.patterns import Black, White, gray_and_phase

N = 640


def test_sigma_is_of_all_pixels_not_of_those_in_even_rows(bench) -> None:
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16]), White(), Black()]
    v, u = np.mgrid[0:240, 0:320]
    b = replace(bench(gain=120, dark=9.0), u=60 + 1.31 * u + 0.07 * v)
    frames = [cv2.cvtColor(cv2.cvtColor(m, cv2.COLOR_BayerRG2BGR), cv2.COLOR_BGR2GRAY) for m in b.take(patterns)]
    phase = decode(patterns, frames, lines=(N, N))
    ratio = (phase.u - b.u) / phase.sigma_u
    assert np.isfinite(ratio[1:-1, 1:-1]).mean() > 0.999
    assert 0.9 < np.sqrt(np.nanmean(ratio**2)) < 1.15
    repeated = np.concatenate([ratio[[0, -1]].ravel(), ratio[:, [0, -1]].ravel()])
    assert np.isnan(repeated).all()


def test_rows_that_the_scene_repeats_are_sound(bench) -> None:
    """Columns straight up, without noise: every row is as the one beside it, at the image's rim and within."""
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16]), White(), Black()]
    b = replace(bench(dark=0.0), u=np.tile(60 + 1.31 * np.arange(320), (240, 1)))
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    assert np.isfinite(phase.u).mean() > 0.999
