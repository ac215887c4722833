"""Cameras that OpenCV opens: USB video class, and whatever else the system offers as a video device.

Such a camera runs freely and keeps images in buffers. A thread takes every image off as it comes, so that none waits;
`grab` gives the first image that arrived late enough to have been exposed after the call.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from statistics import median
from typing import Any

import cv2
import numpy as np

from core.devices.protocol import GRAIN_S, Check, Image, Note, Pixels, Setting, no_check, no_note
from core.errors import DeviceError, NotThereError

MANUAL = (1.0, 0.25)  # what "no automatic exposure" is called by Video4Linux and by others
AUTOMATIC = (3.0, 0.75)  # and what automatic exposure is
SAME = 0.02  # a setting read back within two per cent counts as taken
_OPEN_S = 10.0


class UvcCamera:
    """A camera of OpenCV.

    Parameters
    ----------
    number : int
        Which video device.
    width, height : int
        Wanted size in px; 0: the device's own.
    exposure : float, optional
        In the unit of the device's driver (Video4Linux: 0.1 ms). Automatic exposure, white balance and focus are
        switched off.
    fourcc : str
        Wanted format, such as "GREY", "Y16 " or "YUYV"; empty: the device's own.
    bits : int
        Bits of a grey value that are used; 0: all of the pixel's type.
    capture : callable
        Makes the object that OpenCV calls VideoCapture.

    Raises
    ------
    DeviceError
        If there is no such device, it delivers nothing, or a setting that was wanted is not what is read back.
    """

    def __init__(
        self,
        number: int,
        *,
        width: int = 0,
        height: int = 0,
        exposure: float | None = None,
        gain: float | None = None,
        gamma: float | None = None,
        fourcc: str = "",
        bits: int = 0,
        note: Note = no_note,
        capture: Callable[[int], Any] = cv2.VideoCapture,
    ) -> None:
        self.name, self.note = f"video device {number}", note
        self._capture = capture(number)
        if not self._capture.isOpened():
            self._capture.release()
            raise NotThereError(
                self.name, "cannot be opened", "check the cable, and that no other program uses the camera"
            )
        try:
            self._set_up(width, height, exposure, gain, gamma, fourcc)
        except BaseException:
            self._capture.release()
            raise
        self._news = threading.Condition()
        self._latest: tuple[Pixels, float] | None = None
        self._count, self._failures = 0, 0
        self._periods_s: deque[float] = deque(maxlen=9)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name=self.name, daemon=True)
        self._thread.start()
        try:
            first = self._wait(lambda: self._latest is not None, _OPEN_S)
        except BaseException:
            self.close()
            raise
        self.bits = bits or 8 * first[0].dtype.itemsize
        self.size = first[0].shape[1], first[0].shape[0]

    @property
    def setting(self) -> Setting:
        """The exposure, in the unit of the device's driver."""
        return Setting("exposure", "exposure", "", float(self._capture.get(cv2.CAP_PROP_EXPOSURE)))

    def adjust(self, value: float) -> Setting:
        self._wanted("exposure", cv2.CAP_PROP_EXPOSURE, value)
        return self.setting

    def grab(self, timeout_s: float = 5.0, check: Check = no_check) -> Image:
        """Give the first image that was exposed after this call.

        An image needs up to one period to be read out, and was exposed for at most one: it must arrive two periods
        after the call.
        """
        if self._end.is_set():
            raise DeviceError(self.name, "closed", "open it again")
        start = time.monotonic()
        with self._news:
            at_call, period_s = self._count, median(self._periods_s)
        pixels, arrived = self._wait(
            lambda: (
                self._latest is not None and self._count >= at_call + 2 and self._latest[1] - start >= 1.95 * period_s
            ),
            timeout_s,
            check,
        )
        return Image(pixels, self.bits, max(start, arrived - period_s))

    def close(self) -> None:
        """Let the device go; a driver that hangs is left behind."""
        if not self._end.is_set():
            self._end.set()
            self._thread.join(2.0)
            if not self._thread.is_alive():
                self._capture.release()

    def _set_up(
        self, width: int, height: int, exposure: float | None, gain: float | None, gamma: float | None, fourcc: str
    ) -> None:
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if fourcc:
            code = cv2.VideoWriter.fourcc(*fourcc.ljust(4)[:4])
            self._wanted("format", cv2.CAP_PROP_FOURCC, float(code), _fourcc_text)
            if fourcc.strip() in ("Y16", "GREY"):
                self._capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
        for what, side in (("width", width), ("height", height)):
            if side:
                self._wanted(what, getattr(cv2, f"CAP_PROP_FRAME_{what.upper()}"), float(side))
        self._by_hand()
        settings = (("exposure", exposure), ("gain", gain), ("gamma", gamma))
        keys = {what: getattr(cv2, f"CAP_PROP_{what.upper()}") for what, _ in settings}
        for what, value in settings:
            if value is not None:
                self._wanted(what, keys[what], value)
        self.note(self.name, "found " + ", ".join(f"{what} {self._capture.get(key):g}" for what, key in keys.items()))

    def _by_hand(self) -> None:
        """Switch off what the camera would change from frame to frame: its light, its colours' shares, its lens."""
        for what, key, values, on in (
            ("exposure", cv2.CAP_PROP_AUTO_EXPOSURE, MANUAL, AUTOMATIC),
            ("white balance", cv2.CAP_PROP_AUTO_WB, (0.0,), (1.0,)),
            ("focus", cv2.CAP_PROP_AUTOFOCUS, (0.0,), (1.0,)),
        ):
            for value in values:
                self._capture.set(key, value)
                if self._capture.get(key) not in on:
                    break
            else:
                raise DeviceError(self.name, f"automatic {what} stays on", "switch it off by the camera's own program")

    def _wanted(self, what: str, key: int, value: float, text: Callable[[float], str] = "{:g}".format) -> None:
        """Set something and read it back."""
        self._capture.set(key, value)
        found = float(self._capture.get(key))
        if abs(found - value) > SAME * max(abs(value), 1e-9):
            raise DeviceError(
                self.name,
                f"{what} {text(value)} was wanted and {text(found)} is set",
                f"choose a {what} that the camera offers",
            )

    def _run(self) -> None:
        """Take every image off as it comes."""
        before = time.monotonic()
        while not self._end.is_set():
            taken, frame = self._capture.read()
            now = time.monotonic()
            with self._news:
                if taken and frame is not None:
                    self._periods_s.append(now - before)
                    self._latest, self._count, self._failures = (_grey(frame), now), self._count + 1, 0
                else:
                    self._failures += 1
                self._news.notify_all()
            before = now
            if not taken:
                self._end.wait(0.01)

    def _wait(self, ready: Callable[[], bool], timeout_s: float, check: Check = no_check) -> tuple[Pixels, float]:
        end = time.monotonic() + timeout_s
        while (rest := end - time.monotonic()) > 0:
            check()
            with self._news:
                if self._news.wait_for(ready, min(rest, GRAIN_S)) and self._latest is not None:
                    return self._latest
        why = f", {self._failures} failed reads" if self._failures else ""
        raise DeviceError(self.name, f"no image within {timeout_s:g} s{why}", "check the camera's cable and its light")


def _grey(frame: Pixels) -> Pixels:
    """Make one channel of what OpenCV delivers."""
    if frame.ndim == 2:
        return np.ascontiguousarray(frame)
    if frame.shape[2] == 3:
        return np.asarray(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY))
    return np.ascontiguousarray(frame[..., 0])  # YUYV and the like: the first channel is the luminance


def _fourcc_text(value: float) -> str:
    return repr("".join(chr((int(value) >> 8 * k) & 0xFF) for k in range(4)).strip())
