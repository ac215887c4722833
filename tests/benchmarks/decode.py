"""Decoding against the copy of its own bytes, numpy, OpenCV and `fringes`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from core.decode import decode
from core.patterns import Black, Pattern, White, gray_and_phase, reference_sequence
from tests.benchmarks.environments import peer
from tests.benchmarks.scenes import LINES, SIZES, Frames, frames, sizes
from tests.benchmarks.timing import Absent, Contestant, Row, floor, race

OUTPUT_BYTES = 17  # a pixel: u, v, sigma_u, sigma_v float32, and validity
PERIOD, CELL = 4, 2
ENDS = ("748x576", "2448x2048")  # sizes for what takes long


def run() -> list[Row]:
    """The reference sequence at two sizes, then other sequences, then the number of frames."""
    rows = []
    for size, (width, height) in sizes().items():
        data = frames(reference_sequence(), width, height)
        field = [
            *floor(data.images, OUTPUT_BYTES * width * height),
            Contestant("stripe workbench", lambda d=data: _ours(d), _close(data)),
            Contestant("OpenCV primitives", lambda d=data: _opencv(d), _close(data)),
            Contestant("plain numpy", lambda d=data: _numpy(d), _close(data), warm=width < 1000),
        ]
        if size in ENDS:
            field.append(_fringes(width, height))
        rows += race("decode", f"{size} x 28", width * height, "pixels", field)
        others = {name: frames(patterns, width, height) for name, patterns in _others().items() if size in ENDS}
        if size in ENDS:
            others["in 16 bit"] = _in_16_bit(data)
        for name, other in others.items():
            copies = floor(other.images, OUTPUT_BYTES * width * height)
            ours = Contestant("stripe workbench", lambda d=other: _ours(d), _close(other))
            rows += race(
                "decode, other sequences", f"{size} x {len(other.images)} {name}", width * height, "", [*copies, ours]
            )
    for steps in (4, 16, 64):
        patterns = [p for axis in "xy" for p in _codes(axis, [4], steps)]
        data = frames(patterns, *SIZES["748x576"])
        copies = floor(data.images, OUTPUT_BYTES * data.u.size)
        ours = Contestant("stripe workbench", lambda d=data: _ours(d), _close(data))
        rows += race("decode, frames", f"748x576 x {len(patterns)}", len(patterns), "frames", [*copies, ours])
    return rows


def _in_16_bit(data: Frames) -> Frames:
    """The same seen by a camera of 12 bits."""
    rng = np.random.default_rng(1)
    images = [16 * image.astype(np.uint16) + rng.integers(0, 16, image.shape, np.uint16) for image in data.images]
    return replace(data, images=images)


def _codes(axis: str, periods: list[float], steps: int = 4, cell: int = 2, **more: object) -> list[Pattern]:
    return gray_and_phase(axis, LINES, cell=cell, periods=periods, steps=steps, **more)  # type: ignore[arg-type]


def _others() -> dict[str, list[Pattern]]:
    both = [White(), Black()]
    return {
        "3 sine periods, inverse Gray": [
            *(p for axis in "xy" for p in _codes(axis, [8, 48, 320], 3, cell=160, inverse=True)),
            *both,
        ],
        "sine and inverse Gray": [p for axis in "xy" for p in _codes(axis, [8], 4, cell=4, inverse=True)],
        "cell as wide as the period": [p for axis in "xy" for p in _codes(axis, [4], cell=4)] + both,
        "8 sine steps": [p for axis in "xy" for p in _codes(axis, [8], 8, cell=4)] + both,
        "plain binary": [p for axis in "xy" for p in _codes(axis, [4], kind="binary")] + both,
        "plain binary, 7 steps": [p for axis in "xy" for p in _codes(axis, [6.5], 7, kind="binary")] + both,
    }


def _ours(data: Frames) -> tuple[np.ndarray, np.ndarray]:
    phase = decode(data.patterns, data.images, lines=(LINES, LINES))
    return phase.u, phase.v


def _close(data: Frames) -> Callable[[tuple[np.ndarray, np.ndarray]], str]:
    """Judge u and v: three quarters decoded at least, at most 1 in 1,000 further off than a line."""

    def judge(result: tuple[np.ndarray, np.ndarray]) -> str:
        errors = []
        for found, true in zip(result, (data.u, data.v), strict=True):
            valid = np.isfinite(found)
            assert valid.mean() > 0.75, f"only {valid.mean():.0%} decoded"
            error = np.abs(found[valid] - true[valid])
            assert np.mean(error > 1) < 1e-3, f"{np.mean(error > 1):.1e} of the pixels are wrong"
            errors.append(float(np.sqrt(np.mean(error[error < 1] ** 2))))
        return f"r.m.s. {max(errors):.3f} lines"

    return judge


def _numpy(data: Frames) -> tuple[np.ndarray, np.ndarray]:
    """What one writes down first: Gray bits against the mean of white and black, phase of the four steps."""
    white, black = (image.astype(np.float32) for image in data.images[-2:])
    middle = (white + black) / 2
    found = []
    for first in (0, 13):
        code = np.zeros(middle.shape, np.int32)
        last = np.zeros(middle.shape, bool)
        for image in data.images[first : first + 9]:
            last = last ^ (image > middle)
            code = 2 * code + last
        i1, i2, i3, i4 = (image.astype(np.float32) for image in data.images[first + 9 : first + 13])
        phase = np.arctan2(i1 - i3, i4 - i2)
        modulation = np.hypot(i1 - i3, i4 - i2) / 2
        part = phase * np.float32(PERIOD / (2 * np.pi)) - np.float32(0.5)
        line = part + PERIOD * np.rint((CELL * code + np.float32(0.5) - part) / PERIOD)
        sigma = np.float32(2 * PERIOD / (2 * np.pi) / np.sqrt(2)) / modulation
        line[modulation < 8] = np.nan
        sigma[modulation < 8] = np.nan
        found.append(line.astype(np.float32))
    return found[0], found[1]


def _opencv(data: Frames) -> tuple[np.ndarray, np.ndarray]:
    """The same with OpenCV's functions on whole images."""
    middle = cv2.addWeighted(data.images[-2], 0.5, data.images[-1], 0.5, 0)
    found = []
    for first in (0, 13):
        code = np.zeros(middle.shape, np.float32)
        last = np.zeros(middle.shape, np.uint8)
        for image in data.images[first : first + 9]:
            last = cv2.bitwise_xor(last, cv2.compare(image, middle, cv2.CMP_GT))
            cv2.scaleAdd(code, 1.0, cv2.scaleAdd(code, 1.0, _unit(last)), code)
        i1, i2, i3, i4 = data.images[first + 9 : first + 13]
        cosine = cv2.subtract(i4, i2, dtype=cv2.CV_32F)
        sine = cv2.subtract(i1, i3, dtype=cv2.CV_32F)
        modulation, phase = cv2.cartToPolar(cosine, sine)
        part = cv2.addWeighted(phase, PERIOD / (2 * np.pi), phase, 0, -0.5)
        fringe = cv2.addWeighted(code, CELL / PERIOD, part, -1 / PERIOD, 0.5 / PERIOD)
        order = cv2.add(fringe, 0.0, dtype=cv2.CV_16S)  # rounds
        line = cv2.addWeighted(part, 1, order, PERIOD, 0, dtype=cv2.CV_32F)
        sigma = cv2.divide(2 * 2 * PERIOD / (2 * np.pi) / np.sqrt(2), modulation)
        weak = cv2.compare(modulation, 16, cv2.CMP_LT)
        line[weak > 0] = np.nan
        sigma[weak > 0] = np.nan
        found.append(line)
    return found[0], found[1]


def _unit(mask: np.ndarray) -> np.ndarray:
    return cv2.multiply(mask, 1.0, scale=1 / 255, dtype=cv2.CV_32F)


def _fringes(width: int, height: int) -> Contestant | Absent:
    """The `fringes` package with its own default sequence of 16 frames, seen without noise or blur."""
    y, x = np.mgrid[0:height, 0:width]
    u, v = x * (LINES - 1) // (width - 1), y * (LINES - 1) // (height - 1)

    def right(result: dict[str, np.ndarray]) -> str:
        error = np.abs(result["uv"] - np.stack([u, v]))
        assert np.mean(error > 1) < 1e-3, f"{np.mean(error > 1):.1e} of the pixels are wrong"
        return f"r.m.s. {np.sqrt(np.mean(error[error < 1] ** 2)):.3f} lines (no noise)"

    data = {"lines": np.array(LINES), "u": u, "v": v}
    return peer("fringes", "fringes, 16 frames", data, right, warm=width < 1000)
