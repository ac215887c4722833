"""A virtual projector and a virtual camera that share a scene."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.devices.faults import CAMERA_FAULTS, Faults
from core.devices.protocol import (
    Check,
    Image,
    Pixels,
    Setting,
    check_pattern,
    check_sequence,
    no_check,
    pattern_at,
    wait_until,
)
from core.devices.scene import Lines, Scene
from core.errors import DeviceError
from core.patterns import Black, Pattern

Light = Pattern | tuple[Lines, Lines]  # a pattern, or column lines and row lines


@dataclass
class Stage:
    """The scene and the light on it, which takes `switching_s` to change."""

    scene: Scene
    seed: int = 0
    switching_s: float = 0.0

    def __post_init__(self) -> None:
        self._lock = threading.Lock()
        self._now: Light = Black()
        self._before: Light = Black()
        self._steady_s = time.monotonic()
        self._exposures = 0

    def switch(self, light: Light, delay_s: float = 0.0) -> None:
        """Let the light change; it is steady after `delay_s` and the switching time."""
        with self._lock:
            self._before, self._now = self._now, light
            self._steady_s = time.monotonic() + delay_s + self.switching_s

    def expose(self) -> Pixels:
        """Take an image of the scene in the light of this moment; while the light changes, of the one before."""
        with self._lock:
            light = self._now if time.monotonic() >= self._steady_s else self._before
            seed, self._exposures = self.seed * 100_003 + self._exposures, self._exposures + 1
        if isinstance(light, tuple):
            return self.scene.frame_lines(*light, seed)
        return self.scene.frame(light, seed)


class VirtualProjector:
    """A projector without a cable: every pattern is shown at once."""

    def __init__(self, stage: Stage, settle_s: float = 0.0, capacity: int = 256) -> None:
        self.name, self.settle_s, self.capacity = "virtual projector", settle_s, capacity
        self.stage, self.sequence = stage, stage.scene.sequence
        stage.switching_s = settle_s
        self._loaded: tuple[Pattern, ...] = ()
        self._open = True

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows, in lines."""
        return self.stage.scene.projector_size

    def refusal(self, pattern: Pattern) -> str | None:
        """Why this pattern cannot be shown."""
        return self.stage.scene.refusal(pattern)

    def show(self, pattern: Pattern, check: Check = no_check) -> None:
        """Show one pattern."""
        self._check_open()
        check_pattern(self, pattern)
        self.stage.switch(pattern)

    def load(self, patterns: Sequence[Pattern], check: Check = no_check) -> None:
        """Store a sequence."""
        self._check_open()
        self._loaded = check_sequence(self, patterns, check)

    def step(self, index: int, check: Check = no_check) -> None:
        """Show a pattern of the loaded sequence."""
        self.show(pattern_at(self, self._loaded, index))

    def close(self) -> None:
        """Let go."""
        self._open = False

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError(self.name, "closed", "open it again")


class VirtualCamera:
    """A camera that looks at a stage, with faults on demand.

    `gain` multiplies its grey values, as a camera's digital gain does.
    """

    def __init__(self, stage: Stage, exposure_s: float = 0.0, faults: Faults | None = None, gain: float = 1.0) -> None:
        self.name, self.bits, self.exposure_s = "virtual camera", stage.scene.bits, exposure_s
        self.stage, self.faults, self.gain = stage, faults or Faults(), gain
        self._previous: Pixels | None = None
        self._open = True

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in px."""
        return self.stage.scene.camera_size

    @property
    def setting(self) -> Setting:
        """The gain."""
        return Setting("gain", "gain", "", self.gain)

    def adjust(self, value: float) -> Setting:
        """Set the gain."""
        self.gain = value
        return self.setting

    def grab(self, timeout_s: float = 5.0, check: Check = no_check) -> Image:
        """Take one image."""
        if not self._open:
            raise DeviceError(self.name, "closed", "open it again")
        start = time.monotonic()
        fault = self.faults.next(CAMERA_FAULTS)
        if fault == "no-frame":
            raise DeviceError(
                self.name, f"no image within {timeout_s:g} s", "check the camera's cable, trigger and exposure time"
            )
        pixels = self.stage.expose()
        if self.gain != 1.0:
            top = (1 << self.bits) - 1
            pixels = np.clip(np.rint(pixels * self.gain), 0, top).astype(pixels.dtype)
        wait_until(start + self.exposure_s, check)
        previous, self._previous = self._previous, pixels
        if fault == "stale-frame" and previous is not None:
            pixels = previous
        elif fault == "torn-frame" and previous is not None:
            half = len(pixels) // 2
            pixels = np.concatenate([pixels[:half], previous[half:]])
        return Image(pixels, self.bits, start)

    def close(self) -> None:
        """Let go."""
        self._open = False
