"""Presentation projectors and a DLPC900 at the other end of a pseudo-terminal, written from what is public.

Nothing of the program is imported.

epson       ESC/VP21 Command User's Guide for Business Projectors; command list of the EB-Z10005U
nec         RS-232C control commands of NP-UM361X and V260X
panasonic   RS-232C control specifications of PT-D10000; technical information of PT-FX400, PT-RW330: silence
sony        protocol manuals of VPL-CX76, VPL-VW85, VPL-EW130
hitachi     RS-232C communication of LP-WU6600, CP-X807 and ED-X12: their example messages are the test of the CRC
barco       Barco projection protocol, R5905746 (bytes that are converted) and R5976884 (acknowledge, then answer)
pjlink      PJLink class 1, as in the guides of Panasonic's PT-RZ470 and IDK's MSD-501
ricoh       PJ-WX3231N: STX, command, ETX; ACK CR, ACK ESC or NAK
dlpc900     Pycrafter6500: entries of 12 bytes in the table of patterns
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import ClassVar

from tests.devices.manuals import Device, Dlpc350


class Epson(Device):
    """A colon says that it is ready for the next line; while it warms up it is not."""

    def __init__(self, warming: int = 2) -> None:
        super().__init__()
        self.power, self.warming, self.muted, self.commands = 0, warming, True, list[str]()

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while (end := buffer.find(b"\r")) >= 0:
            line = bytes(buffer[:end]).decode("ascii", "replace")
            del buffer[: end + 1]
            self.commands.append(line)
            yield self.answer(line) + b":"

    def answer(self, line: str) -> bytes:
        if line == "PWR ON":
            self.power = 1
        elif line == "PWR OFF":
            self.power = 0
        elif line == "PWR?":
            if self.power and self.warming:
                self.warming -= 1
                return b"PWR=02\r"
            return b"PWR=%02d\r" % self.power
        elif line in ("MUTE ON", "MUTE OFF", "FREEZE OFF") and self.power and not self.warming:
            self.muted = line == "MUTE ON" if "MUTE" in line else self.muted
        elif line:
            return b"ERR\r"
        return b""


class Nec(Device):
    """``02H 00H ID1 ID2 LEN data CKS``; answers begin with 2xH, refusals with AxH and two error codes."""

    IDS = b"\x01\x70"

    def __init__(self) -> None:
        super().__init__()
        self.on, self.muted, self.cooling = False, True, 0

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while len(buffer) >= 6 and len(buffer) >= 6 + buffer[4]:
            size = 6 + buffer[4]
            message, check = bytes(buffer[: size - 1]), buffer[size - 1]
            del buffer[:size]
            if sum(message) & 0xFF == check:
                yield self.answer(message)

    def message(self, first: int, second: int, data: bytes = b"") -> bytes:
        body = bytes([first, second]) + self.IDS + bytes([len(data)]) + data
        return body + bytes([sum(body) & 0xFF])

    def answer(self, message: bytes) -> bytes:
        kind, command, data = message[0], message[1], message[5:]
        if (kind, command, data) == (0x00, 0x85, b"\x01"):  # running status: data 3 is the power
            return self.message(0x20, 0x85, bytes([0, 0, int(self.on), self.cooling]) + bytes(12))
        if kind == 0x02 and command in (0x00, 0x01) and not data:
            self.on = command == 0x00
            return self.message(0x22, command)
        if kind == 0x02 and command in (0x10, 0x11) and not data:
            if not self.on:
                return self.message(0xA2, command, b"\x02\x0d")  # the power is off
            self.muted = command == 0x10
            return self.message(0x22, command)
        return self.message(0xA0 | kind, command, b"\x00\x00")


class Panasonic(Device):
    """``02 ADZZ;command 03``; nothing is answered while the lamp starts, and ER401 says that it cannot be done."""

    def __init__(self, deaf: int = 4, stubborn: int = 2) -> None:
        super().__init__()
        self.on, self.shut, self.deaf, self.stubborn = False, True, deaf, stubborn

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while (end := buffer.find(b"\x03")) >= 0:
            message = bytes(buffer[:end])
            del buffer[: end + 1]
            if self.on and self.deaf:
                self.deaf -= 1
            elif message.startswith(b"\x02ADZZ;"):
                yield b"\x02" + self.answer(message[6:].decode("ascii", "replace")).encode() + b"\x03"

    def answer(self, command: str) -> str:
        if command in ("PON", "POF"):
            self.on = command == "PON"
            return command
        if command == "QPW":
            return f"{self.on:03d}"
        if command in ("OSH:0", "OSH:1"):
            self.stubborn -= bool(self.on and self.stubborn)
            if not self.on or self.stubborn:
                return "ER401"
            self.shut = command == "OSH:1"
            return command
        return "ER401"


class Sony(Device):
    """``A9 item item type data data check 9A``, the check value an OR; a key of the remote control is not answered."""

    ON, PICTURE_MUTING, POWER = b"\x17\x2e", b"\x00\x30", b"\x01\x02"

    def __init__(self, warming: int = 3) -> None:
        super().__init__()
        self.on, self.muted, self.warming = False, True, warming

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while len(buffer) >= 8:
            message = bytes(buffer[:8])
            del buffer[:8]
            item, kind, data = message[1:3], message[3], message[4:6]
            if (message[0], message[7]) != (0xA9, 0x9A):
                yield self.message(b"\xf0\x20", 3)  # framing error
            elif message[6] != message[1] | message[2] | message[3] | message[4] | message[5]:
                yield self.message(b"\xf0\x10", 3)
            elif item == self.ON:
                self.on = True
            elif (item, kind) == (self.POWER, 1):
                yield self.message(self.POWER, 2, self.power())
            elif (item, kind) == (self.PICTURE_MUTING, 0) and self.on and not self.warming:
                self.muted = data == b"\x00\x01"
                yield self.message(b"\x00\x00", 3)
            else:
                yield self.message(b"\x01\x0a", 3)  # not applicable

    def power(self) -> bytes:
        """Standby, starting, starting its lamp, on."""
        if not self.on:
            return b"\x00\x00"
        self.warming -= bool(self.warming)
        return bytes([0, max(3 - self.warming, 1)])

    @staticmethod
    def message(item: bytes, kind: int, data: bytes = b"\x00\x00") -> bytes:
        body, check = item + bytes([kind]) + data, 0
        for byte in body:
            check |= byte
        return b"\xa9" + body + bytes([check, 0x9A])


class Hitachi(Device):
    """``BE EF 03 06 00 crc crc`` and six bytes; answers are of one byte or of three, without any frame."""

    # as printed: the CRCs are the manuals'
    MESSAGES: ClassVar = {
        "BE EF 03 06 00 BA D2 01 00 00 60 01 00": "on",
        "BE EF 03 06 00 2A D3 01 00 00 60 00 00": "off",
        "BE EF 03 06 00 19 D3 02 00 00 60 00 00": "power?",
        "BE EF 03 06 00 10 F6 02 00 BA 30 00 00": "mode?",
    }

    def __init__(self) -> None:
        super().__init__()
        self.on, self.said = 0, list[str]()

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while len(buffer) >= 13:
            said = self.MESSAGES.get(bytes(buffer[:13]).hex(" ").upper(), "?")
            del buffer[:13]
            self.said.append(said)
            if said == "?":
                yield b"\x15"
            elif said.endswith("?"):
                yield b"\x1d" + struct.pack("<H", self.on if said == "power?" else 0x1C06)
            else:
                self.on = int(said == "on")
                yield b"\x06"


class Barco(Device):
    """``FE address command … checksum FF``; an acknowledge, then the answer. 80, FE and FF are sent as two bytes."""

    CONVERTED: ClassVar = {0x80: b"\x80\x00", 0xFE: b"\x80\x7e", 0xFF: b"\x80\x7f"}

    def __init__(self) -> None:
        super().__init__()
        self.shown, self.stored = 0, dict[int, bytes]()

    def frame(self, data: bytes) -> bytes:
        plain = b"\x01" + data
        plain += bytes([sum(plain) % 256])
        return b"\xfe" + b"".join(self.CONVERTED.get(b, bytes([b])) for b in plain) + b"\xff"

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while (end := buffer.find(b"\xff")) >= 0:
            raw = bytes(buffer[:end])
            del buffer[: end + 1]
            plain, at = bytearray(), 1
            while at < len(raw):
                two = raw[at : at + 2]
                plain += bytes(b for b, sent in self.CONVERTED.items() if sent == two) or two[:1]
                at += 2 if two in self.CONVERTED.values() else 1
            if raw[:1] != b"\xfe" or sum(plain[:-1]) % 256 != plain[-1]:
                yield self.frame(b"\x00\x15")
                continue
            command = bytes(plain[1:-1])
            yield self.frame(b"\x00\x06")
            if command[0] == 0x4C:  # not Barco's: a pattern of lines
                self.stored[command[1]] = command[2:]
                yield self.frame(command[:2])
            elif command[0] == 0x53:  # not Barco's: show it
                self.shown = command[1]
                yield self.frame(command[:2])


class Pjlink(Device):
    """``%1POWR 1`` is answered by ``%1POWR=OK``; ERR3 while it is not ready."""

    def __init__(self, warming: int = 2) -> None:
        super().__init__()
        self.power, self.warming, self.muted = 0, warming, "31"

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while (end := buffer.find(b"\r")) >= 0:
            line = bytes(buffer[:end]).decode("ascii", "replace")
            del buffer[: end + 1]
            yield f"{line[:6]}={self.answer(line)}\r".encode()

    def answer(self, line: str) -> str:
        if line == "%1POWR ?":
            self.warming -= bool(self.power and self.warming)
            return str(3 if self.power and self.warming else self.power)
        if line in ("%1POWR 1", "%1POWR 0"):
            self.power = int(line[-1])
            return "OK"
        if line in ("%1AVMT 30", "%1AVMT 31"):
            if not self.power or self.warming:
                return "ERR3"
            self.muted = line[-2:]
            return "OK"
        return "EPSON:EB-1" if line == "%1NAME ?" else "ERR1"


class Ricoh(Device):
    """Text between 02 and 03; ``06 0D`` done, ``06 1B`` not now, ``15`` not understood."""

    def __init__(self) -> None:
        super().__init__()
        self.on, self.shown = False, ""

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while (end := buffer.find(b"\x03")) >= 0:
            message = bytes(buffer[: end + 1])
            del buffer[: end + 1]
            command = message[1:-1].decode("ascii", "replace")
            if message[:1] != b"\x02" or len(command) != 3:
                yield b"\x15"
            elif command in ("PON", "POF"):
                self.on = command == "PON"
                yield b"\x06\x0d"
            elif not self.on:
                yield b"\x06\x1b"
            else:
                self.shown = command
                yield b"\x06\x0d"


class Dlpc900(Dlpc350):
    """Reports as of a DLPC350; a pattern is 12 bytes: index, exposure, options, dark time, -, image and bit."""

    def command(self, number: int, data: bytes, read: bool) -> bytes:
        if read:
            raise ValueError
        if number == 0x1A24:
            self.running = data[0]
            if data[0] == 2:
                self.start()
        elif self.running:
            raise ValueError
        elif number == 0x1A34:
            if len(data) != 12:
                raise ValueError
            self.entries = {**getattr(self, "entries", {}), int.from_bytes(data[:2], "little"): data[2:]}
        elif len(data) != {0x1A1B: 1, 0x1A31: 6}.get(number, -1):
            raise ValueError
        self.state[number] = data
        return b""

    def start(self) -> None:
        if self.state.get(0x1A1B) != b"\x01":  # patterns stored beforehand
            raise ValueError
        count, _again = struct.unpack("<HI", self.state[0x1A31])
        self.shown, self.pulses, self.waiting, now = [], [], list(range(count)), 0
        while self.waiting and not self.entries[self.waiting[0]][3] & 0x80:
            exposure, dark = (int.from_bytes(self.entries[self.waiting[0]][a : a + 3], "little") for a in (0, 4))
            self.advance(now)
            now += exposure + dark

    def advance(self, at_us: int) -> None:
        entry = self.entries[self.waiting.pop(0)]
        place = int.from_bytes(entry[8:10], "little")
        self.shown.append((place & 0x7FF, place >> 11))
        self.pulses.append(at_us)
