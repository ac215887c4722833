"""Frames that show the pattern before, all over or in the rows that were read before it changed."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import decode
from core.patterns import Black, White, brightness, gray_and_phase

PATTERNS = [*gray_and_phase("x", 256, cell=8, periods=[16.0]), White(), Black()]


def seen(late: int | None = None, rows: slice = slice(None)) -> list[np.ndarray]:
    """A tilted wall with texture: fringes as they are between lines, noise of 1.5 grey values."""
    rng, (y, x) = np.random.default_rng(4), np.mgrid[:160, :240]
    u = 30 + 0.8 * x + 0.06 * y
    albedo = 0.8 + 0.2 * np.sin(x / 19 + y / 13)
    light = [(1 - u % 1) * brightness(p, np.floor(u)) + u % 1 * brightness(p, np.floor(u) + 1) for p in PATTERNS]
    if late is not None:
        light[late] = light[late].copy()
        light[late][rows] = light[late - 1][rows]
    return [np.uint8(np.rint(albedo * (15 + 120 * each) + rng.normal(0, 1.5, u.shape))) for each in light]


@pytest.mark.parametrize("late", [2, 5, 8])
@pytest.mark.parametrize("rows", [slice(0, 50), slice(110, 160)], ids=["top", "bottom"])
def test_a_frame_read_while_the_pattern_changed_is_named_with_its_rows(late: int, rows: slice) -> None:
    notes = decode(PATTERNS, seen(late, rows), lines=(256, 160)).notes
    (note,) = [text for text in notes if "shows the pattern" in text]
    assert note.startswith(f"Frame {late} shows the pattern of frame {late - 1} in rows ")
    first, last = (int(word.strip(":")) for word in note.split(" in rows ")[1].split(" ")[:3:2])
    assert abs(first - rows.start) < 12  # the sample looks at every fourth row or so
    assert abs(last - rows.stop + 1) < 12


def test_a_whole_frame_that_came_late_is_named() -> None:
    notes = decode(PATTERNS, seen(6), lines=(256, 160)).notes
    assert any(text.startswith("Frame 6 shows the pattern of frame 5: ") for text in notes)


def test_no_frame_of_a_good_capture_is_late() -> None:
    assert decode(PATTERNS, seen(), lines=(256, 160)).notes == ()


def test_stripes_too_fine_to_be_seen_are_not_late() -> None:
    """Gray code of cell 1 on pixels of four lines: the finest bit and its inverse are one grey, darker by gamma."""
    patterns = [*gray_and_phase("x", 512, cell=1, periods=[], inverse=True), White(), Black()]
    rng, (y, x) = np.random.default_rng(4), np.mgrid[:120, :110]
    u = 20 + 4.1 * x + 0.06 * y
    lines = u[..., None] + np.linspace(-2, 2, 33)
    light = [brightness(p, np.rint(lines)).mean(axis=-1) ** 2.2 for p in patterns]
    images = [np.uint8(np.rint(15 + 120 * each + rng.normal(0, 2.0, u.shape))) for each in light]
    assert decode(patterns, images, lines=(512, 160)).notes == ()
