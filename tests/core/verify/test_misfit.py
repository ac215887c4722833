"""What one phase step, or every one, shows beside its wave is named by cause and amount, and sound steps by nothing.

The frames are of this test: a tilted plane with a texture, light that this test adds up from patterns by the contract's
formulas, bent by a response, with noise.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from core.model import Capture, Frame
from core.patterns import Pattern, Phase, parse_sequence
from core.verify.misfit import Cause, Likely
from core.verify.recognise import recognise
from core.verify.stored import check_stored

LINES = (128, 96)
SHAPE = (120, 160)
Frames = list[np.ndarray]


@lru_cache(maxsize=16)
def patterns(sequence: str) -> tuple[Pattern, ...]:
    return tuple(parse_sequence(sequence).patterns(LINES))


def light(pattern: Pattern) -> np.ndarray:
    """What a pattern lights the plane with, (H, W): between lines, as a lens sees it."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    seen = {"x": 6.3 + 0.71 * x + 0.05 * y, "y": 5.1 + 0.03 * x + 0.7 * y}
    axis = getattr(pattern, "axis", None)
    if axis is None:
        return np.full(SHAPE, {"white": 1.0, "black": 0.0}[pattern.kind])
    line = np.arange(LINES[axis == "y"])
    if isinstance(pattern, Phase):
        wave = np.cos(2 * np.pi * (line + 0.5) / pattern.period - pattern.shift_rad)
        shown = np.where(wave > 0, 1.0, 0.0) if pattern.profile == "square" else 0.5 + 0.5 * wave
    else:
        word = line // pattern.cell
        word = word ^ (word >> 1) if pattern.kind == "gray" else word
        shown = ((word >> (pattern.bits - 1 - pattern.bit)) & 1 ^ pattern.inverse).astype(float)
    at = seen[axis][..., None] + np.linspace(-0.9, 0.9, 13)  # blur of a lens, and the pixel's own
    return np.asarray(np.interp(at, line, shown).mean(axis=-1))


@lru_cache(maxsize=16)
def lights(sequence: str) -> tuple[np.ndarray, ...]:
    return tuple(light(pattern) for pattern in patterns(sequence))


def recorded(lit: list[np.ndarray], gamma: float = 1.0, tone: float = 1.0, noise: float = 0.8) -> Frames:
    """Frames of light (H, W) that a projector of some `gamma` showed, by a camera of some `tone` curve."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    albedo = 0.7 + 0.2 * np.sin(x / 17) * np.cos(y / 13) + 0.05 * np.sin(x * y / 200)
    grey = [220 * (albedo * (0.05 + each**gamma)) ** tone for each in lit]
    return [np.clip(np.rint(each + rng.normal(0, noise, SHAPE)), 0, 255).astype(np.uint8) for each in grey]


def mixed(frames: Frames, held: dict[int, float], way: int = -1) -> Frames:
    """Frames that hold some share of the light of the frame before (or after), by number."""
    return [
        np.rint((1 - held.get(k, 0)) * own + held.get(k, 0) * frames[min(max(k + way, 0), len(frames) - 1)])
        .clip(0, 255)
        .astype(np.uint8)
        for k, own in enumerate(frames)
    ]


def told(sequence: str, frames: Frames) -> str:
    listed = tuple(Frame(Path(f"{k}.png"), p) for k, p in enumerate(patterns(sequence)))
    return "; ".join(f.text for f in check_stored(Capture(Path("a"), "object", listed), frames, None, LINES))


def held(said: str, frame: int, other: int) -> float:
    """Share of another frame's light that one is said to hold; of a period's neighbours either may be named."""
    pairs = {
        (int(k), int(j)): int(share) / 100
        for k, share, j in re.findall(r"frame (\d+) holds about (\d+)% of frame (\d+)'s", said)
    }
    return pairs.get((frame, other), pairs.get((other, frame), 0.0) if "other way round" in said else 0.0)


@pytest.mark.parametrize("gamma", [1.0, 1.6, 2.2])
@pytest.mark.parametrize(
    ("sequence", "frame"), [("paper", 5), ("gray-sine", 6), ("gray-sine", 4), ("gray-inverse", 16)]
)
@pytest.mark.parametrize(("share", "way"), [(0.1, -1), (0.3, -1), (0.3, 1)])
def test_a_step_that_holds_light_of_its_neighbour_in_time_is_named(
    sequence: str, frame: int, share: float, way: int, gamma: float
) -> None:
    """One of 30 % put coordinates off by 0.3 lines at a sigma of 0.13, and nothing was said of it."""
    step = [k for k, p in enumerate(patterns(sequence)) if isinstance(p, Phase)][frame % 4]
    said = told(sequence, mixed(recorded(list(lights(sequence)), gamma), {step: share}, way))
    assert held(said, step, step + way) == pytest.approx(share, abs=0.01 + 0.2 * share * (gamma > 1)), said
    assert "settle_ms" in said


@pytest.mark.parametrize(
    "sequence", ["gray-sine:steps=3", "gray-sine:steps=8", "multi-frequency:steps=3", "two-period"]
)
def test_also_of_three_steps_and_of_eight(sequence: str) -> None:
    steps = [k for k, p in enumerate(patterns(sequence)) if isinstance(p, Phase)]
    said = told(sequence, mixed(recorded(list(lights(sequence)), 1.8), {steps[1]: 0.3}))
    assert held(said, steps[1], steps[0]) == pytest.approx(0.3, abs=0.05), said


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2, 0.3])
@pytest.mark.parametrize("sequence", ["gray-sine", "two-period", "multi-frequency"])
def test_every_frame_that_holds_light_of_the_one_before_it_is_told(sequence: str, share: float) -> None:
    frames = recorded(list(lights(sequence)))
    said = told(sequence, mixed(frames, dict.fromkeys(range(1, len(frames)), share)))
    found = [float(part.split("%")[0]) / 100 for part in said.split("each holds about ")[1:]]
    assert found, said
    assert np.abs(np.array(found) - share).max() <= 0.011 + 0.05 * share


@pytest.mark.parametrize("more", [-0.2, 0.1, 0.3])
def test_a_step_of_more_or_less_light_is_no_light_of_another(more: float) -> None:
    """Which is taken out when decoding."""
    frames = recorded([light / 1.4 for light in lights("gray-sine")])
    frames[6] = np.clip(np.rint((1 + more) * frames[6].astype(float)), 0, 255).astype(np.uint8)
    assert not told("gray-sine", frames)


@pytest.mark.parametrize("by_deg", [-20.0, 8.0])
def test_a_step_of_another_shift_than_described_is_told(by_deg: float) -> None:
    shown = [
        light(replace(p, shift_rad=p.shift_rad + np.radians(by_deg))) if k == 5 and isinstance(p, Phase) else light(p)
        for k, p in enumerate(patterns("gray-sine"))
    ]
    said = told("gray-sine", recorded(shown))
    assert f"frame 5 is shifted by {abs(by_deg):.2g}° {'more' if by_deg > 0 else 'less'} than shift_rad says" in said


def test_light_that_would_have_to_be_taken_away_is_no_light_of_another() -> None:
    cause = Cause("mixed", (5, 4), "", np.zeros((1, 3)))
    possible = {factor: Likely(cause, factor, 0.1).possible for factor in (-1.0, -0.3, 0.0, 0.4, 3.0, 3.1)}
    assert [factor for factor, may in possible.items() if may] == [0.4, 3.0]


@pytest.mark.parametrize(
    "sequence", ["paper", "gray-sine", "gray-sine:steps=3", "gray-sine:period=12.5", "gray-sine:steps=12,period=24"]
)
@pytest.mark.parametrize(("gamma", "tone"), [(1.0, 1.0), (2.2, 1.0), (0.7, 1.0), (1.0, 0.45), (2.2, 0.6)])
@pytest.mark.parametrize("noise", [0.3, 4.0])
def test_sound_steps_of_any_response_raise_nothing(sequence: str, gamma: float, tone: float, noise: float) -> None:
    assert not told(sequence, recorded(list(lights(sequence)), gamma, tone, noise))


@pytest.mark.parametrize(
    ("sequence", "gamma"), [("gray-sine:steps=8", 2.2), ("gray-sine", 2.2), ("gray-sine:steps=6", 1.0)]
)
def test_an_order_is_found_by_content_whatever_the_response(sequence: str, gamma: float) -> None:
    """Eight steps at a gamma of 2.2 showed no sequence in any order."""
    frames = recorded(list(lights(sequence)), gamma)
    order = np.random.default_rng(4).permutation(len(frames))
    found = recognise([frames[k] for k in order], patterns(sequence), LINES, "test")
    assert order[found].tolist() == list(range(len(frames)))
