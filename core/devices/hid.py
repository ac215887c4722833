"""Reports of a HID device of Linux (/dev/hidraw0) as a port of bytes, with the part of pyserial's port that is used."""

from __future__ import annotations

import os
import select

REPORT = 64  # bytes; a write begins with the report's number, which is 0 where a device has only one


def is_hid(place: str) -> bool:
    """Whether a port's name is that of a HID device."""
    return place.startswith("/dev/hidraw")


class HidPort:
    """A HID device."""

    def __init__(self, place: str, wait_s: float) -> None:
        self.wait_s = wait_s
        self.in_waiting = 0
        self._file = os.open(place, os.O_RDWR | getattr(os, "O_NONBLOCK", 0))
        self._read = b""

    def write(self, data: bytes) -> None:
        """Send bytes, a report at a time."""
        for at in range(0, len(data), REPORT):
            os.write(self._file, b"\0" + data[at : at + REPORT].ljust(REPORT, b"\0"))

    def read(self, count: int) -> bytes:
        """Give up to `count` bytes, waiting a moment for the first."""
        if count and not self._read and select.select([self._file], [], [], self.wait_s)[0]:
            self._read = os.read(self._file, REPORT)
        data, self._read = self._read[:count], self._read[count:]
        self.in_waiting = len(self._read)
        return data

    def close(self) -> None:
        os.close(self._file)
