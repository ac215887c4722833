"""The light of lines in the bytes that a command carries."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass


@dataclass(frozen=True)
class LineBits:
    """How the light of lines is written: in bits, or a grey value in a byte each.

    Examples
    --------
    >>> LineBits().pack(np.array([1, 1, 0, 0, 0, 0, 0, 0, 1], float)).hex()
    'c080'
    >>> LineBits(lit=0, backward=True).pack(np.array([1, 1, 0, 0, 0, 0, 0, 0, 1], float)).hex()
    '7e00'
    """

    first: str = "high"  #: line 0 is the "high" or the "low" bit of its byte
    depth: int = 1  #: 1 or 8 bits
    lit: int = 1  #: the bit of a line that is lit; 0: grey values are those of darkness
    backward: bool = False  #: the last line comes first

    def pack(self, light: NDArray[Any]) -> bytes:
        """Write the light of lines, from 0 to 1, shape (n,)."""
        light = np.asarray(light, float)[:: -1 if self.backward else 1]
        light = light if self.lit else 1 - light
        if self.depth == 8:
            return np.rint(255 * light).astype(np.uint8).tobytes()
        return np.packbits(light > 0.5, bitorder="big" if self.first == "high" else "little").tobytes()

    def unpack(self, data: bytes, count: int) -> NDArray[np.bool_]:
        """Read `count` lines that are lit or not."""
        bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="big" if self.first == "high" else "little")
        return (bits[:count] == self.lit)[:: -1 if self.backward else 1]
