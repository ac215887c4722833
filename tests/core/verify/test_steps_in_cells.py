"""The kernel that compares a coordinate's steps with its way over some cells, against plain numpy."""

import numpy as np
import pytest

from core.verify.exchanged import _steps


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_steps_against_the_way_of_their_surroundings_are_counted(kind):
    rng = np.random.default_rng(4)
    image = (0.9 * np.arange(200) + rng.normal(0, 1.0, (30, 200))).astype(kind)
    image[rng.random(image.shape) < 0.05] = np.nan
    those, reach, (least, most, sure) = np.floor((image + 0.5) / 2), 6, (3.0, 8.0, 0.15)
    step, rise = np.diff(image)[:, : 200 - reach], image[:, reach:] - image[:, :-reach]
    inside = those[:, :-reach] == those[:, 1 : 1 - reach]
    use = inside & (np.abs(rise) > least) & (np.abs(rise) < most) & (np.abs(step) > sure)
    against = use & (step * rise < 0)
    assert np.count_nonzero(against) > 100
    assert _steps(image, those, reach, least, most, sure) == (np.count_nonzero(against), np.count_nonzero(use))
