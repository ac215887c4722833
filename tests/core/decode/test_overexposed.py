"""The evenly lit image where frames are at full scale, against the same frames of a sensor with more range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.decode import decode
from core.patterns import Black, White, gray_and_phase

LINES = (640, 480)


@pytest.mark.parametrize("steps", [(4, 3), (8, 8)])
@pytest.mark.parametrize(("white", "inverse"), [(True, False), (False, False), (False, True)])
def test_even_image_of_overexposed_pixels_is_that_of_a_sensor_with_more_range(bench, steps, white, inverse) -> None:
    """Cut off, it was up to 9 grey values too dark, by the phase; frames' noise of a grey value leaves 1 to 2."""
    y, x = np.mgrid[:120, :160]
    gain = 120.0 + x  # what 255 cuts off grows from nothing to a sixth
    place = {"u": 40.2 + 1.1 * x + 0.1 * y, "v": 60.4 + 1.2 * y - 0.1 * x, "lines": LINES}
    b = replace(bench(blur=0.6, bits=12, dark=1.0, gain=gain), **place)
    patterns = [
        *gray_and_phase("x", LINES[0], cell=8, periods=[16], steps=steps[0], inverse=inverse),
        *gray_and_phase("y", LINES[1], cell=8, periods=[16], steps=steps[1], inverse=inverse),
        *([White(), Black()] if white else []),
    ]
    whole = b.take(patterns)
    true = decode(patterns, whole, lines=LINES).image
    found = decode(patterns, [np.minimum(each, 255).astype(np.uint8) for each in whole], lines=LINES).image
    cut = np.max(whole, axis=0) >= 255
    assert 0.2 < cut.mean() < 0.8
    np.testing.assert_allclose(found[~cut], true[~cut], atol=0.01)
    assert abs(np.mean((found - true)[cut])) < 0.3
    assert np.sqrt(np.mean((found - true)[cut] ** 2)) < 2
