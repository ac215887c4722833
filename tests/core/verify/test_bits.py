"""Bits of a code that are described, or shown, the other way round: the coordinates fit, and are elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from core.patterns import Axis, Black, Code, Pattern, Phase, White
from core.verify.bits import wrong_bits
from tests.core.verify.test_stored_frames import render, told


def code(axis: Axis, bits: int, cell: int, both: bool) -> list[Pattern]:
    inverses = (False, True) if both else (False,)
    return [Code("gray", axis, bit, bits, cell, inverse) for bit in range(bits) for inverse in inverses]


def turned(patterns: Sequence[Pattern], *bits: int) -> list[Pattern]:
    """Columns' bits described the other way round."""
    return [
        replace(p, inverse=not p.inverse) if isinstance(p, Code) and p.axis == "x" and p.bit in bits else p
        for p in patterns
    ]


@pytest.mark.parametrize("both", [True, False])
@pytest.mark.parametrize("stepped", [True, False])
def test_a_bit_that_is_inverted_is_named(both: bool, stepped: bool) -> None:
    """Beside an object stand walls of other depths, whose edges join any two words."""
    steps = [Phase("x", 5.0, 4, k, k * np.pi / 2) for k in range(4)] if stepped else []
    patterns: list[Pattern] = [*code("x", 5, 5, both), *steps, *code("y", 5, 5, both), White(), Black()]
    images = render(patterns, 7, roll=0.2, walls=2)
    assert told(patterns, images, "object") == ""
    for bit in range(1, 5):
        frames = f"frames {2 * bit}, {2 * bit + 1}" if both else f"frame {bit}"
        said = f"frames across columns: they fit if bit {bit} of the code is inverted, {frames}"
        found = told(turned(patterns, bit), images, "object")
        if bit < 4 or stepped:  # neighbouring cells of a code alone, exchanged in pairs, are a line's error
            assert found == said
        assert [f.text for f in wrong_bits(turned(patterns, bit), images)] == [said]
    found = told(turned(patterns, 1, 3), images, "object")
    assert "bits 1, 3 of the code are inverted, frames" in found
    assert "the code is inverted" in told(turned(patterns, *range(5)), images, "object")


@pytest.mark.parametrize("blur_px", [0.8, 6.0])
def test_blurred_stripes_invert_no_bit(blur_px: float) -> None:
    """The finest bits are grey, and brighter than the middle of the light; coarser ones that are inverted are told."""
    rng, x = np.random.default_rng(2), np.arange(600)
    lines = (x * 0.4 + 3 * np.sin(np.arange(60) / 9)[:, None]).astype(int)
    patterns = code("x", 8, 1, both=False)
    bits = [((lines ^ (lines >> 1)) >> (7 - k) & 1).astype(float) for k in range(8)]
    kernel = np.exp(-((np.arange(-30, 31) / blur_px) ** 2) / 2)
    seen = [np.apply_along_axis(np.convolve, 1, b, kernel / kernel.sum(), "same") for b in bits]
    images = [np.uint8(np.clip(20 + 150 * s**0.6 + rng.normal(0, 1.5, s.shape), 0, 255)) for s in seen]
    assert wrong_bits(patterns, images) == []
    for bit in range(1, 5):
        assert f"bit {bit} of" in wrong_bits(turned(patterns, bit), images)[0].text


@pytest.mark.parametrize("wrong", ["exchanged", "mirrored", "another", "binary", "reversed"])
def test_other_mistakes_are_no_wrong_bits(wrong: str) -> None:
    patterns = [*code("x", 5, 5, True), White(), Black()]
    images = render(patterns, 7, roll=0.2)
    if wrong == "exchanged":
        images[2:4], images[6:8] = images[6:8], images[2:4]
    elif wrong == "binary":
        patterns = [replace(p, kind="binary") if isinstance(p, Code) else p for p in patterns]
    else:
        patterns = [replace(p, bit=4 - p.bit) if isinstance(p, Code) else p for p in patterns]
    assert wrong_bits(patterns, images) == []
