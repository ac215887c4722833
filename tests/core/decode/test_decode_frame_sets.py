"""Whatever frames there are: coordinates against the truth of an independent forward model."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import decode
from core.errors import InputError
from core.patterns import Black, Code, Phase, White, gray_and_phase, light_sections, reference_sequence

REFERENCE = [White(), Black()]
N = 640


@pytest.mark.parametrize("kind", ["gray", "binary"])
@pytest.mark.parametrize(("cell", "period"), [(2, 4), (4, 4), (1, 4), (3, 4), (16, 16), (16, 20), (32, 32)])
@pytest.mark.parametrize("threshold", ["white and black", "mean of steps", "inverse"])
def test_code_and_phase_give_no_gross_error(bench, judge, kind, cell, period, threshold) -> None:
    """Cells of a period, of half and odd parts of it; at their edges several binary bits change at once."""
    patterns = gray_and_phase("x", N, cell=cell, periods=[period], kind=kind, inverse=threshold == "inverse")
    patterns += REFERENCE if threshold == "white and black" else []
    b = bench()
    result = judge(decode(patterns, b.take(patterns), lines=(N, N)), b.u, period / 2)
    assert result.gross <= 1e-4 * b.u.size  # the bound the specification sets
    assert result.valid > 0.985


@pytest.mark.parametrize("steps", [3, 4, 5, 8])
@pytest.mark.parametrize(("bits", "shift"), [(8, 0), (12, 0), (12, 4), (16, 0)])
def test_sine_steps_at_every_depth_are_as_exact_as_predicted(bench, judge, steps, bits, shift) -> None:
    scale = 2.0 ** (bits - 8)
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16], steps=steps), *REFERENCE]
    b = bench(bits=bits, shift=shift, gain=120 * scale, ambient=20 * scale, dark=scale**2, shot=0.02 * scale)
    result = judge(decode(patterns, b.take(patterns), lines=(N, N)), b.u, 8)
    assert result.gross == 0
    assert result.valid > 0.999
    assert 0.9 < result.sigma_ratio < 1.15  # the bounds the specification sets


def test_square_steps_of_the_reference_sequence_are_as_exact_as_predicted(bench, judge) -> None:
    """The published noise, grey value 2 at a modulation of 25; blur of 0.7 lines leaves little of the odd harmonics."""
    patterns = reference_sequence(N, N)
    b = bench(height=160, width=400, both=True, blur=0.7, gain=68.0)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    assert 22 < np.median(phase.modulation) < 28
    for axis, truth in (("x", b.u), ("y", b.v)):
        result = judge(phase, truth, 2, axis)
        assert result.gross == 0
        assert result.valid > 0.999
        assert 0.9 < result.sigma_ratio < 1.15
        # sigma of a line / (2 pi) * 4 * sigma_g / (sqrt(2) C) for 4 steps, between the extremes of C
        assert 4 / (2 * np.pi) * 2 / (np.sqrt(2) * 28) < result.rms < 1.15 * 4 / (2 * np.pi) * 2 / (np.sqrt(2) * 22)


@pytest.mark.parametrize(
    "periods",
    [[640, 80, 10], [16, 17, 18], [100, 96, 90], [13.7, 15.1, 640.0], [640]],
    ids=["hierarchical", "three close", "three long", "real", "one over all lines"],
)
def test_several_periods_need_no_code(bench, judge, periods) -> None:
    patterns = [p for p in gray_and_phase("x", N, cell=1, periods=periods) if isinstance(p, Phase)]
    b = bench(blur=1.0, gain=150, dark=1.0)
    result = judge(decode(patterns, b.take(patterns), lines=(N, N)), b.u, min(periods) / 2)
    assert result.gross == 0
    assert result.valid > (0.95 if len(periods) == 1 else 0.985)
    assert 0.9 < result.sigma_ratio < 1.15


def test_waves_drawn_from_the_first_line_to_the_last_are_one_line_short(bench, judge) -> None:
    """``linspace(0, 2 pi k, N)`` repeats after N - 1 lines: what lies at either end is open, all else is told."""
    b = bench(blur=1.0, gain=150, dark=1.0)
    periods = [(N - 1) / k for k in (49, 44, 40)]
    uncoded = [p for p in gray_and_phase("x", N, cell=1, periods=periods) if isinstance(p, Phase)]
    coded = [*gray_and_phase("x", N, cell=40, periods=[(N - 1) / 16]), *REFERENCE]
    for patterns, ends in ((uncoded, 2.0), (coded, 0.0)):
        phase = decode(patterns, b.take(patterns), lines=(N, N))
        result = judge(phase, b.u, 6)
        assert result.gross == 0
        assert 0.9 < result.sigma_ratio < 1.15
        inside = (b.u > ends) & (b.u < N - 1 - ends)
        assert np.isfinite(phase.u[inside]).mean() > 0.985
        assert ends == 0 or not np.isfinite(phase.u[np.abs(b.u - (N - 1) / 2) > N / 2 - ends / 4]).any()
    short = [Phase("x", 610 / k, 4, i, i * np.pi / 2) for k in (49, 44, 40) for i in range(4)]
    with pytest.raises(InputError, match="tell 610 of 640 lines apart"):
        decode(short, b.take(short), lines=(N, N))


def test_cells_wider_than_the_period_are_bridged_by_further_periods(bench, judge) -> None:
    for cell, periods in ((64, [16, 128]), (64, [16, 18])):
        patterns = [*gray_and_phase("x", N, cell=cell, periods=periods), *REFERENCE]
        b = bench(blur=1.0)
        result = judge(decode(patterns, b.take(patterns), lines=(N, N)), b.u, 8)
        assert result.gross == 0
        assert result.valid > 0.99


def test_uneven_shifts_in_any_order_are_fitted(bench, judge) -> None:
    shifts = [0.0, 0.7, 1.9, 3.0, 4.4]
    phases = [Phase("x", 16.5, 5, k, s) for k, s in enumerate(shifts)]
    patterns = [*gray_and_phase("x", N, cell=8, periods=[]), *phases, *REFERENCE][::-1]
    b = bench(blur=1.0, gain=150)
    result = judge(decode(patterns, b.take(patterns), lines=(N, N)), b.u, 8)
    assert result.gross == 0
    assert 0.9 < result.sigma_ratio < 1.15


@pytest.mark.parametrize("kind", ["gray", "binary"])
@pytest.mark.parametrize("cell", [1, 4])
def test_code_alone_gives_the_middle_of_its_cell_or_its_edge(bench, judge, kind, cell) -> None:
    patterns = gray_and_phase("x", N, cell=cell, periods=[], kind=kind, inverse=True) + REFERENCE
    b = bench(blur=0.4)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    result = judge(phase, b.u, cell)
    assert result.gross == 0
    assert result.valid > 0.95
    assert 0.9 < result.sigma_ratio < 1.1
    on_cells = (phase.u[np.isfinite(phase.u)] - (cell - 1) / 2) / cell * (2 if kind == "gray" else 1)
    assert np.allclose(on_cells, np.round(on_cells))
    if kind == "binary":
        assert abs(result.rms - cell / np.sqrt(12)) < 0.01  # even distribution over the cell
    else:
        assert result.rms < 0.9 * cell / np.sqrt(12)


@pytest.mark.parametrize("blur", [0.8, 1.2, 2.0, 3.0])
def test_gray_code_alone_does_without_bits_that_are_not_resolved(bench, judge, blur) -> None:
    patterns = gray_and_phase("x", N, cell=1, periods=[], inverse=True) + REFERENCE
    b = bench(blur=blur)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    result = judge(phase, b.u, 1)
    assert result.valid > 0.95
    assert 0.3 < result.sigma_ratio < 1.1
    assert np.nanmax(np.abs(phase.u - b.u) / phase.sigma_u) < 4


@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.parametrize("black", [True, False])
def test_light_sections_give_the_centre_of_the_line(bench, judge, width, black) -> None:
    patterns = light_sections("x", 96, width)[: None if black else -1]
    b = bench(count=96, width=300, blur=0.6, gain=120)
    result = judge(decode(patterns, b.take(patterns), lines=(96, 96)), b.u, 1)
    assert result.gross == 0
    assert result.valid > 0.999
    assert 0.75 < result.sigma_ratio < 1.25  # sampling a line at whole lines is not a normal error
    assert result.rms < 0.06


def test_one_axis_leaves_the_other_empty(bench, judge) -> None:
    patterns = gray_and_phase("y", N, cell=2, periods=[4])
    b = bench(height=400, width=30, both=True)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    assert np.isnan(phase.u).all()
    assert np.isnan(phase.sigma_u).all()
    assert judge(phase, b.v, 2, "y").gross == 0
    assert np.isfinite(phase.v).mean() > 0.99


def test_the_extent_follows_from_the_frames_where_the_projector_is_unknown(bench, judge) -> None:
    coded = gray_and_phase("x", N, cell=8, periods=[16])
    phases = [p for p in gray_and_phase("x", N, cell=1, periods=[640, 80, 10]) if isinstance(p, Phase)]
    for patterns in (coded, phases):
        b = bench(blur=1.0, gain=150)
        assert judge(decode(patterns, b.take(patterns)), b.u, 5).gross == 0


def test_a_bit_that_the_phase_makes_up_may_be_missing(bench, judge) -> None:
    """Without the last bit of cell 2 the cells are as wide as the period."""
    patterns = [p for p in gray_and_phase("x", N, cell=2, periods=[4]) if not (isinstance(p, Code) and p.bit == 8)]
    b = bench()
    result = judge(decode(patterns, b.take(patterns), lines=(N, N)), b.u, 2)
    assert result.gross == 0
    assert result.valid > 0.99


def test_repeated_frames_are_averaged(bench, judge) -> None:
    once = [*gray_and_phase("x", N, cell=8, periods=[16]), *REFERENCE]
    b = bench(blur=1.0)
    single = judge(decode(once, b.take(once), lines=(N, N)), b.u, 8)
    double = judge(decode(once * 2, b.take(once * 2), lines=(N, N)), b.u, 8)
    assert double.rms == pytest.approx(single.rms / np.sqrt(2), rel=0.05)
    assert 0.9 < double.sigma_ratio < 1.15
