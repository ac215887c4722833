"""The light's gradient across a testfield, from the contrasts of its dots, against the falling-off it was made with."""

import numpy as np

from core.measure.centroid import light_gradient


def test_gradient_follows_a_vignette_up_to_the_corners_of_a_coarse_testfield() -> None:
    row, col = np.mgrid[:6, :9]
    uv = np.stack([(col.ravel() - 4) * 31.0, (row.ravel() - 2.5) * 29.5], axis=-1)
    fall = 0.3 / 200.0**2  # 30 % in the corner of 320 x 240 pixels
    contrast = 1 - fall * np.sum(uv**2, axis=1)
    truth = -2 * fall * uv / contrast[:, None]
    off = (light_gradient(uv, contrast, None) - truth) * 14.0**2 / 16  # g r² / 4 for dots of 14 px diameter
    assert np.abs(off).max() < 0.006  # px
