"""Commands and answers as templates, filled in and recognised: text lines, or bytes.

A text template is the line itself with fields in braces: ``{tag} LOAD {slot} {plate} {lines}``. A byte template is a
list of bytes in hexadecimal and fields with their width: ``{tag:u8} 10 {slot:u16}``; a field without a width is a run
of bytes whose length the device's number of lines gives.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError

Value = int | str | bytes
Values = Mapping[str, Value]
_FIELD = re.compile(r"\{(\w+)(?::(u8|u16|u32))?\}")
_FORMS = {"text": ".*", "plate": r"\S+", "lines": "[0-9A-F]+", "check": "[0-9A-F]+"}  # in text; others are numbers
_WIDTHS = {"u8": 1, "u16": 2, "u32": 4}


class Template(Protocol):
    """A command or an answer with fields."""

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields, in their order."""
        ...

    def fill(self, values: Values) -> bytes:
        """Write the values in."""
        ...

    def match(self, body: bytes) -> dict[str, Value] | None:
        """Read the values from a body; None if it is of another form."""
        ...


@dataclass(frozen=True)
class TextTemplate:
    """A line of text.

    Examples
    --------
    >>> template = TextTemplate("{tag} OK SHOW {slot}")
    >>> template.fill({"tag": 7, "slot": 3})
    b'7 OK SHOW 3'
    >>> template.match(b"8 OK SHOW 12")
    {'tag': '8', 'slot': '12'}
    """

    text: str

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields, in their order."""
        return tuple(m[1] for m in _FIELD.finditer(self.text))

    def fill(self, values: Values) -> bytes:
        """Write the values in; bytes are written in hexadecimal."""
        return _FIELD.sub(lambda m: _as_text(values[m[1]]), self.text).encode("ascii")

    def match(self, body: bytes) -> dict[str, Value] | None:
        """Read the values from a line; None if it is of another form."""
        parts, end = [], 0
        for m in _FIELD.finditer(self.text):
            parts.append(re.escape(self.text[end : m.start()]))
            parts.append(f"(?P<{m[1]}>{_FORMS.get(m[1], '[0-9]+')})")
            end = m.end()
        parts.append(re.escape(self.text[end:]))
        found = re.fullmatch("".join(parts), body.decode("ascii", "replace"))
        return None if found is None else dict(found.groupdict())


@dataclass(frozen=True)
class ByteTemplate:
    """Bytes.

    Examples
    --------
    >>> template = ByteTemplate("{tag:u8} A1 {slot:u16}", {})
    >>> template.fill({"tag": 7, "slot": 259}).hex(" ")
    '07 a1 01 03'
    >>> template.match(bytes([7, 0xA1, 1, 3]))
    {'tag': 7, 'slot': 259}
    """

    text: str
    lengths: Mapping[str, int]  # of fields without a width

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields, in their order."""
        return tuple(m[1] for m in _FIELD.finditer(self.text))

    def fill(self, values: Values) -> bytes:
        """Write the values in; numbers with the high byte first."""
        out = b""
        for token in self.text.split():
            field = _FIELD.fullmatch(token)
            if field is None:
                out += bytes.fromhex(token)
            else:
                value = values[field[1]]
                out += value if isinstance(value, bytes) else int(value).to_bytes(_WIDTHS[field[2] or "u8"], "big")
        return out

    def match(self, body: bytes) -> dict[str, Value] | None:
        """Read the values from bytes; None if they are of another form."""
        values: dict[str, Value] = {}
        at = 0
        for token in self.text.split():
            field = _FIELD.fullmatch(token)
            width = self.lengths.get(field[1], 1) if field and not field[2] else _WIDTHS[field[2]] if field else 1
            part, at = body[at : at + width], at + width
            if len(part) < width or (field is None and part != bytes.fromhex(token)):
                return None
            if field is not None:
                values[field[1]] = int.from_bytes(part, "big") if field[2] else part
        return values if at == len(body) else None


def make_template(text: str, kind: str, lengths: Mapping[str, int], where: str) -> Template:
    """Make the template of a kind of framing.

    Raises
    ------
    InputError
        For braces or bytes that cannot be read.
    """
    if "{" in _FIELD.sub("", text) or "}" in _FIELD.sub("", text):
        raise InputError(where, f"{text!r}", "write fields as {name} or {name:u8}")
    if kind == "text":
        if not text.isascii():
            raise InputError(where, f"{text!r}", "use ASCII characters")
        return TextTemplate(text)
    for token in text.split():
        field = _FIELD.fullmatch(token)
        if field is None and not re.fullmatch("[0-9A-Fa-f]{2}", token):
            raise InputError(where, f"byte {token!r}", "write bytes as two hexadecimal digits, separated by spaces")
        if field is not None and not field[2] and field[1] not in lengths:
            raise InputError(where, f"field {token!r}", f"give its width, as in {{{field[1]}:u8}}")
    return ByteTemplate(text, lengths)


def pack_lines(lines: NDArray[np.bool_], first: str) -> bytes:
    """Pack lines into bytes, eight each; line 0 in the `first` ("high" or "low") bit of the first byte.

    Examples
    --------
    >>> pack_lines(np.array([1, 1, 0, 0, 0, 0, 0, 0, 1], bool), "high").hex()
    'c080'
    """
    return np.packbits(lines, bitorder="big" if first == "high" else "little").tobytes()


def unpack_lines(data: bytes, count: int, first: str) -> NDArray[np.bool_]:
    """Undo `pack_lines`."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="big" if first == "high" else "little")
    return bits[:count].astype(bool)


def checksum(kind: str, data: bytes) -> int:
    """Compute a check value: crc16 (CRC-16/CCITT-FALSE), sum16, sum8 or xor8.

    Examples
    --------
    The catalogue's check value of CRC-16/CCITT-FALSE:

    >>> hex(checksum("crc16", b"123456789"))
    '0x29b1'
    """
    if kind == "sum16":
        return sum(data) & 0xFFFF
    if kind == "sum8":
        return sum(data) & 0xFF
    if kind == "xor8":
        return int(np.bitwise_xor.reduce(np.frombuffer(data, np.uint8))) if data else 0
    value = 0xFFFF
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1) ^ 0x1021 if value & 0x8000 else value << 1
        value &= 0xFFFF
    return value


CHECKS = {"crc16": 2, "sum16": 2, "sum8": 1, "xor8": 1}  # name to width in bytes


def _as_text(value: Value) -> str:
    return value.hex().upper() if isinstance(value, bytes) else str(value)
