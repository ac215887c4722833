"""What is the same in every frame: lines of a sensor that are dead, and what was drawn into the frames."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from core.patterns import reference_sequence
from tests.core.verify.test_stored_frames import LINES, Frames, render, told

PATTERNS = reference_sequence(*LINES)


@pytest.fixture(scope="module")
def images() -> Frames:
    return render(PATTERNS, 5)


def test_dead_lines_of_the_sensor_are_named(images: Frames) -> None:
    dead = [image.copy() for image in images]
    for image in dead:
        image[90], image[91], image[:, 120] = 0, 17, 255
    found = told(PATTERNS, dead)
    assert "in rows 90, 91 of the image in every frame, and not beside: dead lines of the sensor" in found
    assert "in column 120 of the image in every frame" in found


def test_frames_with_a_black_border_have_no_dead_lines(images: Frames) -> None:
    bordered = [image.copy() for image in images]
    for image in bordered:
        image[:2], image[:, -9:] = 0, 0
    assert "dead" not in told(PATTERNS, bordered)


@pytest.mark.parametrize("grey", [160, 255])
def test_text_that_is_drawn_into_every_frame_is_named(images: Frames, grey: int) -> None:
    letters = np.zeros(images[0].shape, np.uint8)
    cv2.putText(letters, "10:25", (100, 90), cv2.FONT_HERSHEY_SIMPLEX, 0.6, 255, 1)
    assert "text or a logo is drawn into the frames" in told(
        PATTERNS, [np.where(letters > 128, np.uint8(grey), image) for image in images]
    )


def test_hot_pixels_are_no_text(images: Frames) -> None:
    hot = np.random.default_rng(2).random(images[0].shape) < 0.004
    assert "drawn" not in told(PATTERNS, [np.where(hot, np.uint8(255), image) for image in images])


def test_gloss_that_saturates_without_a_black_frame_is_no_text(images: Frames) -> None:
    """Light between the stripes may be enough where the surface shines."""
    v, u = np.mgrid[: images[0].shape[0], : images[0].shape[1]]
    shining = (v - 90) ** 2 + (u - 120) ** 2 < 36
    frames = [np.where(shining, np.uint8(255), image) for image in images[:-2]]
    assert "drawn" not in told(PATTERNS[:-2], frames)
    assert "drawn" in told(PATTERNS, [*frames, *(np.where(shining, np.uint8(255), image) for image in images[-2:])])
