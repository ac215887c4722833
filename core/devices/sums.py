"""Check values of frames and lines: sums, or, exclusive or, cyclic redundancy checks with any parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

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
        return self.bits // 8

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
            return reduce(int.__or__ if self.kind == "or" else int.__xor__, data, self.init) ^ self.xor
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
