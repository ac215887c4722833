"""Square waves of few steps: harmonics bend their phase; what the modulation tells of the blur straightens it."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import decode
from core.decode.absolute import _prepare as prepare
from core.decode.harmonics import HIGHEST, measure_bend
from core.decode.noise import Noise
from core.decode.sample import take_sample
from core.patterns import Black, White, gray_and_phase


def square(period: int, steps: int):
    return [*gray_and_phase("x", 640, cell=period // 2, periods=[period], steps=steps, profile="square"),
            White(), Black()]  # fmt: skip


@pytest.mark.parametrize(("period", "steps", "blur"), [(8, 4, 0.8), (8, 6, 0.6), (16, 3, 1.0), (16, 8, 0.8)])
def test_the_phase_of_few_square_steps_is_straight(bench, judge, period, steps, blur, monkeypatch) -> None:
    b, patterns = bench(blur=blur, gain=160.0, dark=0.25), square(period, steps)
    images = b.take(patterns)
    straight = judge(decode(patterns, images, lines=(640, 640)), b.u, 2.0)
    monkeypatch.setattr("core.decode.absolute.measure_bend", lambda table, *_: table)
    bent = judge(decode(patterns, images, lines=(640, 640)), b.u, 2.0)
    assert straight.valid > 0.99
    assert straight.gross == 0
    assert straight.rms < 0.5 * bent.rms
    assert bent.sigma_ratio > 2  # noise of half a grey value is not what limits it
    assert 0.2 < straight.sigma_ratio < 1.3  # sigma allows for a blur that is not quite known


def test_a_wave_of_four_lines_out_of_focus_stays_as_it_is(bench) -> None:
    """The reference's cross pattern: nothing but the first harmonic is left."""
    b = bench(blur=0.9)
    sequence = prepare(tuple(square(4, 4)), (640, 640))
    table = sequence.tables[0]
    sample = take_sample(b.take(square(4, 4)))
    assert measure_bend(table, sequence.spectra[0], sample, Noise(4.0, 0.0, 0.1)) is table


@pytest.mark.parametrize("period", [8, 16])  # of four lines a sine is as square as a square wave
def test_waves_that_show_nothing_but_their_first_harmonic_stay_as_they_are(bench, period) -> None:
    """Seen through a lens that dims the first harmonic little and passes no other, phases crowd nowhere."""
    smooth = gray_and_phase("x", 640, cell=period // 2, periods=[period], steps=4, first_shift_rad=np.pi / 2)
    sequence = prepare(tuple(square(period, 4)), (640, 640))
    table = sequence.tables[0]
    sample = take_sample(bench(blur=0.3).take([*smooth, White(), Black()]))
    assert measure_bend(table, sequence.spectra[0], sample, Noise(4.0, 0.0, 0.1)) is table


@pytest.mark.parametrize("period", [4, 8, 16])
def test_the_first_harmonic_of_a_square_wave_is_known(period) -> None:
    """That of lines lit by halves: cosine part 2/pi of the light, seen at the edge of the wave's first line."""
    (spectrum,) = prepare(tuple(square(period, 4)), (640, 640)).spectra[0]
    first = spectrum[HIGHEST + 1]
    assert abs(first) == pytest.approx(2 / np.pi, rel=1e-5)
    assert np.angle(first) == pytest.approx(0, abs=1e-5)
    assert abs(spectrum[HIGHEST + 2]) < 1e-6  # no even harmonics


def test_sine_waves_have_no_harmonics_to_straighten() -> None:
    patterns = [*gray_and_phase("x", 640, cell=4, periods=[8]), White(), Black()]
    assert [len(spectrum) for spectrum in prepare(tuple(patterns), (640, 640)).spectra[0]] == [0]
