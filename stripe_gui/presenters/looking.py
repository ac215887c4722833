"""Looking through the camera before anything is recorded: the two devices, and one image with what matters of it."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.capture.plan import guards_for, own_sequence
from core.devices import Adjustable, Camera, Projector, Setting, open_camera, open_projector, wait_until
from core.errors import Cancelled
from core.lazy import dataclass
from core.patterns import Black, Pattern, White, axis_of
from core.progress import SILENT, Progress


@dataclass(frozen=True)
class Look:
    """One live image."""

    image: NDArray[Any]  #: (H, W)
    full: float  #: the grey value of saturation
    clipped: NDArray[np.bool_]  #: (H, W): pixels that have it
    brightest: float  #: the 99.5th percentile as a share of `full`
    seconds: float  #: from the call to the image

    @property
    def clipped_percent(self) -> float:
        return 100.0 * float(self.clipped.mean())


class Rig:
    """A projector and a camera that stay open while they are looked through; one thread at a time uses them."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._urls: tuple[str, str] | None = None
        self._projector: Projector | None = None
        self._camera: Camera | None = None
        self._light = ""

    def open(self, urls: tuple[str, str], progress: Progress = SILENT) -> tuple[Projector, Camera]:
        """Open both devices, or give those that are open already."""
        with self._lock:
            if self._urls != urls or self._projector is None or self._camera is None:
                self.close()
                self._projector = open_projector(urls[0], check=progress.check)
                try:
                    self._camera = open_camera(urls[1])
                except BaseException:
                    self.close()
                    raise
                self._urls = urls
            return self._projector, self._camera

    @property
    def setting(self) -> Setting | None:
        """What sets the camera's exposure; None where it cannot be set."""
        camera = self._camera
        return camera.setting if isinstance(camera, Adjustable) else None

    def adjust(self, value: float, urls: tuple[str, str], progress: Progress = SILENT) -> Setting | None:
        """Set the exposure of the open camera; gives what is set then."""
        with self._lock:
            camera = self._camera
            if not isinstance(camera, Adjustable):
                return None
            setting = camera.adjust(value)
            self._urls = urls  # of the same devices, with the new exposure in them
            return setting

    def look(self, urls: tuple[str, str], light: str = "white", progress: Progress = SILENT) -> Look:
        """Take one image in white, black or striped light; an error, but no wish to stop, closes the devices."""
        with self._lock:
            try:
                projector, camera = self.open(urls, progress)
                if light != self._light:
                    self._light = ""  # unknown while it changes: the change may be cancelled
                    projector.show(_pattern(light, projector), progress.check)
                    wait_until(time.monotonic() + projector.settle_s, progress.check)
                    self._light = light
                start = time.monotonic()
                image = camera.grab(check=progress.check)
            except Cancelled:
                raise
            except BaseException:
                self.close()
                raise
            pixels = image.pixels
            bright = float(np.percentile(pixels[::4, ::4], 99.5)) / image.full
            return Look(pixels, float(image.full), pixels >= image.full, bright, time.monotonic() - start)

    def close(self, progress: Progress = SILENT) -> None:
        with self._lock:
            for device in (self._projector, self._camera):
                if device is not None:
                    device.close()
            self._projector = self._camera = self._urls = None
            self._light = ""


def _pattern(light: str, projector: Projector) -> Pattern:
    if light == "stripes":
        patterns = own_sequence(projector)
        return next((p for p in guards_for(patterns, projector.size) if axis_of(p)), White())
    return Black() if light == "black" else White()
