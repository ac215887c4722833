"""A stand-in for OpenCV's VideoCapture, for tests without a camera."""

from __future__ import annotations

import threading

import cv2
import numpy as np


class Video:
    """100 images a second, each exposed 10 ms before it comes, four of them kept; settings that stick or do not.

    Parameters
    ----------
    opens : bool
        Whether there is such a device.
    sticky : dict, optional
        Settings that stay at a value whatever they are set to.
    """

    def __init__(self, *, opens: bool = True, sticky: dict[int, float] | None = None) -> None:
        self.opens, self.level, self.run, self.released = opens, 20, True, False
        self.settings = {cv2.CAP_PROP_FRAME_WIDTH: 8.0, cv2.CAP_PROP_FRAME_HEIGHT: 6.0}
        self.sticky = sticky or {}
        self.queue: list[np.ndarray] = []
        self.ready, self.end = threading.Condition(), threading.Event()
        self.thread = threading.Thread(target=self.expose, daemon=True)
        self.thread.start()

    def expose(self) -> None:
        """Deliver images until released."""
        level = self.level
        while not self.end.wait(0.01):
            with self.ready:
                if self.run:
                    self.queue = [*self.queue, np.full((6, 8, 3), level, np.uint8)][-4:]
                level = self.level
                self.ready.notify_all()

    def isOpened(self) -> bool:  # noqa: N802  OpenCV's name
        """Whether there is such a device."""
        return self.opens

    def read(self) -> tuple[bool, np.ndarray | None]:
        """Give the oldest image that is kept, or wait for one."""
        with self.ready:
            if not self.ready.wait_for(lambda: bool(self.queue), 0.1):
                return False, None
            return True, self.queue.pop(0)

    def set(self, key: int, value: float) -> bool:
        """Take a setting, or seem to."""
        self.settings[key] = self.sticky.get(key, value)
        return True

    def get(self, key: int) -> float:
        """Give a setting."""
        return self.settings.get(key, 0.0)

    def release(self) -> None:
        """Let the device go."""
        self.released = True
        self.end.set()
        self.thread.join()
