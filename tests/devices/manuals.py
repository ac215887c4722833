"""Devices at the other end of a pseudo-terminal, written from their manuals alone: nothing of the program is imported.

optoma      RS232 Protocol Function List of the HD66, ES515 and Pro160S
modbus      MODBUS Application Protocol V1.1b3, MODBUS over Serial Line V1.02 (CRC of its appendix B)
dlpc350     DLPC350 Programmer's Guide, DLPU010
prompting   a controller with an echo, a prompt, numbers from 1 in three digits, and a checksum in hexadecimal
"""

from __future__ import annotations

import os
import pty
import select
import struct
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Device:
    """Bytes in, bytes out, over a pseudo-terminal, in a thread of its own."""

    gap_s = 0.05  # silence after which an incomplete message is forgotten

    def __init__(self) -> None:
        self.heard = bytearray()
        self.spoil: Callable[[bytes], bytes] = lambda data: data

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        """Take whole messages out of the buffer and give the answers."""
        raise NotImplementedError


@contextmanager
def plugged(device: Device) -> Iterator[str]:
    """Put a device on a pseudo-terminal; give the name of the host's end."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    end = threading.Event()

    def serve() -> None:
        buffer = bytearray()
        while not end.is_set():
            ready, _, _ = select.select([ours], [], [], 0.005)
            if not ready:
                continue
            data = os.read(ours, 4096)
            device.heard += data
            buffer += data
            for answer in device.take(buffer):
                os.write(ours, device.spoil(answer))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        end.set()
        thread.join()
        os.close(ours)
        os.close(theirs)


class Optoma(Device):
    """Standby first; after power-on it warms up for some questions, and says INFO1 unasked."""

    def __init__(self, warming: int = 2) -> None:
        super().__init__()
        self.on, self.warming, self.commands = 0, warming, []

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while (end := buffer.find(b"\r")) >= 0:
            line = bytes(buffer[:end]).decode()
            del buffer[: end + 1]
            self.commands.append(line)
            yield self.answer(line)

    def answer(self, line: str) -> bytes:
        lead, number, space, value = line[:1], line[1:3], line.find(" "), line.rpartition(" ")[2]
        if lead != "~" or not number.isdigit() or space < 0:
            return b"F\r"
        command = int(line[3:space])
        if command == 0:  # power
            self.on = int(value == "1")
            return b"P\rINFO1\r" if self.on else b"P\rINFO2\r"
        if command == 124:  # power state
            if self.on and self.warming:
                self.warming -= 1
                return b"OK0\r"
            return b"OK%d\r" % self.on
        if command == 151:
            return b"OK1\r"
        return b"P\r" if command in (2, 4, 12) and self.on and not self.warming else b"F\r"


def modbus_crc(data: bytes) -> bytes:
    """Compute the CRC of the serial line's guide: A001 shifted right, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc, carry = crc >> 1, crc & 1
            crc ^= 0xA001 * carry
    return struct.pack("<H", crc)


class Modbus(Device):
    """Slave 1 with a lamp coil, a warm input, a pattern register and one that is busy for some questions."""

    def __init__(self, patterns: int, warming: int = 2) -> None:
        super().__init__()
        self.patterns, self.warming, self.lamp, self.shown, self.busy = patterns, warming, False, 0, 0

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while len(buffer) >= 8:  # every request used here has eight bytes
            request, crc = bytes(buffer[:6]), bytes(buffer[6:8])
            if modbus_crc(request) != crc:
                del buffer[:1]
                continue
            del buffer[:8]
            if request[0] == 1:
                answer = self.answer(request[1], *struct.unpack(">HH", request[2:]))
                yield answer + modbus_crc(answer)

    def answer(self, function: int, address: int, value: int) -> bytes:
        def exception(code: int) -> bytes:
            return bytes([1, function | 0x80, code])

        echo = struct.pack(">BBHH", 1, function, address, value)
        if function == 5 and address == 0 and value in (0, 0xFF00):
            self.lamp = value == 0xFF00
            return echo
        if function == 2 and address == 0:
            warm = self.lamp and self.warming == 0
            self.warming = max(0, self.warming - 1)
            return bytes([1, 2, 1, int(warm)])
        if function == 6 and address == 16:
            if not 1 <= value <= self.patterns:
                return exception(3)  # illegal data value
            self.shown, self.busy = value, 2
            return echo
        if function == 3 and address == 17 and value == 1:
            self.busy = max(0, self.busy - 1)
            return bytes([1, 3, 2]) + struct.pack(">H", self.busy)
        return exception(1 if function not in (2, 3, 5, 6) else 2)


class Dlpc350(Device):
    """Reports of 64 bytes, after the report's number where `numbered`; tables open only through their mailbox."""

    def __init__(self, numbered: bool = False) -> None:
        super().__init__()
        self.numbered = numbered
        self.mode = self.source = self.running = 0
        self.mailbox, self.images, self.table, self.valid, self.waits = 0, [], [], False, 0
        self.shown: tuple[int, int] | None = None  # image, bit plane

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        size = 64 + self.numbered
        while len(buffer) >= size:
            report = bytes(buffer[self.numbered : size])
            del buffer[:size]
            flags, sequence, length = struct.unpack("<BBH", report[:4])
            payload = report[4 : 4 + length]
            try:
                data, error = self.command(payload[1] << 8 | payload[0], payload[2:], bool(flags & 0x80)), 0
            except ValueError:
                data, error = b"", 0x20
            if flags & 0x40:
                yield (struct.pack("<BBH", flags | error, sequence, len(data)) + data).ljust(64, b"\0")

    def command(self, number: int, data: bytes, read: bool) -> bytes:
        if read:
            if number != 0x1A1A:
                raise ValueError
            self.waits -= 1
            wrong = 0 if self.images and self.table and all(t >> 2 < 24 for t in self.table) else 2
            self.valid = self.waits <= 0 and not wrong
            return bytes([0x80 if self.waits > 0 else wrong])
        if number == 0x1A1B:
            self.mode = data[0]
        elif number == 0x1A24:
            if data[0] == 2 and not (self.mode == 1 and self.source == 3 and self.valid):
                raise ValueError
            self.running = data[0]
            self.shown = (self.images[0], self.table[0] >> 2) if data[0] == 2 else None
        elif self.running:
            raise ValueError  # a sequence that runs has to be stopped first
        elif number == 0x1A22:
            self.source = data[0]
        elif number == 0x1A33:
            self.mailbox = data[0]
        elif number == 0x1A34:
            if self.mailbox == 1:
                self.images = list(data)
            elif self.mailbox == 2 and len(data) % 3 == 0 and data[1] & 15 == 1:
                self.table = list(data[::3])
            else:
                raise ValueError
            self.valid = False
        elif number == 0x1A1A:
            self.waits, self.valid = 3, False
        elif number not in (0x1A23, 0x1A29, 0x1A31, 0x1A32):
            raise ValueError
        return b""


class Prompting(Device):
    """Lines as ``$L007 X F0F0*5C``: slots from 001, lines along X alone, the sum of the bytes between $ and * in hex.

    It repeats what it is sent, answers ``$A007*..`` and then prompts; without the prompt it is not ready.
    """

    def __init__(self) -> None:
        super().__init__()
        self.slots: dict[int, bytes] = {}
        self.shown = 0

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while (end := buffer.find(b"\r")) >= 0:
            line = bytes(buffer[:end])
            del buffer[: end + 1]
            body, _, check = line[1:].partition(b"*")
            if line[:1] != b"$" or int(check or b"0", 16) != sum(body) & 0xFF:
                continue
            number = int(body[1:4])
            if body[:1] == b"L":
                self.slots[number] = bytes.fromhex(body[6:].decode())
            elif number in self.slots:
                self.shown = number
            answer = b"A%03d" % number
            yield line + b"\r\n$" + answer + b"*%02X\r\n" % (sum(answer) & 0xFF) + b"> "
