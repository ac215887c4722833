"""Devices at the other end of a pseudo-terminal, written from what is public: nothing of the program is imported.

optoma      RS232 Protocol Function List of the HD66, ES515 and Pro160S
modbus      MODBUS Application Protocol V1.1b3, MODBUS over Serial Line V1.02 (CRC of its appendix B)
dlpc350     TI's published programs, passages of DLPU010; the bridge SC18IM700 from memory of its data sheet
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
from typing import ClassVar


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
    """Reports of 64 bytes, after the report's number where `numbered`.

    Lists open only through their mailbox, and nothing is changed while patterns are shown. `shown` are image and bit
    plane of every pattern, `pulses` the times of trigger output 1 in us; what is not known to be in the buffer is None.
    """

    def __init__(self, numbered: bool = False) -> None:
        super().__init__()
        self.numbered = numbered
        self.state: dict[int, bytes] = {}  # by command, what was written last
        self.running = self.mailbox = self.waits = self.validated = 0
        self.images, self.patterns = dict[int, int](), dict[int, int]()  # by place
        self.buffer: int | None = None
        self.shown, self.pulses, self.waiting = list[tuple[int | None, int]](), list[int](), list[int]()

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

    LENGTHS: ClassVar = {0x1A1B: 1, 0x1A1D: 3, 0x1A22: 1, 0x1A23: 1, 0x1A29: 8, 0x1A31: 4, 0x1A32: 1, 0x1A33: 1}

    def command(self, number: int, data: bytes, read: bool) -> bytes:
        if read:
            if number != 0x1A1A:
                raise ValueError
            self.waits -= 1
            return bytes([0x80 if self.waits > 0 else self.faults()])
        if number == 0x1A24:
            self.running = data[0]
            if data[0] == 2:
                self.start()
        elif self.running:
            raise ValueError  # patterns that are shown have to be stopped first
        elif number == 0x1A34:
            self.write(data)
        elif number == 0x1A1A:
            self.waits, self.validated = 3, 1
            return b""
        elif len(data) != self.LENGTHS.get(number, -1):
            raise ValueError
        self.state[number] = data
        if number != 0x1A24:
            self.validated = 0
        return b""

    def write(self, data: bytes) -> None:
        """Write entries into the open list, from the offset on."""
        place, box = self.state[0x1A32][0], self.state[0x1A33][0]
        if box == 1 and place + len(data) <= 64:
            self.images.update(enumerate(data, place))
        elif box == 2 and len(data) % 3 == 0 and place + len(data) // 3 <= 128:
            words = (int.from_bytes(data[i : i + 3], "little") for i in range(0, len(data), 3))
            self.patterns.update(enumerate(words, place))
        else:
            raise ValueError

    def faults(self) -> int:
        """Give the bits of the validation: times, pattern numbers, ..., too little time between exposures."""
        exposure, period = struct.unpack("<II", self.state[0x1A29])
        entries, _, _, images = self.state[0x1A31]
        listed = [self.patterns.get(i) for i in range(entries + 1)]
        there = all(i in self.images for i in range(images + 1))
        numbers = all(w is not None and w >> 2 & 0x3F < 24 and w >> 8 & 15 == 1 for w in listed)
        wrong = exposure < 235 or exposure > period or period < 235
        return wrong | (not (there and numbers)) << 1 | (0 < period - exposure < 230) << 4

    def start(self) -> None:
        """Show the list: at once by its own clock, or entry by entry at `trigger`."""
        modes = [self.state.get(n, b"\xff")[0] for n in (0x1A1B, 0x1A22, 0x1A23)]
        if modes != [1, 3, 1] or not self.validated or self.faults() & 3:
            raise ValueError
        entries, again, shown, images = self.state[0x1A31]
        order = [self.images[i] for i in range(images + 1)]
        self.order = order[::-1] if len(order) == 2 else order  # as TI's own library writes two of them
        self.waiting, self.shown, self.pulses = list(range(entries + 1 if again else min(entries, shown) + 1)), [], []
        _, period = struct.unpack("<II", self.state[0x1A29])
        while self.waiting and self.patterns[self.waiting[0]] & 3 == 0:
            self.advance(period * len(self.shown))
        if again:
            self.order = self.order * 2

    def trigger(self, at_us: int) -> None:
        """A rising edge on trigger input 1."""
        if self.running == 2 and self.waiting:
            self.advance(at_us)

    def advance(self, at_us: int) -> None:
        word = self.patterns[self.waiting.pop(0)]
        if word >> 18 & 1:
            self.buffer = self.order.pop(0)
        self.shown.append((self.buffer, word >> 2 & 0x3F))
        self.pulses.append(at_us)


class Dlpc350OverI2c(Dlpc350):
    """The same behind an SC18IM700: 'S' address count bytes ... 'P' is a message, 'R' register 'P' asks the bridge."""

    COMMANDS: ClassVar = {0x69: 0x1B, 0x6A: 0x1D, 0x6F: 0x22, 0x70: 0x23, 0x65: 0x24, 0x66: 0x29}
    COMMANDS |= {0x75: 0x31, 0x76: 0x32, 0x77: 0x33, 0x78: 0x34, 0x7D: 0x1A}

    def __init__(self) -> None:
        super().__init__()
        self.status, self.pointer = 0xF0, 0

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while len(buffer) >= 3:
            if buffer[0] == ord("R") and buffer[2] == ord("P"):
                yield bytes([self.status if buffer[1] == 0x0A else 0])
                del buffer[:3]
            elif buffer[0] == ord("S") and buffer[1] & 1 and len(buffer) >= 4 and buffer[3] == ord("P"):
                self.status = 0xF0 if buffer[1] == 0x35 else 0xF1
                yield self.command(0x1A00 | self.COMMANDS[self.pointer], b"", True)
                del buffer[:4]
            elif buffer[0] == ord("S") and not buffer[1] & 1:
                if len(buffer) < 4 + buffer[2]:
                    return
                self.message(buffer[1], bytes(buffer[3 : 3 + buffer[2]]))
                assert buffer[3 + buffer[2]] == ord("P")
                del buffer[: 4 + buffer[2]]
            else:
                return

    def message(self, address: int, data: bytes) -> None:
        self.pointer, self.status = data[0] & 0x7F, 0xF0
        if address != 0x34:
            self.status = 0xF1
        elif data[0] & 0x80:
            try:
                self.command(0x1A00 | self.COMMANDS[self.pointer], data[1:], False)
            except (ValueError, KeyError):
                self.status = 0xF2


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
