"""A period that is wrong beside a code: phases turn at their own rate from edge to edge, whatever else bends them."""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.decode import decode
from core.patterns import Code, Pattern, Phase
from core.verify.beside import beside_code

LINES = 1280
Images = list[np.ndarray]


def shown(cell: int, period: float, steps: int) -> list[Pattern]:
    bits = (LINES // cell - 1).bit_length()
    code = [Code("gray", "x", bit, bits, cell) for bit in range(bits)]
    return [*code, *(Phase("x", period, steps, k, 2 * np.pi * k / steps) for k in range(steps))]


def light(pattern: Pattern, lines: np.ndarray) -> np.ndarray:
    if isinstance(pattern, Phase):
        return 0.5 + 0.5 * np.cos(2 * np.pi * (lines + 0.5) / pattern.period - pattern.shift_rad)
    assert isinstance(pattern, Code)
    k = np.floor((lines + 0.5) / pattern.cell).astype(int)
    return ((k ^ (k >> 1)) >> (pattern.bits - 1 - pattern.bit) & 1).astype(float)


def seen(patterns: list[Pattern], gloss: float, gamma: float = 1.0) -> Images:
    """A curved surface, and light of lines 25 farther on a part of it."""
    rng, (y, x) = np.random.default_rng(3), np.mgrid[:150, :560]
    lines = 250 + 1.4 * x + 9 * np.sin(y / 40) + 12 * np.sin(x / 70)
    part = gloss * (x > 180)
    images = []
    for p in patterns:
        each = light(p, lines) + part * light(p, lines + 25)
        images.append(cv2.GaussianBlur(np.float32(each / (1 + gloss)), (0, 0), 0.8) ** gamma)
    return [np.uint8(np.round(np.clip(12 + 170 * i + rng.normal(0, 1.2, i.shape), 0, 255))) for i in images]


def told(patterns: list[Pattern], images: Images) -> str:
    phase = decode(patterns, images, lines=(LINES, LINES))
    found = beside_code(patterns, images, [("x", phase.u, "columns")], (LINES, LINES))
    return "; ".join(f.text for f in found)


@pytest.mark.parametrize("gloss", [0.0, 0.12])
@pytest.mark.parametrize(("steps", "gamma"), [(4, 1.0), (3, 1.6)])
@pytest.mark.parametrize(
    ("cell", "true", "said"),
    [(20, 20.0, [20.06, 20.1, 20.2, 20.4, 21.0, 22.0]), (20, 40.0, [20.0, 39.8]), (20, 20.0, [40.0]), (16, 32.0, [34])],
)
def test_a_wrong_period_is_named_beside_light_by_a_second_way(
    cell: int, true: float, said: list[float], steps: int, gamma: float, gloss: float
) -> None:
    """From 1.8 lines over the field to any number: coordinates are wrong by parts of the period."""
    patterns = shown(cell, true, steps)
    images = seen(patterns, gloss, gamma)
    assert "with a period" not in told(patterns, images)
    for period in said:
        wrong = [replace(p, period=period) if isinstance(p, Phase) else p for p in patterns]
        found = told(wrong, images)
        fits = re.findall(r"with a period of ([0-9.]+) lines, not", found)
        assert len(fits) == 1, (period, found)
        assert abs(float(fits[0]) / true - 1) < (2e-3 if gloss else 1e-3)  # of a field of 780 lines


def test_phases_of_nothing_have_no_period() -> None:
    """Steps that show noise, beside a sound code."""
    patterns = shown(20, 20.0, 4)
    images = seen(patterns, 0.0)
    rng = np.random.default_rng(1)
    images[-4:] = [np.uint8(rng.integers(90, 100, images[0].shape)) for _ in range(4)]
    _, x = np.mgrid[:150, :560]
    u = (250 + 1.4 * x).astype(np.float32)
    assert beside_code(patterns, images, [("x", u, "columns")], (LINES, LINES)) == []
