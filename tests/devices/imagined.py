"""Three controllers that do not exist, each by a terse manual, which err; nothing of the program is imported.

window    Normally white LCD of 64 lines, one plate, line 63 at the left. 9600 8N1, echo, prompt ``>``.
          ``W nn oo hh…`` writes up to 3 bytes from offset oo of page nn (hex, from 01; highest bit first; 1 = dark) and
          answers with the one's complement of their 8-bit sum; ``D nn`` displays a page. ``E1`` bad, ``E2`` empty.
fringer   Frames 7E … 7E; 7E and 7D as 7D 5E and 7D 5D; CRC-16/X-25, low byte first, over the content: sequence number,
          command, data. 10 axis bit bits inverse: Gray code; 11 axis period*16 (u16le) shift (u24le, millidegrees):
          sine; 12 level: whole field. It acknowledges with the number and 06, and tells with the number and 0A when
          the light has changed. 15: damaged.
stepper   Starts anew when the port is opened: half a second, then a line of greeting. ``N`` next pattern, ``H`` first,
          ``?`` position; answers ``=nn``, decimal, from 1. Its patterns are stored.
"""

from __future__ import annotations

import math
import os
import pty
import random
import select
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

LINES = 64
Shine = Callable[[list[float], list[float]], None]  # light of columns and of rows


class Errors:
    """How often answers and commands are lost, late or damaged."""

    def __init__(self, rate: float, seed: int) -> None:
        self.rate, self.random, self.counts = rate, random.Random(seed), dict[str, int]()

    def pick(self) -> str:
        """Name what goes wrong now, or nothing."""
        if self.random.random() >= self.rate:
            return ""
        found = self.random.choice(["lost command", "lost answer", "late", "garbled", "lost byte", "unplugged"])
        self.counts[found] = self.counts.get(found, 0) + 1
        return found


class Imagined:
    """Bytes in; bytes out with the seconds after which they come."""

    late_s = 0.25

    def __init__(self, shine: Shine) -> None:
        self.shine = shine

    def opened(self) -> list[tuple[float, bytes]]:
        """What it does when the port is opened."""
        return []

    def next_message(self, buffer: bytearray) -> bytes | None:
        """Take the next whole message out."""
        raise NotImplementedError

    def answer(self, message: bytes) -> list[tuple[float, bytes]]:
        """Carry it out."""
        raise NotImplementedError


class Window(Imagined):
    def __init__(self, shine: Shine) -> None:
        super().__init__(shine)
        self.pages = dict[int, bytearray]()

    def next_message(self, buffer: bytearray) -> bytes | None:
        end = buffer.find(b"\r")
        if end < 0:
            return None
        line = bytes(buffer[: end + 1])
        del buffer[: end + 1]
        return line

    def answer(self, message: bytes) -> list[tuple[float, bytes]]:
        words = message[:-1].decode("ascii", "replace").split(" ")
        told = b"E1"
        with suppress(ValueError):
            if words[0] == "W" and len(words) == 4:
                page, offset, data = int(words[1], 16), int(words[2], 16), bytes.fromhex(words[3])
                if len(data) <= 3 and offset + len(data) <= 8:
                    self.pages.setdefault(page, bytearray(8))[offset : offset + len(data)] = data
                    told = b"%02X" % (~sum(data) & 0xFF)
            elif words[0] == "D" and len(words) == 2:
                told = b"E2"
                if page := self.pages.get(int(words[1], 16)):
                    bits = "".join(f"{b:08b}" for b in page)
                    self.shine([1.0 - int(b) for b in bits[::-1]], [0.0] * LINES)
                    told = b"D" + words[1].encode()
        return [(0.0, message + told + b"\r\n> ")]


def crc_x25(data: bytes) -> bytes:
    value = 0xFFFF
    for byte in data:
        for k in range(8):
            mixed = (value ^ byte >> k) & 1
            value = value >> 1 ^ (0x8408 if mixed else 0)
    return (value ^ 0xFFFF).to_bytes(2, "little")


class Fringer(Imagined):
    def next_message(self, buffer: bytearray) -> bytes | None:
        while buffer and buffer[0] != 0x7E:
            del buffer[0]
        end = buffer.find(b"\x7e", 1)
        if end < 0:
            return None
        if end == 1:
            del buffer[0]
            return self.next_message(buffer)
        message = bytes(buffer[: end + 1])
        del buffer[: end + 1]
        return message

    def frame(self, content: bytes) -> bytes:
        content += crc_x25(content)
        return b"\x7e" + content.replace(b"\x7d", b"\x7d\x5d").replace(b"\x7e", b"\x7d\x5e") + b"\x7e"

    def answer(self, message: bytes) -> list[tuple[float, bytes]]:
        content = message[1:-1].replace(b"\x7d\x5e", b"\x7e").replace(b"\x7d\x5d", b"\x7d")
        if len(content) < 4 or crc_x25(content[:-2]) != content[-2:]:
            return [(0.0, self.frame(content[:1] + b"\x15"))]
        number, command, data = content[0], content[1], content[2:-2]
        light, axis = [0.0] * LINES, 0
        if command == 0x10:
            axis, bit, bits, inverse = data
            codes = [i * 2**bits // LINES for i in range(LINES)]
            light = [float((k ^ k >> 1) >> (bits - 1 - bit) & 1 ^ inverse) for k in codes]
        elif command == 0x11:
            axis, period = data[0], int.from_bytes(data[1:3], "little") / 16
            shift = math.radians(int.from_bytes(data[3:6], "little") / 1000)
            light = [0.5 + 0.5 * math.cos(2 * math.pi * (i + 0.5) / period - shift) for i in range(LINES)]
        elif command == 0x12:
            light = [data[0] / 255] * LINES
        else:
            return [(0.0, self.frame(bytes([number, 0x15])))]
        dark = [0.0] * LINES
        self.shine(*((light, dark) if axis == 0 else (dark, light)))
        return [(0.0, self.frame(bytes([number, 0x06]))), (0.01, self.frame(bytes([number, 0x0A])))]


class Stepper(Imagined):
    def __init__(self, shine: Shine, stored: list[tuple[list[float], list[float]]]) -> None:
        super().__init__(shine)
        self.stored, self.at, self.ready_s = stored, 0, 0.0

    def opened(self) -> list[tuple[float, bytes]]:
        self.at, self.ready_s = 0, time.monotonic() + 0.5
        return [(0.5, b"STEPPER 1.0 READY\r\n")]

    next_message = Window.next_message

    def answer(self, message: bytes) -> list[tuple[float, bytes]]:
        if time.monotonic() < self.ready_s:
            return []
        word = message[:-1]
        if word == b"N":
            self.at += 1
        elif word == b"H":
            self.at = 1
        if word not in (b"N", b"H", b"?") or not 0 <= self.at <= len(self.stored):
            return [(0.0, b"!\r\n")]
        if word != b"?":
            self.shine(*self.stored[self.at - 1])
        return [(0.0, b"=%02d\r\n" % self.at)]


@contextmanager
def plugged(device: Imagined, errors: Errors, folder: Path) -> Iterator[str]:
    """Put a device on a pseudo-terminal under a name that outlasts being unplugged."""
    name, end, ends = folder / "port", threading.Event(), list[int]()

    def plug() -> None:
        ours, theirs = pty.openpty()
        tty.setraw(theirs)
        name.unlink(missing_ok=True)
        name.symlink_to(os.ttyname(theirs))
        os.close(theirs)  # so that we see when somebody opens it
        ends[:] = [ours]

    def serve() -> None:
        buffer, waiting, open_before = bytearray(), list[tuple[float, bytes]](), False
        while not end.is_set():
            now = time.monotonic()
            for item in sorted(w for w in waiting if w[0] <= now):
                waiting.remove(item)
                os.write(ends[0], item[1])
            poll = select.poll()
            poll.register(ends[0], select.POLLIN)
            seen = dict(poll.poll(2)).get(ends[0], 0)
            if seen & select.POLLHUP:
                open_before = False
                time.sleep(0.002)
                continue
            if not open_before:
                waiting += [(now + wait, data) for wait, data in device.opened()]
                open_before = True
            if not seen:
                continue
            buffer += os.read(ends[0], 4096)
            while (message := device.next_message(buffer)) is not None:
                fault = errors.pick()
                if fault == "unplugged":
                    for port in ends:
                        os.close(port)
                    name.unlink()
                    time.sleep(0.1)
                    plug()
                    buffer.clear()
                    waiting.clear()
                    open_before = False
                    break
                if fault == "lost command":
                    continue
                if fault == "lost byte":
                    message = message[:2] + message[3:]
                for wait, data in device.answer(message):
                    if fault == "garbled":
                        place = errors.random.randrange(len(data))
                        data = data[:place] + bytes([data[place] ^ 1 << errors.random.randrange(8)]) + data[place + 1 :]
                    if fault != "lost answer":
                        waiting.append((time.monotonic() + wait + (device.late_s if fault == "late" else 0.0), data))

    plug()
    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield str(name)
    finally:
        end.set()
        thread.join()
        for port in ends:
            os.close(port)
