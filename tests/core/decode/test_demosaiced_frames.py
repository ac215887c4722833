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
    inner = np.s_[2:-2, 2:-2]  # what is beyond the image is repeated
    ratio = ((phase.u - b.u) / phase.sigma_u)[inner]
    assert np.isfinite(ratio).mean() > 0.999
    assert 0.9 < np.sqrt(np.nanmean(ratio**2)) < 1.15
