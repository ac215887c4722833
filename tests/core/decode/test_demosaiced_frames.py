"""Grey frames of a colour camera, whose pixels were interpolated from a mosaic: unlike noise in odd and even places."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.decode import decode
from core.patterns import Black, White, gray_and_phase
from tests.core.decode.conftest import Bench

N = 640
BILINEAR, ALONG_EDGES = cv2.COLOR_BayerRG2BGR, cv2.COLOR_BayerRG2BGR_EA


def made_grey(mosaic: np.ndarray, way: int = BILINEAR) -> np.ndarray:
    return cv2.cvtColor(cv2.cvtColor(mosaic, way), cv2.COLOR_BGR2GRAY)


class Bent(Bench):
    """Under a power law of its light, which gives its waves harmonics."""

    def light(self, pattern):
        return np.maximum(super().light(pattern), 0) ** 1.8


def test_sigma_is_of_all_pixels_not_of_those_in_even_rows(bench) -> None:
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16]), White(), Black()]
    v, u = np.mgrid[0:240, 0:320]
    b = replace(bench(gain=120, dark=9.0), u=60 + 1.31 * u + 0.07 * v)
    frames = [made_grey(mosaic) for mosaic in b.take(patterns)]
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


@pytest.mark.parametrize("way", [BILINEAR, ALONG_EDGES], ids=["bilinear", "along edges"])
def test_harmonics_of_interpolated_pixels_are_not_those_of_others(way: int) -> None:
    """Four steps: no phase hangs on the second harmonic, of which interpolation takes more: sigma was twice it."""
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16]), White(), Black()]
    v, u = np.mgrid[0:240, 0:320]
    b = Bent(60 + 1.31 * u + 0.07 * v, gain=160, dark=1.0, shot=0.02)
    phase = decode(patterns, [made_grey(m, way) for m in b.take(patterns)], lines=(N, N))
    assert 0.7 < np.sqrt(np.nanmean(((phase.u - b.u) / phase.sigma_u) ** 2)) < 1.15


@pytest.mark.parametrize("way", [BILINEAR, ALONG_EDGES], ids=["bilinear", "along edges"])
def test_what_edges_of_dots_contradict_counts_little_within_them(way: int) -> None:
    """Interpolation along edges goes another way in every frame there: sigma was nine times the error within dots."""
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16]), White(), Black()]
    v, u = np.mgrid[0:480, 0:640]
    away = np.hypot((u + 0.3 * v) % 29 - 14.5, v % 29 - 14.5)
    b = Bench(10 + 0.96 * u + 0.07 * v, gain=10 + 170 / (1 + np.exp(3 * (away - 6))), dark=1.0, shot=0.02)
    phase = decode(patterns, [made_grey(m, way) for m in b.take(patterns)], lines=(N, N))
    within = away < 3
    assert 0.6 < np.sqrt(np.nanmean(((phase.u - b.u) / phase.sigma_u)[within] ** 2)) < 1.2
