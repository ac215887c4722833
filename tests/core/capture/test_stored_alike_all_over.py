"""What is wrong alike in every pixel of a capture, so that no frame contradicts another one."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.capture.stored import check_stored
from core.model import Capture, Frame
from core.patterns import Axis, Black, Pattern, Phase, White, gray_and_phase
from tests.core.capture.test_stored_frames import LINES, Frames, render

AXES: tuple[Axis, ...] = ("x", "y")


def told(patterns: list[Pattern], images: Frames) -> str:
    frames = tuple(Frame(Path(f"{k:03d}.png"), p) for k, p in enumerate(patterns))
    return "; ".join(f.text for f in check_stored(Capture(Path("a"), "testfield", frames), images, None, LINES))


def shown(cell: int, period: float, steps: int) -> list[Pattern]:
    each = (gray_and_phase(a, 160, cell=cell, periods=[period], steps=steps, profile="sine") for a in AXES)
    return [*chain(*each), White(), Black()]


@pytest.mark.parametrize(
    ("cell", "period", "steps"),
    [(4, 8.0, 4), (8, 16.0, 3), (5, 10.0, 5)],
)
@pytest.mark.parametrize("gamma", [0.6, 1.0, 2.2])
def test_phase_steps_half_a_line_off_are_named(cell: int, period: float, steps: int, gamma: float) -> None:
    """Every coordinate is off by half a line; the truth is what the renderer showed."""
    patterns = shown(cell, period, steps)
    images = render(patterns, 5, gamma=gamma, roll=0.3)
    assert "stands" not in told(patterns, images)
    for lines in (-0.5, 0.5):
        turn = 2 * np.pi * lines / period
        said = [replace(p, shift_rad=p.shift_rad + turn) if isinstance(p, Phase) else p for p in patterns]
        found = re.findall(
            r"stands ([0-9.]+) lines (before|behind) .*? begin ([0-9.]+)° (later|earlier)", told(said, images)
        )
        assert found, (lines, told(said, images))
        beside, way, degrees, when = found[0]
        assert (way, when) == (("behind", "earlier") if lines > 0 else ("before", "later"))
        assert abs(float(beside) - 0.5) < 0.1  # steps of 0.05 lines are tried
        assert abs(float(degrees) / 360 * period - float(beside)) < 0.02 * float(beside) + 0.01


@pytest.mark.parametrize("factor", [2, 3])
def test_frames_that_were_enlarged_are_named(factor: int) -> None:
    patterns = shown(4, 8.0, 4)
    images = render(patterns, 6)
    small = [i[::factor, ::factor] for i in images]
    enlarged = [cv2.resize(i, images[0].shape[::-1], interpolation=cv2.INTER_NEAREST) for i in small]
    size = "{1} x {0} px were enlarged".format(*small[0].shape)
    assert size in told(patterns, enlarged)
    assert "enlarged" not in told(patterns, images)


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
    assert "enlarged" not in told(patterns, images)
