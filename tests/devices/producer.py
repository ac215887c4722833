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
    """The part of a Harvester that is used: one camera, software trigger or free running."""

    min_num_buffers = 1

    def __init__(self, trigger: bool = True, **nodes: Node) -> None:
        self.light, self.calls, self.dead = 10, [], False
        self.device_info_list = [SimpleNamespace(serial_number="A1")]
        table = {
            "Width": Node(value=8),
            "Height": Node(value=6),
            "PixelFormat": Node(value="Mono8"),
            "ExposureTime": Node(value=1000.0),
            "ExposureAuto": Node(value="Continuous"),
        }
        if trigger:
            table |= {"TriggerMode": Node(value="Off"), "TriggerSource": Node(value="Line0")}
            table["TriggerSoftware"] = SimpleNamespace(execute=self.fire)
        self.nodes = SimpleNamespace(**{**table, **nodes})
        self.buffers: list[int] = [] if trigger else [77, 77, 77]
        self.trigger = trigger
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
        if not self.buffers and not self.trigger:
            time.sleep(0.01)
            self.buffers.append(self.light)
        return delivered(self.buffers.pop(0), np.uint8 if self.nodes.PixelFormat.value == "Mono8" else np.uint16)


def delivered(level: int, kind: type[np.unsignedinteger] = np.uint8, **told: object) -> AbstractContextManager:
    """Give a buffer of 8x6 pixels, with what the camera tells beside."""
    part = SimpleNamespace(data=np.full(48, level, kind), width=8, height=6)
    return nullcontext(SimpleNamespace(payload=SimpleNamespace(components=[part]), **told))
