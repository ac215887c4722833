"""How a body travels: a line with an ending, or a frame of start, head, length, body, check value and end.

A `Framing` is of one direction. A body is the bytes of a command's template; where a frame has a head (what stands
before the length), the template's first bytes are the head.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from functools import reduce
from typing import Literal

from core.devices.line.template import Template
from core.lazy import dataclass

PARTS = ("start", "head", "length", "body", "mark", "check", "end")
Order = Literal["big", "little"]
KINDS = ("crc", "sum", "lrc", "or", "xor")


@dataclass(frozen=True)
class CheckSum:
    """A way to compute a check value of `bits` bits; the parameters of a CRC are those of the catalogues.

    Sums begin with `init` too, and `xor` is applied to every value at the end.
    """

    kind: str  # "none", "sum", "lrc" (the sum's two's complement), "or", "xor" or "crc"
    bits: int = 0
    poly: int = 0
    init: int = 0
    reflect: bool = False  # lowest bit first, of the bytes and of the result
    xor: int = 0

    @property
    def width(self) -> int:
        """Bytes of the value."""
        return -(-self.bits // 8)

    def of(self, data: bytes) -> int:
        """Compute the value.

        Examples
        --------
        The check values of CRC-16/CCITT-FALSE and CRC-16/MODBUS in the catalogue:

        >>> hex(CHECKS["crc16"].of(b"123456789")), hex(CHECKS["crc16-modbus"].of(b"123456789"))
        ('0x29b1', '0x4b37')
        """
        mask = (1 << self.bits) - 1
        if self.kind in ("sum", "lrc"):
            value = self.init + sum(data)
            return (-value if self.kind == "lrc" else value) & mask ^ self.xor
        if self.kind in ("or", "xor"):
            return reduce(int.__or__ if self.kind == "or" else int.__xor__, data, self.init) & mask ^ self.xor
        value, top = self.init, 1 << (self.bits - 1) if self.bits else 0
        poly = int(f"{self.poly:0{self.bits}b}"[::-1], 2) if self.reflect else self.poly
        for byte in data if self.bits else b"":
            value ^= byte if self.reflect else byte << (self.bits - 8)
            for _ in range(8):
                if self.reflect:
                    value = (value >> 1) ^ (poly if value & 1 else 0)
                else:
                    value = ((value << 1) ^ (poly if value & top else 0)) & mask
        return value ^ self.xor


CHECKS = {
    "none": CheckSum("none"),
    "sum8": CheckSum("sum", 8),
    "sum16": CheckSum("sum", 16),
    "sum32": CheckSum("sum", 32),
    "lrc": CheckSum("lrc", 8),
    "or8": CheckSum("or", 8),
    "xor8": CheckSum("xor", 8),
    "crc8": CheckSum("crc", 8, 0x07),
    "crc8-maxim": CheckSum("crc", 8, 0x31, reflect=True),
    "crc16": CheckSum("crc", 16, 0x1021, 0xFFFF),
    "crc16-xmodem": CheckSum("crc", 16, 0x1021),
    "crc16-kermit": CheckSum("crc", 16, 0x1021, reflect=True),
    "crc16-arc": CheckSum("crc", 16, 0x8005, reflect=True),
    "crc16-modbus": CheckSum("crc", 16, 0x8005, 0xFFFF, True),
    "crc32": CheckSum("crc", 32, 0x04C11DB7, 0xFFFFFFFF, True, 0xFFFFFFFF),
}


@dataclass(frozen=True)
class Framing:
    """One direction of a line."""

    kind: str  #: "text" or "frame": how templates are written
    parts: tuple[str, ...]  #: which of `PARTS` a frame has, in their order
    start: bytes = b""
    end: bytes = b""
    mark: bytes = b""  #: what stands before the check value of a line
    head: int = 0
    length: int = 0
    length_order: Order = "big"
    #: length_over, check_over: the parts that the length counts, to which `length_add` is added, and that the check
    #: value covers
    length_over: tuple[str, ...] = ("body",)
    length_add: int = 0
    check: CheckSum = CHECKS["none"]
    check_over: tuple[str, ...] = ("body",)
    check_order: Order = "big"
    check_text: bool = False  #: the check value is written in hexadecimal digits
    pad: int = 0  #: frames are filled with zeros to a multiple of so many bytes
    #: what is sent in place of bytes that would be taken for a start or an end; the check value is that of the bytes
    #: meant
    escapes: Mapping[bytes, bytes] = field(default_factory=dict)
    #: what a body can look like, where neither a length nor an end tells how long it is
    forms: tuple[Template, ...] = ()
    prompt: bytes = b""  #: what a device writes when it is ready for the next line

    @property
    def check_size(self) -> int:
        """Bytes that the check value takes."""
        return self.check.width * (1 + self.check_text)

    @property
    def fixed(self) -> dict[str, int]:
        """Sizes of all parts but the body."""
        sizes = {"start": len(self.start), "head": self.head, "length": self.length, "mark": len(self.mark)}
        return {**sizes, "check": self.check_size, "end": len(self.end)}

    def check_of(self, pieces: dict[str, bytes]) -> bytes:
        """Compute the check value of the parts that it covers, itself as zeros, as it is written."""
        if not self.check.bits:
            return b""
        pieces = {**pieces, "check": bytes(self.check_size)}
        value = self.check.of(b"".join(pieces[p] for p in self.parts if p in self.check_over))
        if self.check_text:
            return f"{value:0{self.check_size}X}".encode()
        return value.to_bytes(self.check.width, self.check_order)


def wrap(framing: Framing, body: bytes) -> bytes:
    """Make a line or a frame of a body.

    Examples
    --------
    A Modbus frame has neither start nor length: CRC, low byte first, after the body.

    >>> modbus = Framing("frame", ("body", "check"), check=CHECKS["crc16-modbus"], check_order="little")
    >>> wrap(modbus, bytes.fromhex("11 03 00 6B 00 03")).hex(" ")
    '11 03 00 6b 00 03 76 87'
    """
    pieces = {"start": framing.start, "head": body[: framing.head], "body": body[framing.head :]}
    pieces |= {"mark": framing.mark, "end": framing.end}
    counted = {**framing.fixed, "body": len(pieces["body"])}
    if framing.length:
        value = framing.length_add + sum(counted[p] for p in framing.length_over)
        pieces["length"] = value.to_bytes(framing.length, framing.length_order)
    pieces["check"] = framing.check_of(pieces)
    if framing.escapes:
        meant = re.compile(b"|".join(map(re.escape, framing.escapes)))
        for part in set(pieces) - {"start", "end"}:
            pieces[part] = meant.sub(lambda m: framing.escapes[m[0]], pieces[part])
    whole = b"".join(pieces[p] for p in framing.parts)
    return whole + bytes(-len(whole) % framing.pad if framing.pad else 0)


def unwrap(framing: Framing, buffer: bytearray, wrong: list[bytes] | None = None) -> bytes | None:
    """Take the next whole body out of a buffer; None while it is incomplete.

    Bytes before a frame's start are skipped; frames with a wrong check value are taken out and added to `wrong`.

    Examples
    --------
    >>> parts = ("start", "length", "body", "check")
    >>> framing = Framing("frame", parts, start=bytes([2]), length=1, check=CHECKS["sum8"])
    >>> buffer = bytearray(b"?" + wrap(framing, b"abc") + b"x")
    >>> unwrap(framing, buffer), bytes(buffer)
    (b'abc', b'x')
    """
    at = 0
    while 0 <= (at := buffer.find(framing.start, at)) < len(buffer):
        complete = True
        for size in _whole_sizes(framing, buffer, at):
            filling = -size % framing.pad if size is not None and framing.pad else 0
            if size is None or len(buffer) < at + size + filling:
                complete = False
                continue
            pieces = _split(framing, _meant(framing, bytes(buffer[at : at + size])))
            ends = all(pieces.get(p, own) == own for p, own in (("end", framing.end), ("mark", framing.mark)))
            body = pieces.get("head", b"") + pieces["body"]
            # a CRC over one byte more agrees too when that byte is the CRC's own: the form has to fit as well
            fits = not framing.forms or any(form.match(body) is not None for form in framing.forms)
            if ends and fits and framing.check_of(pieces).upper() == pieces.get("check", b"").upper():
                del buffer[: at + size + filling]
                return body.removeprefix(framing.prompt)
            if wrong is not None and not framing.forms:
                wrong.append(pieces["body"])
        awaited = not framing.check.bits and any(agree(f.fixed, buffer[at:]) for f in framing.forms)
        if not complete and (awaited or not framing.forms):
            return None
        at += 1  # perhaps this was no start
        if complete and not framing.forms:
            if framing.kind == "text":  # a line that is damaged is over at its end
                at = buffer.index(framing.end, at - 1) + len(framing.end)
            del buffer[:at]
            at = 0
    return None


def _whole_sizes(framing: Framing, buffer: bytearray, at: int) -> Iterator[int | None]:
    """Give the sizes that the frame that starts at a place can have; None: it cannot be told yet."""
    fixed = framing.fixed
    around = sum(fixed[p] for p in framing.parts if p != "body")
    if framing.length and not framing.escapes:  # bytes that were escaped are not counted; the end tells where it is
        head = sum(fixed[p] for p in framing.parts[: framing.parts.index("length")])
        field = buffer[at + head : at + head + framing.length]
        if len(field) < framing.length:
            yield None
            return
        counted = framing.length_add + sum(fixed[p] for p in framing.length_over if p != "body")
        body = int.from_bytes(field, framing.length_order) - counted
        if body >= 0:
            yield around + body
    elif framing.forms:
        yield from sorted({around + (form.sizes[1] or 0) for form in framing.forms})
    else:
        end = buffer.find(framing.end, at + len(framing.start) + framing.head)
        after = sum(fixed[p] for p in framing.parts[framing.parts.index("end") :])
        yield None if end < 0 else end - at + after if framing.escapes else max(end - at + after, around)


def agree(fixed: Iterable[int | None], others: Iterable[int | None]) -> bool:
    """Whether no byte that is fixed in both differs, as far as both go."""
    return all(a is None or b is None or a == b for a, b in zip(fixed, others, strict=False))


def _meant(framing: Framing, whole: bytes) -> bytes:
    """Put the bytes that were meant in the place of those that were sent for them."""
    if not framing.escapes:
        return whole
    meant = {sent: byte for byte, sent in framing.escapes.items()}
    inner = whole[len(framing.start) : len(whole) - len(framing.end)]
    inner = re.sub(b"|".join(map(re.escape, meant)), lambda m: meant[m[0]], inner)
    return framing.start + inner + framing.end


def _split(framing: Framing, whole: bytes) -> dict[str, bytes]:
    fixed = framing.fixed
    sizes = {**fixed, "body": len(whole) - sum(fixed[p] for p in framing.parts if p != "body")}
    pieces, at = {}, 0
    for part in framing.parts:
        pieces[part], at = whole[at : at + sizes[part]], at + sizes[part]
    return pieces
