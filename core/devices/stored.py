"""Images that are files: a replayed capture, and a folder that another program fills."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from core.devices.protocol import Check, Image, Pixels, no_check, wait_until
from core.devices.scene import Lines
from core.errors import DeviceError, InputError, PatternRefusedError
from core.patterns import Pattern
from core.project import find_project, read_capture, read_image, read_project

_QUIET_S = 0.05  # a file is complete when its size has not changed for so long and it can be read
_ENDINGS = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp")


class ReplayScene:
    """The frames of a capture: lit by a pattern, the scene looks as it did in the frame of that pattern."""

    def __init__(self, folder: Path) -> None:
        capture = read_capture(folder)
        self.folder = folder
        self._frames = {frame.pattern: frame.path for frame in capture.frames}
        self.sequence = tuple(frame.pattern for frame in capture.frames)
        first = read_image(capture.frames[0].path)
        self.camera_size = (first.shape[1], first.shape[0])
        self.bits = 8 * first.dtype.itemsize
        project = find_project(folder)
        if project is None:
            raise InputError(folder, "a capture outside any project", "replay a capture inside its project folder")
        spec = read_project(project).projector
        self.projector_size = (spec.width, spec.height)

    def refusal(self, pattern: Pattern) -> str | None:
        return None if pattern in self._frames else f"the capture {self.folder.name} holds no frame of this pattern"

    def frame(self, pattern: Pattern, seed: int) -> Pixels:
        """Read the frame of a pattern; a pattern that was not captured is refused."""
        path = self._frames.get(pattern)
        if path is None:
            raise PatternRefusedError(self.folder, f"pattern {pattern.kind}", "replay only what was captured")
        return read_image(path)

    def frame_lines(self, columns: Lines, rows: Lines, seed: int) -> Pixels:
        """Refuse: a replay knows patterns only."""
        raise DeviceError(self.folder, "asked for single lines", "replay with a replay projector")


class FolderCamera:
    """Any camera whose program writes its images into a folder: each new file is one image.

    Of a grey value it uses so many `bits`; 0: all that the file has. `latency_s` pass from the exposure until its file
    appears: files that appear sooner after a call were exposed before it.
    """

    def __init__(self, folder: Path, bits: int = 0, latency_s: float = 0.0) -> None:
        if not folder.is_dir():
            raise InputError(folder, "no such folder", "give the folder that the camera's program writes into")
        self.name, self.folder = f"folder camera {folder}", folder
        self._bits, self.latency_s = bits, latency_s
        self.size: tuple[int, int] | None = None
        self._seen = self._list()

    @property
    def bits(self) -> int:
        return self._bits or 8

    def grab(self, timeout_s: float = 5.0, check: Check = no_check) -> Image:
        start = time.monotonic()
        end = start + timeout_s + self.latency_s
        if self.latency_s:
            wait_until(start + self.latency_s, check)
        self._seen |= self._list()
        while time.monotonic() < end:
            check()
            fresh = sorted(self._list() - self._seen)
            if fresh and (pixels := self._read(fresh[0], end)) is not None:
                self._seen.add(fresh[0])
                self.size = pixels.shape[1], pixels.shape[0]
                self._bits = self._bits or 8 * pixels.dtype.itemsize
                return Image(pixels, self._bits, max(start, time.monotonic() - self.latency_s))
            time.sleep(_QUIET_S / 5)
        raise DeviceError(
            self.name, f"no new image within {timeout_s:g} s", "release the camera, or look where its program writes"
        )

    def close(self) -> None:
        """Nothing to let go."""

    def _list(self) -> set[Path]:
        return {p for p in self.folder.iterdir() if p.suffix.lower() in _ENDINGS and not p.name.startswith(".")}

    def _read(self, path: Path, end: float) -> Pixels | None:
        """Read a file that has stopped growing; None if it cannot be read in time."""
        size, since = -1, time.monotonic()
        while time.monotonic() < end:
            try:
                now = path.stat().st_size
            except OSError:
                return None
            if now != size:
                size, since = now, time.monotonic()
            elif now and time.monotonic() - since >= _QUIET_S:
                try:
                    return np.asarray(read_image(path))
                except InputError:
                    since = time.monotonic()  # perhaps not complete yet
            time.sleep(_QUIET_S / 5)
        return None
