"""What is wrong alike in every pixel of a capture, so that no frame contradicts another one."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import chain, product

import cv2
import numpy as np
import pytest

from core.patterns import Axis, Black, Pattern, Phase, White, gray_and_phase
from core.verify.beside import beside_code
from tests.core.verify.test_stored_frames import MIDDLE, Frames, render, told

AXES: tuple[Axis, ...] = ("x", "y")


def shown(cell: int, period: float, steps: int, profile: str = "sine") -> list[Pattern]:
    first = 0.0 if profile == "sine" else np.pi / 2
    each = (
        gray_and_phase(a, 160, cell=cell, periods=[period], steps=steps, profile=profile, first_shift_rad=first)
        for a in AXES
    )
    return [*chain(*each), White(), Black()]


def without_code(*periods: float) -> list[Pattern]:
    each = product(AXES, periods, range(4))
    return [Phase(axis, period, 4, k, k * np.pi / 2, "sine") for axis, period, k in each]


@pytest.mark.parametrize(
    ("cell", "period", "steps", "profile", "gamma"),
    [
        (4, 8.0, 4, "sine", 2.2),
        (8, 16.0, 3, "sine", 1.0),
        (5, 10.0, 5, "sine", 0.6),
        (2, 4.0, 4, "square", 2.2),
    ],
)
def test_phase_steps_half_a_line_off_are_named(
    cell: int, period: float, steps: int, profile: str, gamma: float
) -> None:
    """Every coordinate is off by half a line; the truth is what the renderer showed."""
    patterns = shown(cell, period, steps, profile)
    images = render(patterns, 5, gamma=gamma, roll=0.3, shape=MIDDLE)
    assert not told(patterns, images)
    for lines in (-0.5, 0.5):
        turn = 2 * np.pi * lines / period
        said = [replace(p, shift_rad=p.shift_rad + turn) if isinstance(p, Phase) else p for p in patterns]
        found = re.findall(r"begin ([0-9.]+)° (later|earlier)", told(said, images))
        assert found, (lines, told(said, images))
        degrees, when = found[0]
        assert when == ("earlier" if lines > 0 else "later")
        assert abs(float(degrees) / 360 * period - 0.5) < 0.05


@pytest.mark.parametrize(
    ("patterns", "period", "factor", "gamma"),
    [
        (shown(4, 8.0, 4), 8.0, 0.99, 1.0),
        (shown(4, 8.0, 4), 8.0, 0.997, 2.0),
        (shown(5, 10.0, 5), 10.0, 1.003, 1.0),
        (shown(2, 4.0, 4, "square"), 4.0, 0.997, 1.0),
        (without_code(160.0, 32.0, 6.4), 6.4, 1.003, 2.0),
        (without_code(16.0, 160 / 9), 16.0, 0.997, 1.0),
        (without_code(160.0, 10.0), 10.0, 0.99, 1.0),  # the longer one has a single cycle
        (without_code(160.0, 10.0), 10.0, 1.01, 1.5),
    ],
)
def test_a_finest_period_that_is_off_is_told_by_code_or_other_periods(
    patterns: list[Pattern], period: float, factor: float, gamma: float
) -> None:
    """At the last of 160 lines by half a line, or by 1.6: every pixel by itself is as it may be."""
    images = render(patterns, 4, gamma=gamma, shape=MIDDLE)
    assert not told(patterns, images)
    off = [replace(p, period=period * factor) if p.period == period else p for p in patterns if isinstance(p, Phase)]
    found = told([*(p for p in patterns if not isinstance(p, Phase)), *off], reordered(patterns, images))
    assert "period" in found, found
    fits = [float(seen) for seen in re.findall(r"with a period of ([0-9.]+) lines", found)]
    assert np.allclose(fits, period, rtol=6e-4), fits  # of 0.1 line, where codes are told, over the field


@pytest.mark.parametrize(("periods", "wrong", "factor"), [((13.0, 14.0), 0, 1.01), ((16.0, 160 / 9), 1, 1.01)])
def test_a_period_that_leaves_few_pixels_a_line_is_told(periods: tuple, wrong: int, factor: float) -> None:
    """At the last of 160 lines the phases tell places 1.6 lines apart: hardly a pixel is decoded."""
    patterns = without_code(*periods)
    images = render(patterns, 4)
    assert not told(patterns, images)
    found = told([replace(p, period=p.period * factor) if p.period == periods[wrong] else p for p in patterns], images)
    fits = re.findall(r"with a period of ([0-9.]+) lines, not [0-9.]+, or of ([0-9.]+), not", found)
    assert len(fits) == 2, found  # columns and rows
    assert np.allclose([float(each[wrong]) for each in fits], periods[wrong], rtol=6e-4), found


@pytest.mark.parametrize(("periods", "count"), [((25.0, 26.0), 640), ((18.0, 160.0), 640), ((40.0, 640.0), 640)])
@pytest.mark.parametrize(("steps", "gamma", "noise"), [(4, 1.0, 6.0), (3, 2.4, 1.0)])
def test_noise_and_a_response_that_hide_the_line_accuse_no_period(periods, count, steps, gamma, noise) -> None:
    """A part of the field is seen, whose phases tell places one or two lines apart: other periods would fit that."""
    rng, (v, u) = np.random.default_rng(1), np.mgrid[:120, :160]
    lines = count * (0.3 + u / 800) + 3 * np.sin(v / 30)
    patterns = [Phase("x", p, steps, k, 2 * np.pi * k / steps) for p in periods for k in range(steps)]
    waves = [0.5 + 0.5 * np.cos(2 * np.pi * (lines + 0.5) / p.period - p.shift_rad) for p in patterns]
    images = [np.clip(np.round(10 + 150 * w**gamma + rng.normal(0, noise, u.shape)), 0, 255) for w in waves]
    assert beside_code(patterns, images, [("x", lines, "columns")], (count, count)) == []


@pytest.mark.parametrize("way", [-0.3, -0.1, 0.2])
@pytest.mark.parametrize("from_px", [80, -60])
def test_light_by_a_second_way_accuses_no_period(way: float, from_px: float) -> None:
    """It moves the phases of the longest period by up to 14 of 640 lines, nearly in proportion to the line."""
    v, u = np.mgrid[:120, :160]
    lines = 640 * (0.05 + u / 180) + 3 * np.sin(v / 30)
    patterns = [p for p in without_code(40.0, 640.0) if p.axis == "x"]
    waves = [0.5 + 0.5 * np.cos(2 * np.pi * (lines + 0.5) / p.period - p.shift_rad) for p in patterns]
    other = [0.5 + 0.5 * np.cos(2 * np.pi * (lines * (1 + way) + from_px) / p.period - p.shift_rad) for p in patterns]
    broad = [cv2.GaussianBlur(w, (0, 0), 12) for w in other]  # a diffuse surface spreads it
    images = [np.round(10 + 150 * w + 22 * o) for w, o in zip(waves, broad, strict=True)]
    assert beside_code(patterns, images, [("x", lines, "columns")], (640, 640)) == []


def reordered(patterns: list[Pattern], images: Frames) -> Frames:
    """Images of phase steps behind all others."""
    order = sorted(range(len(patterns)), key=lambda k: isinstance(patterns[k], Phase))
    return [images[k] for k in order]


@pytest.mark.parametrize("factor", [2, 3])
def test_frames_that_were_enlarged_are_named(factor: int) -> None:
    patterns = shown(4, 8.0, 4)
    images = render(patterns, 6)
    small = [i[::factor, ::factor] for i in images]
    enlarged = [cv2.resize(i, images[0].shape[::-1], interpolation=cv2.INTER_NEAREST) for i in small]
    size = "{1} x {0} px were enlarged".format(*small[0].shape)
    assert size in told(patterns, enlarged, decoded=False)
    assert "enlarged" not in told(patterns, images, decoded=False)


@pytest.mark.parametrize("line_px", [1, 2, 3])
def test_light_without_noise_is_not_called_enlarged(line_px: int) -> None:
    """A plane seen straight on: without noise the frames of columns have equal rows, those of rows equal columns.

    Where the projector's lines are wider than pixels, columns and rows repeat, too; the light ends within the image.
    """
    patterns = shown(4, 8.0, 4)
    images = []
    for p in patterns:
        level = np.full(180, 200 if p == White() else 10)
        if getattr(p, "axis", ""):
            level = np.arange(180) // line_px % 8 * 20 + 40
        wide = np.tile(level[:, None], (1, 180))
        image = np.full((180, 180), 8, np.uint8)
        image[20:150, 30:160] = (wide.T if getattr(p, "axis", "") == "x" else wide)[20:150, 30:160]
        images.append(image)
    assert "enlarged" not in told(patterns, images, decoded=False)
