"""Shares of a neighbour's light in frames, against mixtures of known share."""

from __future__ import annotations

import numpy as np
import pytest

from core.verify.overlapping import _held


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5])
def test_shares_of_another_light_are_found_and_dark_or_alike_frames_tell_none(share: float) -> None:
    rng = np.random.default_rng(3)
    own, other = rng.choice(np.float32([0.03, 0.97]), (2, 6, 200))
    seen = ((1 - share) * own + share * other + rng.normal(0, 0.01, own.shape)).astype(np.float32)
    seen[1] = 0  # a frame as dark as without light everywhere
    other[2], other[3], own[4] = own[2], np.float32(0.3), np.float32(0.97)  # alike, even, all of one light
    found = _held(seen, own, other)
    assert found.shape == (2,)
    # sigma 0.01 / (0.47 * sqrt(200)) = 0.0015
    assert np.abs(found - share).max() < 0.006
