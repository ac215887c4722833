"""Frames that went through OpenCV's JPEG: said, and what it did to phases is in their sigmas."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from core.decode import decode
from core.patterns import parse_sequence
from tests.core.decode.conftest import Bench


@pytest.mark.parametrize(("name", "most"), [("paper", 1.2), ("two-period", 1.3)])  # 1.75 and 2.27 without
def test_frames_compressed_with_losses_are_told_and_sigma_holds_it(
    name: str, most: float, bench: Callable[..., Bench]
) -> None:
    patterns = parse_sequence(f"{name}:axes=x").patterns((400, 8))
    draw = np.random.default_rng(1)
    albedo = 1 + 0.25 * cv2.GaussianBlur(draw.normal(size=(200, 480)), (0, 0), 8.0) * 28
    b = bench(height=200, width=480, count=400, gain=100 * np.clip(albedo, 0.3, 1.6), dark=1.0, shot=0.01)
    images = [cv2.imdecode(cv2.imencode(".jpg", i, (cv2.IMWRITE_JPEG_QUALITY, 75))[1], 0) for i in b.take(patterns)]
    phase = decode(patterns, images, lines=(400, 8))
    score = (phase.u - b.u) / phase.sigma_u
    assert np.isfinite(score).mean() > 0.97
    assert 0.8 < np.sqrt(np.nanmean(score**2)) < most
    (note,) = phase.notes
    assert "JPEG" in note
    assert not decode(patterns, b.take(patterns), lines=(400, 8)).notes
