"""Frames that OpenCV's filters went over, and frames whose residuals are no noise that was filtered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from core.decode import decode
from core.decode.filtered import SHARPENED, SMOOTHED
from core.patterns import parse_sequence
from tests.core.decode.conftest import Bench

LINES = (300, 240)


def interpolated(image: np.ndarray) -> np.ndarray:
    return cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BayerBG2BGR), cv2.COLOR_BGR2GRAY)


def sharpened(image: np.ndarray) -> np.ndarray:
    return cv2.addWeighted(image, 2.0, cv2.GaussianBlur(image, (0, 0), 1.5), -1.0, 0)


def dots(shape: tuple[int, int]) -> np.ndarray:
    y, x = np.mgrid[: shape[0], : shape[1]]
    return 0.15 + 0.85 * (np.hypot(y % 30 - 15, x % 30 - 15) < 9)


FRAMES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], dict[str, Any], str]] = {
    "Gaussian of 1 px": (lambda i: cv2.GaussianBlur(i, (0, 0), 1.0), {}, SMOOTHED),
    "Gaussian of 1.5 px, twelve bits": (
        lambda i: cv2.GaussianBlur(i, (0, 0), 1.5),
        {"bits": 12, "gain": 900.0},
        SMOOTHED,
    ),
    "median of 5 px": (lambda i: cv2.medianBlur(i, 5), {}, SMOOTHED),
    "enlarged threefold": (lambda i: cv2.resize(i[:67, :87], i.shape[::-1]), {}, SMOOTHED),
    "unsharp mask": (sharpened, {"ambient": 40.0}, SHARPENED),
    "as they are": (lambda i: i, {}, ""),
    "a colour camera's": (interpolated, {}, ""),
    "rounded, hardly any noise": (lambda i: i, {"dark": 0.01}, ""),
    "harmonics of a gamma on dots": (
        lambda i: np.uint8(20 + 190 * (i / 255.0) ** 1.7),
        {"ambient": 30.0, "gain": 200 * dots((200, 260)), "dark": 0.5},
        "",
    ),
}


@pytest.mark.parametrize("name", FRAMES)
def test_frames_that_were_filtered_are_told_and_no_others(name: str, bench: Callable[..., Bench]) -> None:
    change, more, told = FRAMES[name]
    y, x = np.mgrid[:200, :260]
    place = {"u": 10.2 + 1.05 * x + 0.05 * y, "v": 8.4 + 1.1 * y - 0.06 * x, "lines": LINES}
    patterns = parse_sequence("gray-sine:period=16,steps=4").patterns(LINES)
    b = Bench(**place, **{"blur": 0.6, "dark": 3.0, **more})
    images = [np.ascontiguousarray(change(i)) for i in b.take(patterns)]
    found = [note for note in decode(patterns, images, lines=LINES).notes if note in (SMOOTHED, SHARPENED)]
    assert found == [told] * bool(told)


def test_a_camera_that_shakes_before_a_print_smooths_nothing() -> None:
    """By 0.15 px from frame to frame: what edges then leave is stronger in coarse ripples than noise."""
    y, x = np.mgrid[:200, :260].astype(np.float32)
    rng = np.random.default_rng(4)
    spots = np.float32(cv2.GaussianBlur(rng.normal(size=x.shape), (0, 0), 2) > 0)
    spots = cv2.GaussianBlur(0.2 + 0.7 * spots, (0, 0), 0.8)
    patterns = parse_sequence("gray-sine:period=16,steps=4").patterns(LINES)
    images = []
    for k, pattern in enumerate(patterns):
        du, dv = rng.normal(scale=0.15, size=2).astype(np.float32)
        moved = cv2.remap(spots, x + du, y + dv, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        place = {"u": 10.2 + 1.05 * x + 0.05 * y, "v": 8.4 + 1.1 * y - 0.06 * x, "lines": LINES, "blur": 0.6}
        images += Bench(**place, ambient=20.0, gain=150.0 * moved, dark=1.0, seed=k).take([pattern])
    assert SMOOTHED not in decode(patterns, images, lines=LINES).notes
