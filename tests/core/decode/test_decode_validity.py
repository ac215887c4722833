"""Sigma from the frames' own noise, and what makes a pixel invalid."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.decode import DecodeOptions, Flag, decode
from core.decode.chosen import take_sample
from core.decode.frames import sort_frames
from core.decode.noise import contrasts, estimate_noise
from core.decode.sample import measure_noise
from core.patterns import Black, Lines, Phase, SequenceSpec, White, brightness, gray_and_phase, reference_sequence
from tests.core.decode.conftest import Bench

N = 640
REFERENCE = [White(), Black()]


def noise_of(steps: int, inverse: bool, reference: bool, dark: float, shot: float):
    """The noise model from a capture of sine steps whose noise is known, without quantisation."""
    patterns = gray_and_phase("x", 64, cell=8, periods=[16], steps=steps, inverse=inverse)
    patterns += REFERENCE if reference else []
    found = contrasts(sort_frames(patterns), len(patterns))
    rng = np.random.default_rng(5)
    u, albedo = rng.uniform(0, 63, 20000), rng.uniform(0.2, 1, 20000)
    light = [np.interp(u, np.arange(64), _light(p)) for p in patterns]
    grey = np.array([albedo * (20 + 200 * part) for part in light])
    grey += rng.normal(size=grey.shape) * np.sqrt(dark + shot * grey)
    return found, estimate_noise((found @ grey).ravel(), (found**2 @ grey).ravel(), 0.0)


def _light(pattern):
    from core.patterns import brightness

    return brightness(pattern, np.arange(64))


@pytest.mark.parametrize(
    ("steps", "inverse", "reference"), [(4, False, False), (8, False, True), (3, True, False), (3, False, True)]
)
def test_the_noise_model_is_found(steps, inverse, reference) -> None:
    """Read and shot noise from redundant steps; from bits with inverses; from white and black with three steps."""
    found, noise = noise_of(steps, inverse, reference, dark=3.0, shot=0.05)
    assert np.allclose(found @ found.T, np.eye(len(found)))
    # at the middle grey value, from at least 20,000 residuals: their variance is known to 1 %
    assert noise.dark + noise.shot * 70 == pytest.approx(3.0 + 0.05 * 70, rel=0.05)
    assert noise.shot == pytest.approx(0.05, rel=0.2)


@pytest.mark.parametrize("height", [37, 100])
def test_levels_that_differ_by_their_noise_alone_tell_no_shot_noise(bench, height: int) -> None:
    """Of a bit and its inverse the mean is the same everywhere; the even image, whose noise counts, is brighter."""
    patterns = gray_and_phase("x", N, cell=1, periods=[], inverse=True) + REFERENCE
    frames = sort_frames(patterns)
    found = contrasts(frames, len(patterns))
    for seed in range(8):
        images = bench(height, blur=0.4, seed=seed).take(patterns)
        noise = measure_noise(frames, found, take_sample(images), 255.0, images)
        assert noise.variance(np.array([85.0]))[0] == pytest.approx(4 + 1 / 12, rel=0.15)


def test_few_white_dots_on_black_tell_their_noise(bench) -> None:
    """A sample of all pixels holds some 150 of the dots'; their level is 60, the board's 8."""
    patterns = gray_and_phase("x", N, cell=8, periods=[16], steps=4)
    frames = sort_frames(patterns)
    found = contrasts(frames, len(patterns))
    v, u = np.mgrid[0:288, 0:372]
    dots = np.hypot(u % 31 - 15, v % 31 - 15) < 3.6
    variances = []
    for seed in range(8):
        scene = replace(bench(seed=seed), u=1.2 * u + 20, gain=np.where(dots, 110.0, 4.0))
        images = replace(scene, ambient=6.0, dark=2.0, shot=0.025).take(patterns)
        noise = measure_noise(frames, found, take_sample(images), 255.0, images)
        variances.append(float(noise.variance(np.array([60.0]))[0]))
    # from some 600 residuals each: 6 %, and 2 % for the mean of 8; quantisation adds 1/12
    true = 2.0 + 0.025 * 60 + 1 / 12
    assert np.mean(variances) == pytest.approx(true, rel=0.06)
    assert np.std(variances) < 0.06 * true


def test_a_single_capture_tells_the_noise_of_its_light_to_three_per_cent(bench) -> None:
    """Of a plate lit unevenly, as planes to be judged are: its predicted r.m.s. is no better than this."""
    patterns = gray_and_phase("x", N, cell=8, periods=[16], steps=4)
    frames = sort_frames(patterns)
    found = contrasts(frames, len(patterns))
    v, u = np.mgrid[0:480, 0:640]
    lit = 190 - 150 * np.hypot(u - 320, v - 240) / 400
    ratios = []
    for seed in range(8):
        images = replace(bench(seed=seed), u=0.9 * u + 20, gain=lit, dark=2.5, shot=0.02).take(patterns)
        noise = measure_noise(frames, found, take_sample(images), 255.0, images)
        ratios.append(np.sqrt(noise.variance(np.array([170.0]))[0] / (2.5 + 1 / 12 + 0.02 * 170)))
    # 32,000 residuals at levels to 100 tell a line that is 2 % sure at 170; with 4,000 they were 4 % off
    assert np.sqrt(np.mean(np.square(np.array(ratios) - 1))) < 0.03


def test_what_is_cut_off_at_0_does_not_tell_the_noise(bench) -> None:
    """A ground without light shows the upper half of its noise, of the plate in front a third of the image is lit."""
    patterns = gray_and_phase("x", N, cell=8, periods=[16], steps=4)
    frames = sort_frames(patterns)
    v, u = np.mgrid[0:288, 0:372]
    plate = (np.abs(u - 186) < 100) & (np.abs(v - 144) < 80)
    variances = []
    for seed in range(24):
        scene = replace(bench(seed=seed), u=1.2 * u + 20, gain=np.where(plate, 80.0, 0.0), dark=1.0, shot=0.0)
        images = replace(scene, ambient=np.where(plate, 12.0, 0.0)).take(patterns)
        noise = measure_noise(frames, contrasts(frames, len(patterns)), take_sample(images), 255.0, images)
        variances.append(float(noise.variance(np.array([2.0]))[0]))
    # from some 1,300 residuals each: 4 %; a slope by chance, of 2.3 % of them, halves one. Quantisation adds 1/12
    assert np.mean(variances) == pytest.approx(1.0 + 1 / 12, rel=0.06)


def test_three_steps_and_nothing_else_have_no_redundancy() -> None:
    phases = [Phase("x", 64, 3, k, 2 * np.pi * k / 3) for k in range(3)]
    assert len(contrasts(sort_frames(phases), 3)) == 0


def test_three_steps_alone_take_the_noise_from_the_scene(bench, judge) -> None:
    phases = [Phase("x", 640, 3, k, 2 * np.pi * k / 3) for k in range(3)]
    b = bench(blur=1.0, gain=150)
    result = judge(decode(phases, b.take(phases), lines=(N, N)), b.u, 50)
    assert 0.9 < result.sigma_ratio < 1.15


def test_sigma_is_as_predicted_where_light_varies(bench) -> None:
    """Shot noise and albedo: the ratio holds in the dark as in the bright half of the pixels."""
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16], steps=5), *REFERENCE]
    b = bench(gain=np.linspace(40, 200, 40)[:, None], ambient=10.0, dark=1.0, shot=0.05)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    z = (phase.u - b.u) / phase.sigma_u
    assert 0.9 < np.nanstd(z[:20]) < 1.15
    assert 0.9 < np.nanstd(z[20:]) < 1.15


@pytest.mark.parametrize("offset", [0.0, 60.0])
def test_a_camera_that_adds_an_offset_has_no_shot_noise_in_it(bench, judge, offset) -> None:
    """Dark and bright halves of a 12-bit image: a line through the origin would fit neither."""
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16]), *REFERENCE]
    bright = np.where(np.arange(40) < 12, 2500.0, 0.0)[:, None]
    b = bench(gain=bright, ambient=5.0 + offset, dark=16.0 - 0.35 * offset, shot=0.35, bits=12)
    result = judge(decode(patterns, b.take(patterns), lines=(N, N)), b.u, 8)
    assert result.gross == 0
    assert 0.9 < result.sigma_ratio < 1.15


def test_unlit_pixels_are_invalid(bench, judge) -> None:
    patterns = reference_sequence(N, N)
    b = bench(height=100, width=1000, both=True, gain=np.where(np.arange(1000) < 500, 68.0, 0.0)[None, :])
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    dark = np.arange(1000) >= 500
    assert np.isfinite(phase.u[:, dark]).mean() < 1e-4
    assert (phase.flags[:, dark] & Flag.LOW_MODULATION > 0).mean() > 0.999
    assert judge(phase, b.u, 2).gross == 0
    assert np.isfinite(phase.u[:, ~dark]).mean() > 0.995


@pytest.mark.parametrize(("bits", "shift"), [(8, 0), (12, 0), (12, 4)])
def test_steps_are_invalid_where_too_many_saturate(bench, bits, shift) -> None:
    """At the full scale of the container, or of a 12-bit sensor in 16-bit files: two of four steps tell no phase."""
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16]), *REFERENCE]
    full = 2.0**bits
    b = bench(gain=np.where(np.arange(40) < 20, 0.6, 1.5)[:, None] * full, ambient=0.05 * full, bits=bits, shift=shift)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    assert np.isfinite(phase.u[:20]).mean() > 0.99
    peaks = phase.flags[20:] & Flag.SATURATED > 0
    assert peaks.mean() > 0.3
    assert np.isnan(phase.u[20:][peaks]).all()


@pytest.mark.parametrize(("name", "full"), [("square", 255), ("sine", 255), ("power law", 255), ("sine", 235)])
def test_a_saturated_step_does_not_cost_the_pixel(bench, judge, name, full) -> None:
    """In half of the image; it is as good as the other three steps, or seven, make it, and sigma says so.

    A camera that ended at 235 seemed to have a tone curve; sigma was three times too large.
    """
    steps, gain = (8, 310.0) if name == "power law" else (4, 280.0)
    gray = gray_and_phase("x", N, cell=8, periods=[16], steps=steps)
    patterns = reference_sequence(axes=["x"]) if name == "square" else [*gray, *REFERENCE]
    b = bench(gain=np.where(np.arange(40) < 20, 150.0, gain * full / 255)[:, None], shot=0.02)
    if name == "power law":
        shown = [_bent(p) if isinstance(p, Phase) else p for p in patterns]
        images = b.take(shown)
    else:
        images = b.take(patterns)
    images = [np.minimum(image, full) for image in images]
    phase = decode(patterns, images, lines=(N, N))
    steps_seen = [image for image, p in zip(images, patterns, strict=True) if isinstance(p, Phase)]
    lost = np.max(steps_seen, axis=0) == full
    assert 0.1 < lost.mean() < 0.9
    z = ((phase.u - b.u) / phase.sigma_u)[lost]
    assert np.isfinite(z).mean() > 0.99
    assert 0.9 < np.sqrt(np.nanmean(z**2)) < 1.12
    assert judge(phase, b.u, 1).gross == 0


def _bent(pattern: Phase) -> Lines:
    light = brightness(pattern, np.arange(N)) ** 1.8
    return Lines("x", tuple(light.tolist()))


def test_noise_of_light_that_saturates_is_not_that_of_the_dark(bench, judge) -> None:
    """Every pixel that is lit has a saturated step, so only what is not lit shows its noise by all four."""
    patterns = [*(p for axis in "xy" for p in gray_and_phase(axis, N, cell=8, periods=[16])), *REFERENCE]
    lit = np.where(np.arange(600) < 250, 300.0, 0.0)[None, :]
    b = bench(height=300, width=600, both=True, gain=lit, ambient=10.0, dark=2.0, shot=0.03)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    for axis, truth in (("x", b.u), ("y", b.v)):
        result = judge(phase, truth, 3, axis)
        assert result.valid > 0.2
        assert 0.85 < result.sigma_ratio < 1.15


def test_a_saturated_white_frame_does_no_harm(bench, judge) -> None:
    """Blur keeps the fringes from reaching the brightness of white."""
    patterns = [*gray_and_phase("x", N, cell=4, periods=[4]), *REFERENCE]
    b = bench(blur=0.9, gain=270.0)
    images = b.take(patterns)
    assert (images[-2] == 255).mean() > 0.9
    result = judge(decode(patterns, images, lines=(N, N)), b.u, 2)
    assert result.gross == 0
    assert result.valid > 0.99


def test_the_rim_of_the_field_is_invalid_where_the_image_shows_it(bench) -> None:
    """Beyond the last line blurred light remains, whose phase is that of the last line."""
    patterns = reference_sequence(64, 64, axes=["x"])
    u = np.tile(np.linspace(-8, 72, 800), (20, 1))
    b = bench(count=64).__class__(u, None, (64, 64), blur=0.6)
    phase = decode(patterns, b.take(patterns), lines=(64, 64))
    good = np.isfinite(phase.u)
    assert np.abs(phase.u - u)[good].max() < 0.6
    assert good[(u > 1) & (u < 62)].mean() > 0.99
    assert not good[(u < -0.5) | (u > 63.5)].any()


def test_the_rim_of_the_field_is_invalid_where_the_image_ends_with_it(bench) -> None:
    """The darkness that would betray it is outside the image; the coordinates were off by 7 sigmas."""
    patterns = gray_and_phase("x", 64, cell=5, periods=[10])
    u = np.tile(np.linspace(-0.6, 63.6, 150), (20, 1))
    b = bench(count=64).__class__(u, None, (64, 64), blur=0.6)
    phase = decode(patterns, b.take(patterns), lines=(64, 64))
    good = np.isfinite(phase.u)
    assert np.abs((phase.u - u) / phase.sigma_u)[good].max() < 5
    assert good[(u > 2.5) & (u < 60.5)].mean() > 0.99


def test_a_code_that_contradicts_the_phase_is_flagged(bench) -> None:
    """One Gray frame of another scene: the words are no longer those of the phases' places."""
    patterns = [*gray_and_phase("x", N, cell=2, periods=[4]), *REFERENCE]
    b = bench()
    images = b.take(patterns)
    images[7] = np.roll(images[7], 3, axis=1)
    phase = decode(patterns, images, lines=(N, N))
    wrong = np.abs(phase.u - b.u) > 2
    assert (phase.flags & (Flag.DISAGREEMENT | Flag.UNSURE) > 0).mean() > 0.05
    assert wrong.mean() < 0.25  # a shifted bit makes a consistent word of other cells as often


def test_modulation_and_image_are_in_grey_values(bench) -> None:
    patterns = [*gray_and_phase("x", N, cell=32, periods=[64], inverse=True), *REFERENCE]
    b = bench(gain=100.0, ambient=20.0, blur=0.5)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    assert np.nanmedian(phase.modulation) == pytest.approx(50, abs=1)
    assert phase.image.std() < 2.0  # lit evenly: less than the noise of one frame remains
    assert phase.image.dtype == np.float32


def test_options_set_the_thresholds(bench) -> None:
    patterns = [*gray_and_phase("x", N, cell=8, periods=[16]), *REFERENCE]
    b = bench(blur=1.0)
    images = b.take(patterns)
    strict = decode(patterns, images, lines=(N, N), options=DecodeOptions(min_modulation=60.0))
    assert np.isnan(strict.u).all()
    assert (strict.flags & Flag.LOW_MODULATION > 0).all()
    capped = decode(patterns, images, lines=(N, N), options=DecodeOptions(saturation=50.0))
    assert (capped.flags & Flag.SATURATED > 0).mean() > 0.9


@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (5, 1), (2, 3)])
def test_images_of_a_few_pixels_are_decoded(shape: tuple[int, int]) -> None:
    patterns = list(reference_sequence())
    for seed in range(5):
        rng = np.random.default_rng(seed)
        place = {axis: rng.uniform(50, 60, shape) for axis in "xy"}
        images = []
        for pattern in patterns:
            along = place.get(getattr(pattern, "axis", ""), place["x"])
            light = np.interp(along, np.arange(N), brightness(pattern, np.arange(N)))
            images.append((20 + 180 * light + rng.normal(0, 1, shape)).astype(np.uint8))
        found = decode(patterns, images, lines=(N, N), where="a few pixels")
        assert np.nanmax(np.abs(found.u - place["x"])) < 1


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize(("preset", "options"), [("gray-sine", {"period": 16, "steps": 4}), ("multi-frequency", {})])
def test_a_time_stamp_burnt_into_the_frames_gives_few_coordinates(preset: str, options: dict, bits: int) -> None:
    patterns, full = SequenceSpec(preset, options).patterns((512, 384)), 2**bits - 1
    rows, columns = np.mgrid[:240, :320].astype(float)
    u, v = 30 + 1.2 * columns + 0.1 * rows, 20 + 1.1 * rows
    bench = Bench(u, v, (512, 384), ambient=full / 16, gain=full / 2, dark=(full / 200) ** 2, bits=bits)
    images = bench.take(patterns)
    for k, image in enumerate(images):
        ink = np.zeros(image.shape, np.uint8)
        text = f"10:{k // 60:02d}:{k * 7 % 60:02d}.{k * 137 % 1000:03d}"
        cv2.putText(ink, text, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, 255, 1, cv2.LINE_AA)
        image[:] = np.round(image + (full - image.astype(float)) * (ink / 255))
    found = decode(patterns, images, lines=(512, 384))
    wrong = np.abs(found.u - u) > 8
    # some 900 pixels are stamped; 110 to 210 were wrong while a sigma beyond the period passed, 31 and more while small
    # groups of pixels far from all others did
    assert np.count_nonzero(wrong) < 25
    assert np.isfinite(found.u[30:]).all()
