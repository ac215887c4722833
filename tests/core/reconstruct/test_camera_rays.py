"""Viewing directions of all pixels: their images are the pixels again, whatever the lens."""

from __future__ import annotations

import numpy as np
import pytest

from core.geometry import project
from core.model import DeviceSpec, Interior
from core.reconstruct.rays import _smooth, camera_rays

STRONG = Interior(12.1, 0.05, -0.03, (-6e-3, 1.6e-4, 1e-4, 1e-4, 2e-4, -1e-5), 2.5)


@pytest.mark.parametrize(
    ("size", "interior", "by_polynomials"),
    [
        ((748, 576), STRONG, True),
        ((331, 20), Interior(12.1, 0.05, -0.03, (0.1, -0.2, 0.01, 0.005, 0.1, -0.1, 0.02, 0, 1e-3), 0, "brown"), True),
        ((748, 576), Interior(12.0, a=(5e-2, -3e-3, 0, 0, 0, 0), r0_mm=2.5), False),  # folds within the image
        ((19, 1), STRONG, False),
    ],
)
def test_directions_image_where_their_pixels_are(size, interior, by_polynomials) -> None:
    spec = DeviceSpec(*size, (0.008, 0.008), 12.0)
    assert (_smooth(spec, interior) is not None) == by_polynomials
    rays = camera_rays(spec, interior)
    known = np.isfinite(rays).all(axis=-1)
    assert known.all() or not by_polynomials
    assert known.mean() > 0.3
    seen = project(spec, interior, np.concatenate([rays[known], np.full((known.sum(), 1), -1)], axis=-1))
    v, u = np.nonzero(known)
    assert np.abs(seen - np.stack([u, v], axis=-1)).max() < 1e-3  # float32, where the lens enlarges it
