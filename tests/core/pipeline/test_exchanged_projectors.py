"""Frames that stand under another projector's name: told by the lines that they fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError
from core.model import Capture, DeviceSpec, Frame, Project, Rig
from core.patterns import Black, Code, Pattern, White
from core.pipeline.decode import decode_images
from core.progress import SILENT

CAMERA = DeviceSpec(40, 30, (0.01, 0.01), 8.0)
RIG = Rig(
    {"camera": CAMERA}, {"pa": DeviceSpec(800, 600, (0.01, 0.01), 10.0), "pb": DeviceSpec(640, 720, (0.01, 0.01), 10.0)}
)
BITS = {"x": 7, "y": 6}  # in cells of 10 lines: of pa, whose 800 x 600 they tell apart


def refusal(projector: str, bits: dict[str, int]) -> str:
    """What is said of frames with so many bits that are told to be a projector's."""
    patterns: list[Pattern] = [White(), Black()]
    patterns += [Code("gray", axis, bit, n, 10, False) for axis, n in bits.items() for bit in range(n)]
    frames = tuple(Frame(f"{k}.png", p, projector=projector) for k, p in enumerate(patterns))
    capture = Capture(Path("plane"), "object", frames)
    images = [np.full((CAMERA.height, CAMERA.width), 100, np.uint8) for _ in frames]
    with pytest.raises(InputError) as caught:
        decode_images(capture, images, Project(Path("rig"), "rig", RIG, None, ()), SILENT)
    return str(caught.value)


def test_frames_of_another_projector_are_told_by_the_lines_that_they_fit() -> None:
    """The frames that were missing were asked for, which nobody had left out."""
    told = refusal("pb", BITS)
    assert "6 bits in cells of 10 tell 640 lines apart, by project.json the projector has 720" in told
    assert "the frames fit the 800 x 600 lines of pa" in told


def test_frames_that_fit_no_projector_are_asked_for() -> None:
    assert "the frames fit" not in refusal("pb", {"x": 7, "y": 5})
