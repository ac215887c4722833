"""A virtual projector and a virtual camera that share a scene."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.devices.faults import CAMERA_FAULTS, TRIGGER_FAULTS, Faults
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
        self.shown: list[tuple[float, Light]] = []  # by a clock or by triggers, and since when
        self.pulses: list[float] = []  # on the trigger's cable, whoever gives them
        self._following: list[Light] = []  # what further pulses show
        self.patient = True  # whoever runs thousands of sequences need not wait for them

    def run(self, lights: Sequence[Light], period_s: float) -> None:
        """Show lights one after the other from now on."""
        start = time.monotonic()
        self.pulses = [start + k * period_s for k in range(len(lights))]
        self.shown = list(zip(self.pulses, lights, strict=True))

    def follow(self, lights: Sequence[Light]) -> None:
        """Show a light at every trigger from now on, and black once all were shown."""
        self.shown, self._following = [], list(lights)

    def trigger(self, pulses: Sequence[float], seen: Sequence[float]) -> None:
        """Give pulses, and show what follows at those that the projector has seen."""
        self.pulses = list(pulses)
        for moment_s in sorted(seen):
            self.shown.append((moment_s, self._following.pop(0) if self._following else Black()))

    def at(self, moment_s: float, scene: Scene | None = None) -> Pixels:
        """Take an image in the light of a moment while the projector ran by a clock."""
        light: Light = next((light for since, light in reversed(self.shown) if since <= moment_s), Black())
        with self._lock:
            self._now = light
            self._steady_s = 0.0
        return self.expose(scene)

    def switch(self, light: Light, delay_s: float = 0.0) -> None:
        """Let the light change; it is steady after `delay_s` and the switching time."""
        with self._lock:
            self._before, self._now = self._now, light
            self._steady_s = time.monotonic() + delay_s + self.switching_s

    def expose(self, scene: Scene | None = None) -> Pixels:
        """Take an image of the scene in the light of this moment; while the light changes, of the one before.

        `scene` is the same before another camera.
        """
        with self._lock:
            light = self._now if time.monotonic() >= self._steady_s else self._before
            seed, self._exposures = self.seed * 100_003 + self._exposures, self._exposures + 1
        seen = scene or self.scene
        if isinstance(light, tuple):
            return seen.frame_lines(*light, seed)
        return seen.frame(light, seed)


class VirtualProjector:
    """A projector without a cable: every pattern is shown at once."""

    def __init__(self, stage: Stage, settle_s: float = 0.0, capacity: int = 256, period_s: float = 0.0) -> None:
        self.period_s, self.can_follow = period_s, True
        self.name, self.settle_s, self.capacity = "virtual projector", settle_s, capacity
        self.stage, self.sequence, self.size = stage, stage.scene.sequence, stage.scene.projector_size
        stage.switching_s = settle_s
        self._loaded: tuple[Pattern, ...] = ()
        self._open = True

    def refusal(self, pattern: Pattern) -> str | None:
        return self.stage.scene.refusal(pattern)

    def show(self, pattern: Pattern, check: Check = no_check) -> None:
        self._check_open()
        check_pattern(self, pattern)
        self.stage.switch(pattern)

    def load(self, patterns: Sequence[Pattern], check: Check = no_check) -> None:
        self._check_open()
        self._loaded = check_sequence(self, patterns, check)

    def step(self, index: int, check: Check = no_check) -> None:
        self.show(pattern_at(self, self._loaded, index))

    def run(self, check: Check = no_check) -> None:
        self._check_open()
        self.stage.run(self._loaded, self.period_s)

    def follow(self, period_s: float, check: Check = no_check) -> None:
        self._check_open()
        self.stage.follow(self._loaded)

    def close(self) -> None:
        self._open = False

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError(self.name, "closed", "open it again")


class VirtualCamera:
    """A camera that looks at a stage, with faults on demand.

    `gain` multiplies its grey values, as a camera's digital gain does; `scene` is the stage's before another camera.
    """

    def __init__(
        self,
        stage: Stage,
        exposure_s: float = 0.0,
        faults: Faults | None = None,
        gain: float = 1.0,
        scene: Scene | None = None,
        lead_period_s: float = 0.0,
    ) -> None:
        self.scene, self.lead_period_s = scene or stage.scene, lead_period_s
        self.name, self.bits, self.size = "virtual camera", self.scene.bits, self.scene.camera_size
        self.stage, self.faults, self.gain, self.exposure_s = stage, faults or Faults(), gain, exposure_s
        self._previous: Pixels | None = None
        self._open, self.can_arm, self._number = True, True, 0
        self._led: list[float] = []  # begins of the images that its own clock takes

    @property
    def setting(self) -> Setting:
        return Setting("gain", "gain", "", self.gain)

    def adjust(self, value: float) -> Setting:
        self.gain = value
        return self.setting

    def grab(self, timeout_s: float = 5.0, check: Check = no_check) -> Image:
        if not self._open:
            raise DeviceError(self.name, "closed", "open it again")
        start = time.monotonic()
        fault = self.faults.next(CAMERA_FAULTS)
        if fault == "no-frame":
            raise DeviceError(
                self.name, f"no image within {timeout_s:g} s", "check the camera's cable, trigger and exposure time"
            )
        pixels = self._amplified(self.stage.expose(self.scene))
        wait_until(start + self.exposure_s, check)
        previous, self._previous = self._previous, pixels
        if fault == "stale-frame" and previous is not None:
            pixels = previous
        elif fault == "torn-frame" and previous is not None:
            half = len(pixels) // 2
            pixels = np.concatenate([pixels[:half], previous[half:]])
        elif fault == "mixed-frame" and previous is not None:
            pixels = np.rint(0.7 * pixels + 0.3 * previous).astype(pixels.dtype)
        return Image(pixels, self.bits, start)

    def arm(self, count: int) -> None:
        self.stage.shown, self.stage.pulses, self._led = [], [], []

    def lead(self, count: int) -> None:
        start = time.monotonic()
        self._led = [start + k * self.lead_period_s for k in range(count)]
        self.stage.trigger(self._led, self._seen(self._led, self.lead_period_s))

    def collect(self, count: int, timeout_s: float, check: Check = no_check) -> list[Image]:
        """Give the images of its own clock or of the pulses it has seen, each exposed in the middle of its pattern."""
        pulses, images = self.stage.pulses, []
        period_s = pulses[1] - pulses[0] if len(pulses) > 1 else self.lead_period_s
        if pulses and self.stage.patient:
            wait_until(pulses[-1] + period_s, check)
        begins, self._led = self._led or self._seen(pulses, period_s), []
        for moment in (begin + period_s / 2 for begin in begins):
            check()
            self._number += 1
            images.append(Image(self._amplified(self.stage.at(moment, self.scene)), self.bits, moment, self._number))
        return images

    def _seen(self, pulses: Sequence[float], period_s: float) -> list[float]:
        """Give the moments at which pulses are seen, by the device that they trigger."""
        seen = []
        for pulse in pulses:
            fault = self.faults.next(TRIGGER_FAULTS)
            if fault != "lost-trigger":
                seen.append(pulse + period_s * (fault == "late-trigger"))
            if fault == "doubled-trigger":
                seen.append(pulse + 0.1 * period_s)
        return seen

    def _amplified(self, pixels: Pixels) -> Pixels:
        if self.gain == 1.0:
            return pixels
        return np.clip(np.rint(pixels * self.gain), 0, (1 << self.bits) - 1).astype(pixels.dtype)

    def close(self) -> None:
        self._open = False
