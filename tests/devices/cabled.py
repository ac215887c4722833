"""A DLPC350 and a GenICam camera on one trigger cable, in real time; nothing of the program is imported.

The projector is spoken to over a pseudo-terminal, the camera through what a Harvester offers. Either gives pulses by
its own clock; of those the other may miss one, see one twice or see one late. What the camera sees is the bit plane
that is lit at that moment, by the projector's own account.
"""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from types import SimpleNamespace
from typing import Any

from tests.devices.manuals import Dlpc350
from tests.devices.producer import Node, Producer

Plane = tuple[int | None, int]  # image and bit


class Cable:
    """What arrives of pulses; `wrong` counts those that were lost, doubled or late."""

    def __init__(self, seed: int) -> None:
        self.random, self.rate, self.wrong = random.Random(seed), 0.0, 0

    def seen(self, pulses: list[float], period_s: float) -> list[float]:
        """Give the moments at which the other side sees pulses."""
        moments = []
        for pulse in pulses:
            kind = self.random.choice(["lost", "doubled", "late"]) if self.random.random() < self.rate else ""
            self.wrong += bool(kind)
            if kind != "lost":
                moments.append(pulse + 0.6 * period_s * (kind == "late"))
            if kind == "doubled":
                moments.append(pulse + 0.3 * period_s)
        return moments


class Lit(Dlpc350):
    """The projector; `lit` are the planes and since when."""

    def __init__(self, cable: Cable) -> None:
        super().__init__()
        self.cable, self.lit, self.camera = cable, list[tuple[float, Plane]](), None

    def start(self) -> None:
        super().start()
        now = time.monotonic()
        pulses = [now + 1e-6 * us for us in self.pulses]
        self.lit = list(zip(pulses, self.shown, strict=True))
        if self.camera is not None and len(pulses) > 1:
            self.camera.triggered(self.cable.seen(pulses, pulses[1] - pulses[0]))

    def follow(self, moments: list[float]) -> None:
        """Pulses on trigger input 1."""
        for moment in sorted(moments):
            before = len(self.shown)
            self.trigger(0)
            self.lit += [(moment, plane) for plane in self.shown[before:]]

    def at(self, moment: float) -> Plane | None:
        """The plane that is lit at a moment."""
        return next((plane for since, plane in reversed(self.lit) if since <= moment + 1e-4), None)


class Cabled(Producer):
    """The camera: triggered by software, by line 1, or by its own clock with pulses on line 2."""

    def __init__(self, projector: Lit, cable: Cable, frame: Callable[[Plane | None], Any]) -> None:
        super().__init__(
            Width=Node(value=96),
            Height=Node(value=72),
            TriggerSelector=Node(value="FrameStart"),
            LineSelector=Node(value="Line2"),
            LineMode=Node(value="Input"),
            LineSource=Node(value="Off"),
            AcquisitionMode=Node(value="Continuous"),
            AcquisitionFrameCount=Node(value=1),
            AcquisitionFrameRate=Node(value=10.0),
        )
        self.projector, self.cable, self.frame = projector, cable, frame
        self.waiting, self.count, self.changed = list[tuple[float, Any, int]](), 0, threading.Condition()
        projector.camera = self

    def exposed(self, moment: float) -> None:
        """Take an image at a moment, which may be yet to come."""
        self.count += 1
        self.waiting.append((moment, self.frame(self.projector.at(moment)), self.count))

    def triggered(self, moments: list[float]) -> None:
        """Pulses on line 1."""
        with self.changed:
            if (self.nodes.TriggerMode.value, self.nodes.TriggerSource.value) == ("On", "Line1"):
                for moment in sorted(moments):
                    self.exposed(moment)
            self.changed.notify_all()

    def fire(self) -> None:
        with self.changed:
            self.exposed(time.monotonic())

    def start(self) -> None:
        """Begin; by its own clock so many images as are wanted."""
        if self.nodes.TriggerMode.value == "On" or self.nodes.AcquisitionMode.value != "MultiFrame":
            return
        period_s, now = 1 / self.nodes.AcquisitionFrameRate.value, time.monotonic() + 0.002
        pulses = [now + k * period_s for k in range(self.nodes.AcquisitionFrameCount.value)]
        if (self.nodes.LineMode.value, self.nodes.LineSource.value) == ("Output", "ExposureActive"):
            self.projector.follow(self.cable.seen(pulses, period_s))
        for pulse in pulses:
            self.exposed(pulse + 0.5 * period_s)  # what the middle of the exposure sees, most of all

    def stop(self) -> None:
        """End; what was not fetched is gone."""
        self.waiting.clear()

    def fetch(self, timeout: float) -> AbstractContextManager:
        end = time.monotonic() + timeout
        with self.changed:
            while not self.waiting or self.waiting[0][0] > time.monotonic():
                rest = (min(end, self.waiting[0][0]) if self.waiting else end) - time.monotonic()
                if time.monotonic() >= end:
                    raise TimeoutError("no event")
                self.changed.wait(max(rest, 0.0002))
            moment, pixels, number = self.waiting.pop(0)
        part = SimpleNamespace(data=pixels.ravel(), width=pixels.shape[1], height=pixels.shape[0])
        payload = SimpleNamespace(components=[part])
        return nullcontext(SimpleNamespace(payload=payload, frame_id=number, timestamp_ns=int(1e9 * moment)))
