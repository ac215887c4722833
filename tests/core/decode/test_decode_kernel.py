"""The compiled kernel against a plain numpy twin of its formulas, and the plan against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import DecodeOptions, decode
from core.decode.frames import sort_frames
from core.decode.kernels.compiled import angle, fast
from core.decode.kernels.kernel import scratch_for
from core.decode.kernels.words import read_bits
from core.decode.known import prepare
from core.decode.noise import Noise
from core.decode.plan import plan_axis, safest_steps
from core.decode.sample import limits_of
from core.decode.tables import fit_phase
from core.patterns import Black, Phase, White, brightness, gray_and_phase


def twin(patterns, images, lines, cell, period):
    """Gray code with white and black, one period: the textbook's decoding of every pixel, without validity."""
    g = {p: np.asarray(i, float) for p, i in zip(patterns, images, strict=True)}
    middle = (g[White()] + g[Black()]) / 2
    bits = [g[p] > middle for p in patterns if p.kind == "gray"]
    word, cells = np.zeros(middle.shape, int), np.zeros(middle.shape, int)
    for bit in bits:
        word = word ^ bit
        cells = 2 * cells + word
    steps = [p for p in patterns if p.kind == "phase"]
    design = np.array([[1, np.cos(p.shift_rad), np.sin(p.shift_rad)] for p in steps])
    flat = np.array([g[p].ravel() for p in steps])
    (_, c, s), *_ = np.linalg.lstsq(design, flat, rcond=None)
    phi = np.arctan2(s, c).reshape(middle.shape)
    place = period * phi / (2 * np.pi) - 0.5
    centre = cells * cell + (cell - 1) / 2
    return place + period * np.round((centre - place) / period), np.hypot(c, s).reshape(middle.shape)


@pytest.mark.parametrize(("dtype", "scale"), [(np.uint8, 1), (np.uint16, 200)])
def test_the_kernel_agrees_with_its_numpy_twin(bench, dtype, scale, monkeypatch) -> None:
    patterns = [*gray_and_phase("x", 640, cell=4, periods=[8]), White(), Black()]
    b = bench(height=37, width=701, bits=8 if scale == 1 else 16, gain=100 * scale, ambient=20 * scale, dark=scale**2)
    images = b.take(patterns)
    assert images[0].dtype == dtype
    monkeypatch.setattr("core.decode.absolute.draw_back", lambda *_: None)
    phase = decode(patterns, images, lines=(640, 640))
    place, modulation = twin(patterns, images, 640, 4, 8)
    good = np.isfinite(phase.u)
    assert good.mean() > 0.999
    assert np.abs(phase.u - place)[good].max() < 3e-4  # single precision: 640 * 2^-23 and some steps
    assert np.allclose(phase.modulation, modulation, rtol=1e-5)


def test_a_view_of_a_larger_image_decodes_like_its_copy(bench) -> None:
    patterns = [*gray_and_phase("x", 640, cell=4, periods=[8]), White(), Black()]
    images = bench().take(patterns)
    views = [image[3:30, ::2] for image in images]
    a = decode(patterns, views, lines=(640, 640))
    b = decode(patterns, [view.copy() for view in views], lines=(640, 640))
    assert np.array_equal(a.u, b.u, equal_nan=True)


@fast
def compiled_bits(table, source, limits, count, threshold, contrast, scratch):
    read_bits(table, source, limits, count, threshold, contrast, scratch.rows[0], scratch, scratch.masks)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shown", ["direct", "inverse", "both"])
@pytest.mark.parametrize("kind", ["gray", "binary"])
def test_bits_are_read_as_by_comparing_real_numbers(kind, shown, dtype) -> None:
    """Random grey values, thresholds and contrasts; eleven bits, so that words are put together from two octets."""
    count, bits, top = 501, 11, np.iinfo(dtype).max
    rng = np.random.default_rng(3)
    patterns = gray_and_phase("x", 2**bits, cell=1, periods=[], kind=kind, inverse=True)
    patterns = [p for p in patterns if shown == "both" or p.inverse == (shown == "inverse")]
    images = [rng.integers(0, top, count, dtype, endpoint=True) for _ in patterns]
    tables = prepare((*patterns, White(), Black()), (2**bits, 1)).tables
    fading = np.linspace(1, 0.5, bits, dtype=np.float32).round(1)
    table, scratch = tables[0]._replace(fading=fading), scratch_for(tables)
    limits = limits_of(Noise(2.0, 0.01, 0.1), float(top), DecodeOptions())
    threshold = (rng.uniform(0.2, 0.8, count) * top).astype(np.float32)
    contrast = (rng.uniform(0.1, 0.6, count) * top).astype(np.float32)
    addresses = np.array([image.ctypes.data for image in images], np.uint64)
    compiled_bits(table, (addresses, np.dtype(dtype).itemsize, 0), limits, count, threshold, contrast, scratch)

    g = {(p.bit, p.inverse): image.astype(float) for p, image in zip(patterns, images, strict=True)}
    word, unsure, near = (np.zeros(count, int) for _ in range(3))
    for bit in range(bits):
        if shown == "both":
            away, spread = (g[bit, False] - g[bit, True]) / 2, 0.5
        else:  # the threshold is the mean of two frames
            away, spread = (g[bit, False] - threshold if shown == "direct" else threshold - g[bit, True]), 1.5
        noise = 3.5 * np.sqrt(spread * np.maximum(2.0 + 0.01 * threshold, 0.1))
        place = 1 << (bits - 1 - bit)
        word += place * (away > 0)
        unsure += place * (np.abs(away) <= np.maximum(0.35 * fading[bit] * contrast, noise))
        near += place * (np.abs(away) <= np.maximum(0.6 * fading[bit] * contrast, noise))
    for expected, found in zip((word, unsure, near), scratch.masks.reshape(3, -1), strict=True):
        assert np.count_nonzero(expected) > count / 2
        assert np.count_nonzero(found[:count] != expected) <= 1  # where single precision meets a whole grey value


@fast
def compiled_angle(c, s):
    return angle(c, s)


def test_the_angle_is_arctan2() -> None:
    rng = np.random.default_rng(1)
    sides = rng.choice([-1, 0, 1], (1000, 2)) * 10 ** rng.uniform(-9, 4, (1000, 2))
    for c, s in sides[sides.any(axis=1)].astype(np.float32):
        difference = compiled_angle(c, s) - np.arctan2(float(s), float(c)) / (2 * np.pi)
        assert abs(difference - round(difference)) < 1.5e-7


@pytest.mark.parametrize("steps", [3, 4, 5, 6])
@pytest.mark.parametrize("period", [4, 5, 6, 7, 12])
def test_square_steps_are_fitted_as_the_lines_show_them(steps, period) -> None:
    """A wave of whole lines has its first harmonic where its lines are, not where the shift would put it."""
    patterns = tuple(Phase("x", period, steps, k, 0.3 + 2 * np.pi * k / steps, "square") for k in range(steps))
    phase = sort_frames(patterns).axes["x"].phases[0]
    lines = np.arange(period)
    wave = np.exp(2j * np.pi * (lines + 0.5) / period)
    u = np.linspace(0, period, 50, endpoint=False)
    grey = []
    for pattern in patterns:
        light = brightness(pattern, lines)
        first = 2 * np.mean(light * wave)
        # all harmonics but the first blurred away
        grey.append(light.mean() + (first * np.exp(-2j * np.pi * (u + 0.5) / period)).real)
    fit = fit_phase(phase)
    _, c, s = fit.solution @ np.array(grey)
    error = np.angle(np.exp(1j * (np.arctan2(s, c) - 2 * np.pi * (u + 0.5) / period)))
    equal = len({round(float(brightness(p, lines).mean()), 6) for p in patterns}) == 1
    if equal or steps > 4:
        assert np.abs(error).max() < 1e-9


@pytest.mark.parametrize(
    ("periods", "extent"),
    [((16.0, 17.0), 272), ((7.0, 9.0), 63), ((10.0, 80.0, 640.0), 640), ((16.0, 17.0, 18.0), 2448)],
)
def test_steps_resolve_every_line_and_nothing_beyond_the_common_period(periods, extent) -> None:
    """Brute force: follow the plan for noise-free phases of every line."""
    safety, steps = safest_steps(periods, float(extent), False)
    assert safety > 0
    inverse = 1 / np.array(periods)
    u = np.arange(0, extent - 1, 0.25)
    turns = (u[:, None] + 0.5) * inverse
    place = np.full(u.shape, (extent - 1) / 2)
    for vector in steps:
        beat = 1 / (np.array(vector) @ inverse)
        d = turns @ np.array(vector) - (place + 0.5) / beat
        place += beat * (d - np.round(d))
    assert np.abs(place - u).max() < 1e-6
    assert safest_steps(periods, extent * 1.01, False) == (0.0, ())


def test_the_plan_takes_no_more_steps_than_safety_asks() -> None:
    frames = sort_frames(gray_and_phase("x", 640, cell=2, periods=[4])).axes["x"]
    plan = plan_axis(frames, 640, "capture")
    assert plan.steps == ((1,),)
    assert plan.code is not None
    assert len(plan.code.direct) == 9
    three = sort_frames([p for p in gray_and_phase("x", 640, cell=1, periods=[8, 64, 640]) if p.kind == "phase"])
    assert len(plan_axis(three.axes["x"], 640, "capture").steps) <= 4
