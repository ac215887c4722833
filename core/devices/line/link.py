"""A serial line that always comes back within a bounded time; which ports there are, and HID reports as such a line.

pyserial tells of a lost line in many ways: `SerialException` from reading and writing, `OSError` from asking,
`termios.error` from flushing, `TypeError` from a port closed meanwhile. Here all of them are one error.
"""

from __future__ import annotations

import os
import select
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from core.devices.line.profile import Port
from core.devices.protocol import Check, no_check, wait_until
from core.errors import DeviceError, InputError

_WRITE_S = 2.0
_WORDS = {  # pyserial's, in part, of the various systems: what they mean to whoever looks at the cable
    "returned no data": "it was unplugged, or another program reads from it",
    "ClearCommError": "it was unplugged",
    "OverlappedResult": "it was unplugged",
    "WriteFile failed": "it was unplugged",
    "ReadFile failed": "it was unplugged",
    "disconnected": "the other end has closed the connection",
    "port that is not open": "it was closed meanwhile",
    "Write timeout": "the other end takes no more bytes",
    "lock port": "another program uses it",
}
_GRAIN_S = 0.01  # of waiting for a byte
REPORT = 64  # bytes; a write begins with the report's number, which is 0 where a device has only one
Identity = tuple[int, int, str]  # vendor, product and serial number of a USB device

_BY_ID = Path("/dev/serial/by-id")


def identity_of(place: str) -> Identity | None:
    """Give what tells a port's device from all others; None for a port that has no such thing."""
    real = os.path.realpath(place)
    return next((_identity(port) for port in _ports() if os.path.realpath(port.device) == real), None)


def find_again(identity: Identity) -> str | None:
    """Give the name that a device has now; None while it is away."""
    return next((str(port.device) for port in _ports() if _identity(port) == identity), None)


def opening_remedy(place: str) -> str:
    """Say what to do about a port that does not open."""
    if os.path.exists(place) and not os.access(place, os.R_OK | os.W_OK):
        if (group := _group(place)) is None:
            return "ask the owner of this computer for the right to use it"
        if os.stat(place).st_mode & 0o060 != 0o060:  # as HID devices are
            once = f"`sudo setfacl -m u:$USER:rw {place}`"
            return f"its group may not use it either: {once} until it is plugged in again, a udev rule for good"
        return f"it belongs to the group {group}: `sudo usermod -aG {group} $USER`, then log in again"
    if not os.path.exists(place) and (there := proposals()):
        return f"use one that is there: {', '.join(there)}"
    return "check cable and port name, and that no other program uses the port"


def proposals() -> list[str]:
    """Name the ports that are there, by names that stay the same where the system gives such."""
    stable = sorted(str(path) for path in _BY_ID.iterdir()) if _BY_ID.is_dir() else []
    return stable or sorted(str(port.device) for port in _ports() if _identity(port) is not None)


def _group(place: str) -> str | None:
    try:
        import grp
    except ImportError:  # Windows knows no groups of files
        return None
    try:
        return grp.getgrgid(os.stat(place).st_gid).gr_name
    except (KeyError, OSError):
        return None


def _ports() -> list[Any]:
    from serial.tools import list_ports

    return list(list_ports.comports())


def _identity(port: Any) -> Identity | None:
    return (port.vid, port.pid, port.serial_number) if port.vid is not None and port.serial_number else None


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


class LineDownError(DeviceError):
    """The line is gone; opening it anew may help."""


class Link:
    """An open serial line: ``/dev/ttyUSB0``, ``COM3``, ``/dev/hidraw0``, ``socket://host:port``, ``rfc2217://...``.

    With the `identity` of a device that was there before, the port is opened that has it now, under whatever name;
    `place` says which.
    """

    def __init__(self, url: str, port: Port, identity: Identity | None = None) -> None:
        self.url = url
        serial = _pyserial()
        if url.startswith(("socket:", "rfc2217:")):  # others have no port after a colon
            _check_place(url)
        self.place = find_again(identity) or url if identity is not None else url
        self._remedy = "check cable and port name, and that no other program uses the port"
        with self._wrapped("cannot be opened"):
            options: dict[str, Any] = {
                "baudrate": port.baud,
                "bytesize": port.bits,
                "parity": port.parity[0].upper(),
                "stopbits": port.stop,
                "rtscts": port.flow == "rtscts",
                "xonxoff": port.flow == "xonxoff",
                "dsrdtr": port.flow == "dsrdtr",
                "timeout": _GRAIN_S,
                "write_timeout": _WRITE_S,
            }
            if "://" not in url:
                options["exclusive"] = True  # keeps a second program from speaking in between
                self._remedy = opening_remedy(self.place)
            self._port: Any = None
            if is_hid(self.place):
                self._port = HidPort(self.place, _GRAIN_S)
            else:
                self._port = serial.serial_for_url(self.place, do_not_open=True, **options)
                self._port.dtr, self._port.rts = port.dtr, port.rts  # an edge of these resets some devices
                self._port.open()
        self._ready_s, self._byte_s = time.monotonic() + port.open_s, port.byte_s
        self._remedy = "check the cable"
        self.identity = identity_of(self.place) or identity

    def send(self, data: bytes, check: Check = no_check) -> None:
        """Send bytes, one by one where the device is slow, otherwise within `_WRITE_S`."""
        wait_until(self._ready_s, check)
        for at in range(0, len(data), size := 1 if self._byte_s else max(len(data), 1)):
            with self._wrapped("does not take bytes"):
                self._write(data[at : at + size], check)
            wait_until(time.monotonic() + self._byte_s, check)

    def _write(self, data: bytes, check: Check) -> None:
        """Send bytes as the line takes them; `check` is called while the other end holds it."""
        if os.name == "nt" or is_hid(self.place) or "://" in self.place:
            self._port.write(data)
            return
        number, end = self._port.fileno(), time.monotonic() + _WRITE_S
        while data:
            check()
            if select.select([], [number], [], _GRAIN_S)[1]:
                with suppress(BlockingIOError):
                    data = data[os.write(number, data) :]
            elif time.monotonic() > end:
                raise TimeoutError(0, "Write timeout")

    def receive(self, until_s: float, check: Check = no_check) -> bytes:
        """Give what has arrived, waiting for it until a moment of `time.monotonic`; empty if nothing came.

        `check` is called every `_GRAIN_S` while nothing comes.
        """
        with self._wrapped("does not deliver bytes"):
            while True:
                check()
                data = self._port.read(1)
                if data:
                    return bytes(data + self._port.read(self._port.in_waiting))
                if time.monotonic() >= until_s:
                    return b""

    def drain(self, quiet_s: float, check: Check = no_check) -> int:
        """Throw away what arrives until nothing has come for a while, at most ten times as long; count the bytes."""
        wait_until(self._ready_s, check)
        count, end = 0, time.monotonic() + 10 * quiet_s
        while time.monotonic() < end:
            data = self.receive(time.monotonic() + quiet_s, check)
            if not data:
                break
            count += len(data)
        return count

    def close(self) -> None:
        """Close, whatever state the line is in."""
        connection = getattr(self._port, "_socket", None)  # pyserial forgets it when the other end has gone first
        try:
            self._port.close()
        except Exception:  # a line that is gone may fail here in any way, and it is gone
            return
        finally:
            if connection is not None:
                connection.close()

    @contextmanager
    def _wrapped(self, what: str) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError, TypeError, AttributeError, _termios_error()) as error:
            raise LineDownError(self.url, f"the line {what} ({_why(error)})", self._remedy) from error


def _check_place(url: str) -> None:
    """See that the address of another computer has a port."""
    try:
        seen = "" if urlsplit(url).port else "no port"
    except ValueError as error:
        seen = str(error)
    if seen:
        raise InputError(url, seen, "give the port that the other end listens at, as in socket://HOST:4352")


def _why(error: BaseException) -> str:
    """Say why a line failed in words of the system or our own."""
    if plain := next((plain for words, plain in _WORDS.items() if words in str(error)), None):
        return plain
    if number := getattr(error, "errno", None):  # pyserial says it twice
        return os.strerror(number)
    cause = error.__cause__ or error.__context__  # and of some it wraps the words alone
    return _why(cause) if isinstance(cause, OSError) else str(error)


def _pyserial() -> Any:
    try:
        import serial
    except ImportError as error:
        raise DeviceError(
            "serial port", "the package pyserial is missing", "install it: pip install pyserial"
        ) from error
    return serial


def _termios_error() -> type[Exception]:
    try:
        import termios
    except ImportError:  # no termios on Windows, and so no such error
        return OSError
    return termios.error
