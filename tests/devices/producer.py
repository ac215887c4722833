"""A stand-in for harvesters' Harvester and its cameras, for tests without a camera."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from types import SimpleNamespace

import numpy as np


class Node(SimpleNamespace):
    """A GenICam node that takes what it is given, or keeps its value."""


class Producer:
    """The part of a Harvester that is used: one camera with a software trigger."""

    min_num_buffers = 1

    def __init__(self, **nodes: Node) -> None:
        self.light, self.calls, self.dead = 10, [], False
        self.device_info_list = [SimpleNamespace(serial_number="A1")]
        table = {
            "Width": Node(value=8),
            "Height": Node(value=6),
            "PixelFormat": Node(value="Mono8"),
            "ExposureTime": Node(value=1000.0),
            "ExposureAuto": Node(value="Continuous"),
            "TriggerMode": Node(value="Off"),
            "TriggerSource": Node(value="Line0"),
            "TriggerSoftware": SimpleNamespace(execute=self.fire),
        }
        self.nodes = SimpleNamespace(**{**table, **nodes})
        self.buffers: list[int] = []
        self.remote_device = SimpleNamespace(node_map=self.nodes)

    def __getattr__(self, name: str) -> Callable[..., Producer]:
        """Note any other call; `create` gives the camera, which is this."""
        return lambda *arguments: self.calls.append(name) or self

    def fire(self) -> None:
        self.buffers.append(self.light)

    def fetch(self, timeout: float) -> AbstractContextManager:
        if self.dead:
            time.sleep(timeout)
            raise TimeoutError("no event")
        return delivered(self.buffers.pop(0), np.uint8 if self.nodes.PixelFormat.value == "Mono8" else np.uint16)


class Running(Producer):
    """A camera without trigger: an image every `PERIOD_S`, exposed all that time and read out in the next period.

    Images that nobody fetches fill `ROOM` buffers; those after them are lost. What an image shows is the light as its
    exposure began.
    """

    PERIOD_S, ROOM = 0.01, 3

    def __init__(self) -> None:
        super().__init__(ExposureTime=Node(value=1e6 * self.PERIOD_S))
        del self.nodes.TriggerMode, self.nodes.TriggerSoftware
        self.begun_s, self.read, self.kept = time.monotonic(), 0, list[int]()
        self.lights = [(self.begun_s, self.light)]

    def shine(self, light: int) -> None:
        self.lights.append((time.monotonic(), light))

    def fetch(self, timeout: float) -> AbstractContextManager:
        end = time.monotonic() + timeout
        while True:
            now = time.monotonic()
            whole = max(0, int((now - self.begun_s) / self.PERIOD_S) - 1)  # that have been read out
            self.kept += range(self.read, whole)[: self.ROOM - len(self.kept)]
            self.read = max(self.read, whole)
            if self.kept:
                began = self.begun_s + self.kept.pop(0) * self.PERIOD_S
                return delivered([light for since, light in self.lights if since <= began][-1])
            if now >= end:
                raise TimeoutError("no event")
            time.sleep(min(0.001, end - now))


def delivered(level: int, kind: type[np.unsignedinteger] = np.uint8, **told: object) -> AbstractContextManager:
    """Give a buffer of 8x6 pixels, with what the camera tells beside."""
    part = SimpleNamespace(data=np.full(48, level, kind), width=8, height=6)
    return nullcontext(SimpleNamespace(payload=SimpleNamespace(components=[part]), **told))
