"""All frames, one estimate: less noise than the steps allow, a true sigma, and dots' edges where they are.

Two renderers that share nothing with the virtual bench: that of `conftest.py`, and one of a camera whose pixels have a
footprint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.special import erf

from core.decode import DecodeOptions, Flag, decode
from core.errors import Cancelled
from core.model import PhaseMap
from core.patterns import (
    Black,
    Pattern,
    White,
    brightness,
    gray_and_phase,
    parse_sequence,
    reference_sequence,
)
from core.pipeline import decode_capture
from core.progress import Progress
from tests.core.decode.conftest import Bench

N = 640
REFINED = DecodeOptions(estimate=True)


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def both(patterns: list[Pattern], images: list[np.ndarray], lines: int) -> tuple[PhaseMap, PhaseMap]:
    plain = decode(patterns, images, lines=(lines, lines))
    return plain, decode(patterns, images, lines=(lines, lines), options=REFINED)


def least_noise(b: Bench, patterns: Sequence[Pattern]) -> np.ndarray:
    """R.m.s. errors of u and v that no unbiased estimate from these frames can go below (Cramér-Rao), lines.

    Offset and gain of the pixel are unknown, noise and blur known.
    """
    assert b.v is not None
    some, step = np.s_[::7, ::7], 0.01
    b = replace(b, u=b.u[some], v=b.v[some])

    def light(**moved: np.ndarray) -> np.ndarray:
        return np.stack([replace(b, **moved).light(pattern) for pattern in patterns], axis=-1)

    along_u = light(u=b.u + step) - light(u=b.u - step)
    along_v = light(v=b.v + step) - light(v=b.v - step)
    slopes = b.gain * np.stack([along_u, along_v], axis=-1) / (2 * step)
    design = np.concatenate([np.stack([np.ones_like(along_u), light()], axis=-1), slopes], axis=-1)
    covariance = np.linalg.inv(np.swapaxes(design, -1, -2) @ design) * (b.dark + 1 / 12)
    inside = (b.u > 12) & (b.u < N - 13) & (b.v > 12) & (b.v < N - 13)  # where the field's edge tells nothing
    return np.sqrt([covariance[inside, k, k].mean() for k in (2, 3)])


@pytest.mark.parametrize("blur", [0.45, 0.6, 0.9])
def test_the_estimate_uses_all_that_the_frames_tell(bench, blur: float) -> None:
    b = bench(height=100, both=True, blur=blur, gain=50.0, ambient=35.0)
    patterns = reference_sequence()
    plain, refined = both(patterns, b.take(patterns), N)
    for axis, truth, least in zip("uv", (b.u, b.v), least_noise(b, patterns), strict=True):
        before, after = getattr(plain, axis) - truth, getattr(refined, axis) - truth
        good = np.isfinite(before)
        assert (np.isfinite(after) == good).all()
        assert least < 0.91 * before[good].std()
        assert after[good].std() < 1.03 * least
        z = after[good] / getattr(refined, f"sigma_{axis}")[good]
        assert 0.95 < np.sqrt(np.mean(z**2)) < 1.05
        assert abs(2 * np.mean(after[good] * np.exp(2j * np.pi * truth[good]))) < 0.003  # a ripple of whole lines
    assert refined.misfit is not None
    assert np.nanmedian(refined.misfit) == pytest.approx(1, abs=0.1)
    assert plain.misfit is None


def dots(
    lines: int = 128,
    size: int = 160,
    fine: int = 4,
    footprint_px: float = 0.4,
    dark: float = 0.2,
    ambient: float = 10.0,
    noise: float = 1.5,
    sequence: str = "paper",
) -> tuple[list, list, np.ndarray]:
    """A slanted board of white dots, seen by pixels of a Gaussian footprint: patterns, images, true u."""
    y, x = (np.mgrid[: size * fine, : size * fine] - (fine - 1) / 2) / fine
    u, v = 4 + 0.71 * x + 0.06 * y, 4.3 + 0.73 * y - 0.04 * x
    albedo = np.where(np.hypot((x + 3) % 20 - 10, (y + 1) % 20 - 10) < 6, 0.85, dark)
    return pictures(u, v, albedo, lines, fine, footprint_px, ambient, noise, sequence)


def pictures(
    u: np.ndarray,
    v: np.ndarray,
    albedo: np.ndarray,
    lines: int,
    fine: int,
    footprint: float,
    ambient: float,
    noise: float,
    sequence: str = "paper",
) -> tuple[list, list, np.ndarray]:
    """Patterns, images and true u, v, albedo of a scene drawn with `fine` x `fine` samples a pixel."""
    patterns, rng = list(parse_sequence(sequence).patterns((lines, lines))), np.random.default_rng(4)
    images, at = [], slice(fine // 2, None, fine)
    for pattern in patterns:
        shown = brightness(pattern, np.arange(lines))
        edges = np.diff(np.concatenate([[0.0], shown, [0.0]]))
        place = np.arange(-8.0, lines + 8, 1 / 32)
        steps = (1 + erf((place[:, None] - (np.flatnonzero(edges) - 0.5)) / (0.6 * np.sqrt(2)))) / 2
        light = np.interp(v if getattr(pattern, "axis", "x") == "y" else u, place, steps @ edges[edges != 0])
        seen = gaussian_filter(albedo * (ambient + 150 * light), footprint * fine)[at, at]
        images.append(np.clip(np.rint(seen + rng.normal(0, noise, seen.shape)), 0, 255).astype(np.uint8))
    return patterns, images, np.stack([u[at, at], v[at, at], gaussian_filter(albedo, footprint * fine)[at, at]])


def test_edges_of_dots_are_not_drawn_to_the_brighter_side(monkeypatch) -> None:
    patterns, images, (u, v, albedo) = dots()
    found = both(patterns, images, 128)
    monkeypatch.setattr("core.decode.absolute.draw_back", lambda *_: None)
    drawn = both(patterns, images, 128)
    for axis, truth, along in (("u", u, 1), ("v", v, 0)):
        slope = np.gradient(albedo, axis=along) / albedo
        edge = np.abs(slope) > 0.2
        edge[:3] = edge[-3:] = edge[:, :3] = edge[:, -3:] = False
        for phase, before in zip(found, drawn, strict=True):
            after, was = ((getattr(each, axis) - truth)[edge] for each in (phase, before))
            assert np.isfinite(after).sum() == np.isfinite(was).sum()
            assert np.nanmean(was * np.sign(slope[edge])) > 0.04
            assert abs(np.nanmean(after * np.sign(slope[edge]))) < 0.02  # of a line, the bound that was asked for
            assert np.nanstd(after) < 0.75 * np.nanstd(was)
            assert np.sqrt(np.nanmean((after / getattr(phase, f"sigma_{axis}")[edge]) ** 2)) < 1.3


def test_words_are_not_drawn_to_the_brighter_side_either() -> None:
    patterns, images, (u, v, albedo) = dots(sequence="dense")
    phase = decode(patterns, images, lines=(128, 128))
    for axis, truth, along in (("u", u, 1), ("v", v, 0)):
        slope = np.gradient(albedo, axis=along) / albedo
        edge = np.abs(slope) > 0.2
        edge[:3] = edge[-3:] = edge[:, :3] = edge[:, -3:] = False
        error = (getattr(phase, axis) - truth)[edge]
        assert np.isfinite(error).mean() > 0.99
        assert abs(np.nanmean(error * np.sign(slope[edge]))) < 0.02
        assert np.sqrt(np.nanmean((error / getattr(phase, f"sigma_{axis}")[edge]) ** 2)) < 1.3


@pytest.mark.parametrize(("footprint", "softness"), [(0.0, 1.0), (0.45, 0.0)])
def test_texture_does_not_draw_coordinates(footprint: float, softness: float) -> None:
    """Fine texture on a steep surface; seen through no footprint at all, errors were 0.3 lines, else 2.3 sigmas."""
    size, fine = 72, 5
    y, x = (np.mgrid[: size * fine, : size * fine] - (fine - 1) / 2) / fine
    u, v = 4 + 3.4 * x + 0.06 * y, 4.3 + 3.3 * y - 0.04 * x
    texture = gaussian_filter(np.random.default_rng(2).uniform(0.3, 0.85, (size, size)), softness)
    albedo = np.kron(0.55 + (texture - 0.575) * (1 + 2 * softness), np.ones((fine, fine)))
    patterns, images, (u, v, _) = pictures(u, v, albedo, 256, fine, footprint, 10.0, 0.4, "gray-sine:steps=4")
    phase = decode(patterns, images, lines=(256, 256))
    for axis, truth in (("u", u), ("v", v)):
        error = (getattr(phase, axis) - truth)[3:-3, 3:-3]
        assert np.isfinite(error).mean() > 0.99
        assert np.nanstd(error) < (0.05 if footprint == 0 else 0.12)
        assert np.sqrt(np.nanmean((error / getattr(phase, f"sigma_{axis}")[3:-3, 3:-3]) ** 2)) < 1.3


def test_light_that_changes_where_surfaces_do_tells_no_footprint() -> None:
    """Faces of other materials, lines apart: a footprint of 0.00 ± 0.06 px² was found, and errors were 2.6 sigmas."""
    size, fine = 100, 4
    y, x = (np.mgrid[: size * fine, : size * fine] - (fine - 1) / 2) / fine
    face = gaussian_filter(np.random.default_rng(1).normal(size=x.shape), 8 * fine)
    face = np.digitize(face / face.std(), [-0.6, 0.2, 0.9])
    u, v, albedo = 20 + 0.6 * x + 0.05 * y + 6 * face, 20 + 0.55 * y - 2 * face, np.array([0.9, 0.35, 0.7, 0.25])[face]
    patterns, images, (u, _, _) = pictures(u, v, albedo, 128, fine, 0.6, 10.0, 1.5, "gray-sine")
    phase = decode(patterns, images, lines=(128, 128))
    assert np.sqrt(np.nanmean(((phase.u - u) / phase.sigma_u) ** 2)) < 1.5
    assert np.sqrt(np.nanmean((phase.u - u) ** 2)) < 0.75  # lines: most of it is the mixture at the jumps


def test_light_beyond_a_rim_is_no_measurement() -> None:
    """Pixels of a Gaussian footprint see a plate's rim from more than a pixel away."""
    patterns, images, (u, v, albedo) = dots(dark=0.0, footprint_px=0.7, ambient=0.0, noise=1.0)
    phase = decode(patterns, images, lines=(128, 128))
    inner = (np.abs(u - 64) < 60) & (np.abs(v - 64) < 60)
    seen = np.isfinite(phase.u) & np.isfinite(phase.v)
    own, beyond = inner & (albedo > 0.34), inner & (albedo < 0.17)  # of 0.85: 0.2 px and 0.6 px beyond the rim
    assert seen[own].all()
    beside = phase.flags[beyond] & Flag.BESIDE > 0
    assert beside.sum() > 500
    assert seen[beyond].sum() < 0.1 * beside.sum()
    for axis, truth in (("u", u), ("v", v)):
        error = getattr(phase, axis) - truth
        assert np.nanmax(np.abs(error[inner])) < 1.0
        assert np.sqrt(np.mean((error / getattr(phase, f"sigma_{axis}"))[seen & inner & ~own] ** 2)) < 1.5


def test_steps_of_surfaces_tell_no_footprint() -> None:
    """Plates before each other and the dark; found by their steps, it gave r.m.s. of 2.0 sigmas and lost a quarter."""
    size, fine = 120, 5
    y, x = (np.mgrid[: size * fine, : size * fine] - (fine - 1) / 2) / fine
    plate, row = (x + 8.5) // 34 % 2, (y - 3.5) // 8 % 2
    u, v = 4 + 0.83 * x + 0.05 * y + 9 * plate, 4.3 + 0.79 * y - 0.04 * x - 1.5 * row
    albedo = np.where((x // 17) % 2 == 1, 0.0, 0.8 - 0.3 * row)
    patterns, images, (u, v, albedo) = pictures(u, v, albedo, 160, fine, 0.5, 0.0, 1.0)
    phase = decode(patterns, images, lines=(160, 160))
    rim = (np.abs((x + 8.5) % 17 - 8.5) < 2) & (np.abs((y - 3.5) % 8 - 4) < 2)
    rim = (rim & (np.abs(y - 60) < 56))[fine // 2 :: fine, fine // 2 :: fine]
    for axis, truth in (("u", u), ("v", v)):
        error = ((getattr(phase, axis) - truth) / getattr(phase, f"sigma_{axis}"))[rim]
        assert np.isfinite(error).sum() > 850
        assert np.sqrt(np.nanmean(error**2)) < 1.25


def test_sigma_holds_a_footprint_that_little_tells() -> None:
    """A plate's rim too near to the image's border to tell it, in an unusually soft camera; r.m.s. was 2.2 sigmas."""
    size, fine = 120, 5
    y, x = (np.mgrid[: size * fine, : size * fine] - (fine - 1) / 2) / fine
    u, v = 4 + 0.83 * x + 0.05 * y, 4.3 + 0.79 * y - 0.04 * x
    patterns, images, (u, v, albedo) = pictures(u, v, np.where(y < 113.3, 0.8, 0.0), 160, fine, 0.8, 0.0, 0.5)
    phase = decode(patterns, images, lines=(160, 160))
    error = ((phase.v - v) / phase.sigma_v)[:, 8:-8][(albedo[:, 8:-8] > 0.02) & (albedo[:, 8:-8] < 0.7)]
    assert np.isfinite(error).sum() > 80
    assert np.sqrt(np.nanmean(error**2)) < 1.3


def test_a_pixel_that_moved_stands_out_by_its_misfit(bench) -> None:
    b = bench(height=60, both=True, gain=80.0)
    patterns = reference_sequence()
    images = b.take(patterns)
    for image in images[13:]:  # from the middle of the sequence on a part of the scene is darker
        image[20:40] = (0.7 * image[20:40]).astype(np.uint8)
    misfit = decode(patterns, images, lines=(N, N), options=REFINED).misfit
    assert misfit is not None
    assert np.nanmedian(misfit[20:40]) > 5 * np.nanmedian(misfit[:18])


def test_one_axis_alone_is_refined_too(bench) -> None:
    b = bench(height=64, gain=50.0, ambient=35.0, blur=0.9)
    patterns = reference_sequence(axes=["x"])
    plain, refined = both(patterns, b.take(patterns), N)
    assert np.nanstd(refined.u - b.u) < 0.83 * np.nanstd(plain.u - b.u)
    assert np.isnan(refined.v).all()


def test_a_project_may_ask_for_it(quick, edit_json) -> None:
    folder = quick / "captures" / "plane+00"
    plain = decode_capture(folder)
    edit_json(quick / "project.json", decode={"estimate": True})
    refined = decode_capture(folder)
    assert plain.misfit is None
    assert refined.misfit is not None
    assert np.nanmedian(refined.sigma_u) < 0.92 * np.nanmedian(plain.sigma_u)


@pytest.mark.parametrize("fault", ["flicker", "room", "scattered"])
@pytest.mark.parametrize("fringes", ["square", "sine"])
def test_light_that_contradicts_the_patterns_does_no_harm(bench, judge, fringes: str, fault: str) -> None:
    """A lamp that flickers, a room that grows bright, light that comes back from where the pattern is another."""
    patterns = (
        reference_sequence(axes=["x"]) if fringes == "square" else gray_and_phase("x", 640, cell=8, periods=[16.0])
    )
    b, (y, x) = bench(), np.mgrid[:200, :320]
    b = replace(b, u=30 + 1.7 * x + 0.3 * y, v=None, gain=110.0)
    seen = b.take(patterns)
    part = np.linspace(0, 1, len(patterns))
    scattered = replace(b, u=600 - b.u, blur=6.0)
    images = []
    for n, (image, pattern) in enumerate(zip(seen, patterns, strict=True)):
        light = image.astype(float)
        if fault == "flicker":
            light *= 1 + 0.05 * np.sin(2.1 * n + 0.3)
        elif fault == "room":
            light += 3 * b.ambient * part[n]
        else:
            light += 0.2 * b.gain * scattered.light(pattern)
        images.append(np.uint8(np.rint(light)))
    plain, refined = (
        judge(decode(patterns, images, lines=(640, 640), options=DecodeOptions(estimate=e)), b.u, 2)
        for e in (False, True)
    )

    assert refined.rms < 1.02 * plain.rms  # the sampling of 64,000 pixels' noise is 0.3 %
    assert 0.9 < refined.sigma_ratio / plain.sigma_ratio < 1.1


@pytest.mark.parametrize(("inverse", "blur", "gamma"), [(True, 1.2, 1.0), (False, 3.0, 1.0), (False, 3.0, 2.2)])
def test_a_code_alone_tells_parts_of_a_line(inverse: bool, blur: float, gamma: float) -> None:
    """Without all frames a coordinate is the middle or the edge of a cell, of several lines where fine bits fade."""
    patterns: list[Pattern] = [White(), Black()]
    for axis, count in (("x", 256), ("y", 200)):
        patterns += gray_and_phase(axis, count, cell=1, periods=[], inverse=inverse)
    y, x = np.mgrid[:100, :120]
    truth = 20 + 1.3 * x + 0.1 * y + 2 * np.sin(y / 9), 15 + 1.1 * y - 0.05 * x
    images = Bench(*truth, lines=(256, 200), blur=blur).take(patterns)
    images = [np.rint(255 * (image / 255) ** (1 / gamma)).astype(np.uint8) for image in images]  # of the camera
    plain, refined = (decode(patterns, images, lines=(256, 200), options=o) for o in (DecodeOptions(), REFINED))
    for axis, place in zip("uv", truth, strict=True):
        before, after = getattr(plain, axis) - place, getattr(refined, axis) - place
        known = np.isfinite(after)
        assert known.mean() >= max(np.isfinite(before).mean(), 0.99)
        assert rms(after[known]) < rms(before[np.isfinite(before)]) / 3
        assert 0.85 < rms((after / getattr(refined, f"sigma_{axis}"))[known]) < 1.15
    assert np.array_equal(refined.flags == 0, np.isfinite(refined.u) & np.isfinite(refined.v))


def test_a_code_whose_words_repeat_stays_as_it_is() -> None:
    """In cells of four lines the middle ones show the same, as long as blur is slight."""
    patterns = [*gray_and_phase("x", 256, cell=4, periods=[], inverse=True), White(), Black()]
    images = Bench(np.linspace(20, 200, 6000).reshape(60, 100), lines=(256, 1)).take(patterns)
    plain, refined = (decode(patterns, images, lines=(256, 1), options=o) for o in (DecodeOptions(), REFINED))
    assert np.array_equal(plain.u, refined.u, equal_nan=True)
    assert np.array_equal(plain.sigma_u, refined.sigma_u, equal_nan=True)


@pytest.mark.parametrize(
    ("blur", "gamma", "cell", "better"),
    [(0.1, 1.0, 1, 1.0), (1.0, 2.2, 1, 1.2), (1.0, 0.45, 1, 1.0), (1.0, 1.0, 2, 6.0)],
)
def test_sigmas_of_a_code_alone_hold_what_its_words_do_not(blur: float, gamma: float, cell: int, better: float) -> None:
    """Lines that a pixel sees one by one, and a camera's gamma: errors of 2 to 6 sigma; cells of two lines: 0.2."""
    patterns = [*gray_and_phase("x", 256, cell=cell, periods=[]), White(), Black()]
    y, x = np.mgrid[:240, :320]
    u = 20 + 0.6 * x + 0.05 * y + 2 * np.sin(x / 15)
    seen = Bench(u, lines=(256, 1), blur=blur, gain=200, bits=12).take(patterns)
    images = [np.rint(255 * (image / 255.0) ** gamma).astype(np.uint8) for image in seen]
    plain, refined = (decode(patterns, images, lines=(256, 1), options=o) for o in (DecodeOptions(), REFINED))
    error = refined.u - u
    assert rms(error) <= rms(plain.u - u) / better
    assert np.all(refined.sigma_u <= plain.sigma_u)
    assert 0.65 < rms(error / refined.sigma_u) < 1.2
    assert np.mean(np.abs(error) > 5 * refined.sigma_u) < 1e-3


def test_decoding_the_axis_beside_words_is_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    patterns = [*gray_and_phase("x", 16, cell=4, periods=[8]), *parse_sequence("dense:axes=y").patterns((16, 16))]
    monkeypatch.setattr("core.decode.absolute.measure", lambda *_: pytest.fail("went on"))
    with pytest.raises(Cancelled):
        decode(patterns, [np.zeros((4, 4), np.uint8)] * len(patterns), progress=Progress(cancelled=lambda: True))
