"""What a capture's light is told to be, in words."""

from __future__ import annotations

import numpy as np
import pytest

from core.model import Plan, Subject
from core.patterns import brightness, reference_sequence
from core.verify.quality import Sampled, modulation

PIXELS = 4000


@pytest.mark.parametrize(("lit", "level"), [(0.004, "bad"), (0.5, "good")])
def test_an_image_that_is_hardly_lit_is_named_with_its_share(lit: float, level: str) -> None:
    patterns = tuple(reference_sequence(160, 160))
    line = np.where(np.arange(PIXELS) < lit * PIXELS, np.arange(PIXELS) % 160, -1)
    shown = np.array([np.where(line < 0, 0.0, brightness(p, np.maximum(line, 0))) for p in patterns])
    grey = 10 + 150 * shown
    at = np.stack([np.zeros(PIXELS, np.intp), np.arange(PIXELS)])
    sampled = Sampled(grey, at, (1, PIXELS), grey.max(axis=0), grey.min(axis=0), 1.0, 255, np.sort(grey, axis=0))
    found = modulation(Plan(Subject("object", "a"), patterns, ()), sampled)
    assert found.level == level
    assert ("only 0.4% of the image is lit by the projector: look whether its lamp is on" in found.text) == (lit < 0.01)
    assert ("50% of the image is lit; stripes across columns: modulation 75 grey" in found.text) == (lit > 0.01)
