"""Gray code without phases: at the edge between two cells the bits decide, and neither side is preferred."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from core.decode import decode
from core.patterns import brightness, gray_and_phase


@pytest.mark.parametrize(("blur_lines", "contrast", "cell"), [(0.5, 15, 1), (0.8, 25, 1), (1.2, 15, 2)])
def test_pixels_at_blurred_edges_fall_to_both_sides_alike(blur_lines: float, contrast: float, cell: int) -> None:
    lines, fine, rng = 128, 20, np.random.default_rng(4)
    patterns = gray_and_phase("x", lines, cell=cell, periods=[], inverse=True)
    u = np.linspace(4, lines - 5, 500)[None, :] + rng.uniform(-0.5, 0.5, (200, 1))
    places = (np.arange(lines * fine) - (fine - 1) / 2) / fine
    images = []
    for pattern in patterns:
        light = gaussian_filter1d(np.repeat(brightness(pattern, np.arange(lines)), fine), blur_lines * fine)
        grey = 20 + contrast * np.interp(u, places, light) + rng.normal(0, 2, u.shape)
        images.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    phase = decode(patterns, images, lines=(lines, 1))
    error = (phase.u - u)[np.isfinite(phase.u)]
    assert len(error) > 0.9 * u.size
    # an error within a cell has a standard deviation of 0.3 cells; five of those of the mean
    assert abs(np.mean(error)) < 5 * 0.3 * cell / np.sqrt(len(error))
