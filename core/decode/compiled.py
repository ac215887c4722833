"""The bricks of the compiled kernels: images by address, sums over frames, the angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray, types
from numba.extending import intrinsic

from core.compiling import njit

F = np.float32
HALF, ONE, TINY = F(0.5), F(1), F(1e-20)
# sums of 32-bit integers are 64-bit ones until they are cast: half as many fit into a vector register
INT = np.int32
NONE = INT(0)
# arctan(z) / (2 pi z) on [0, 1] as a polynomial in z², least maximum error: 2.4e-8 turns in single precision
C0, C1, C2, C3 = F(0.159154832), F(-0.0530461147), F(0.0317458808), F(-0.0221359655)
C4, C5, C6, C7 = F(0.0153452922), F(-0.00889775623), F(0.00347895455), F(-0.000645133085)


def fast(function: Any) -> Any:
    """Compile for vector instructions: no checks for division by zero, products and sums fused."""
    return njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz", "arcp"})(function)


def _pointer(typing_context: Any, address: Any) -> Any:
    """Make a pointer from an unsigned address, so that one kernel takes any number of images without copying them."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return types.voidptr(types.uintp), build


pointer: Any = intrinsic(_pointer)


@fast
def angle(c, s):  # type: ignore[no-untyped-def]
    """Angle of the direction (c, s) in turns, from -1/2 to 1/2."""
    x, y = abs(c), abs(s)
    z = min(x, y) / (max(x, y) + F(1e-20))
    q = z * z
    t = z * (C0 + q * (C1 + q * (C2 + q * (C3 + q * (C4 + q * (C5 + q * (C6 + q * C7)))))))
    t = F(0.25) - t if y > x else t
    t = F(0.5) - t if c < F(0) else t
    return -t if s < F(0) else t


@fast
def turn_of(turns):  # type: ignore[no-untyped-def]
    """What is left of a number of turns without the whole ones, from -1/2 to 1/2."""
    return turns - np.rint(turns)


@fast
def fill(out, start, stop, value):  # type: ignore[no-untyped-def]
    """out[start:stop] = value, which as a slice would take long to compile."""
    for i in range(start, stop):
        out[i] = value


@fast
def weighted_sum(rows, r, addresses, item_size, start, count, out):  # type: ignore[no-untyped-def]
    """out = one row times the frames."""
    first, column, value = rows.first, rows.column, rows.value
    if first[r] == first[r + 1]:
        fill(out, 0, count, F(0))
    for entry in range(first[r], first[r + 1]):
        address, factor, fresh = addresses[column[entry]], value[entry], entry == first[r]
        if item_size == 1:
            narrow = carray(pointer(address + np.uint64(start)), (count,), np.uint8)
            if fresh:
                for i in range(count):
                    out[i] = factor * F(narrow[i])
            else:
                for i in range(count):
                    out[i] += factor * F(narrow[i])
        else:
            wide = carray(pointer(address + np.uint64(2 * start)), (count,), np.uint16)
            if fresh:
                for i in range(count):
                    out[i] = factor * F(wide[i])
            else:
                for i in range(count):
                    out[i] += factor * F(wide[i])


@fast
def brightest(frames, addresses, item_size, start, count, out):  # type: ignore[no-untyped-def]
    """out = the largest grey value of some frames."""
    fill(out, 0, count, F(0))
    for f in frames:
        if item_size == 1:
            narrow = carray(pointer(addresses[f] + np.uint64(start)), (count,), np.uint8)
            for i in range(count):
                out[i] = max(out[i], F(narrow[i]))
        else:
            wide = carray(pointer(addresses[f] + np.uint64(2 * start)), (count,), np.uint16)
            for i in range(count):
                out[i] = max(out[i], F(wide[i]))


@fast
def load(frames, addresses, item_size, start, count, grey):  # type: ignore[no-untyped-def]
    """Copy grey values of some frames to the rows of `grey`."""
    for n in range(len(frames)):
        row = grey[n]
        if item_size == 1:
            narrow = carray(pointer(addresses[frames[n]] + np.uint64(start)), (count,), np.uint8)
            for i in range(count):
                row[i] = narrow[i]
        else:
            wide = carray(pointer(addresses[frames[n]] + np.uint64(2 * start)), (count,), np.uint16)
            for i in range(count):
                row[i] = wide[i]
