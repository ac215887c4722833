"""A serial line that always comes back within a bounded time.

pyserial tells of a lost line in many ways: `SerialException` from reading and writing, `OSError` from asking,
`termios.error` from flushing, `TypeError` from a port closed meanwhile. Here all of them are one error.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from core.devices.hid import HidPort, is_hid
from core.devices.ports import Identity, find_again, identity_of, opening_remedy
from core.devices.profile import Port
from core.devices.protocol import Check, no_check, wait_until
from core.errors import DeviceError

_WRITE_S = 2.0
_GRAIN_S = 0.01  # of waiting for a byte


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
                self._port.write(data[at : at + size])
            wait_until(time.monotonic() + self._byte_s, check)

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
            raise LineDownError(self.url, f"the line {what} ({error})", self._remedy) from error


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
