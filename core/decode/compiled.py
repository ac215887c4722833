"""The bricks of the compiled kernels: images by address, sums over frames, the angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, types
from numba.extending import intrinsic

from core.compiling import njit

F = np.float32
HALF, ONE, TINY = F(0.5), F(1), F(1e-20)
# sums of 32-bit integers are 64-bit ones until they are cast: half as many fit into a vector register
INT = np.int32
NONE = INT(0)
TILE = 2048  # pixels taken together: long enough to read every frame in runs, short enough for the cache
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


def _prefetch(typing_context: Any, address: Any) -> Any:
    """Ask for the memory at an address before it is needed."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        name = "llvm.prefetch.p0"
        function = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
        builder.call(function, [builder.inttoptr(arguments[0], byte), number(0), number(2), number(1)])
        return context.get_dummy_value()

    return types.void(types.uintp), build


prefetch: Any = intrinsic(_prefetch)


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
def narrow(address, start, count):  # type: ignore[no-untyped-def]
    """Grey values of one byte from pixel `start` of an image; those of the next tile are fetched ahead."""
    for ahead in range(count, 2 * count, 64):
        prefetch(address + np.uint64(start + ahead))
    return carray(pointer(address + np.uint64(start)), (count,), np.uint8)


@fast
def wide(address, start, count):  # type: ignore[no-untyped-def]
    """Grey values of two bytes from pixel `start` of an image; those of the next tile are fetched ahead."""
    for ahead in range(2 * count, 4 * count, 64):
        prefetch(address + np.uint64(2 * start + ahead))
    return carray(pointer(address + np.uint64(2 * start)), (count,), np.uint16)


@fast
def _add_one(a, f, count, out):  # type: ignore[no-untyped-def]
    for i in range(count):
        out[i] += f * F(a[i])


@fast
def _add_four(frames, factors, count, out):  # type: ignore[no-untyped-def]
    a, b, c, d = frames
    f, g, h, k = factors
    for i in range(count):
        out[i] += (f * F(a[i]) + g * F(b[i])) + (h * F(c[i]) + k * F(d[i]))


@fast
def weighted_sum(rows, r, source, count, out):  # type: ignore[no-untyped-def]
    """out = one row times the frames."""
    addresses, item_size, start = source
    column, value = rows.column, rows.value
    entry, end = rows.first[r], rows.first[r + 1]
    fill(out, 0, count, F(0))
    while entry + 1 < end:  # four at a time, for every pass over the sum costs more than a frame
        last = end - 1
        a, b = addresses[column[entry]], addresses[column[entry + 1]]
        c, d = addresses[column[min(entry + 2, last)]], addresses[column[min(entry + 3, last)]]
        h = value[entry + 2] if entry + 2 < end else F(0)
        k = value[entry + 3] if entry + 3 < end else F(0)
        factors = (value[entry], value[entry + 1], h, k)
        if item_size == 1:
            four = narrow(a, start, count), narrow(b, start, count), narrow(c, start, count), narrow(d, start, count)
            _add_four(four, factors, count, out)
        else:
            more = wide(a, start, count), wide(b, start, count), wide(c, start, count), wide(d, start, count)
            _add_four(more, factors, count, out)
        entry += 4
    if entry < end:
        a, f = addresses[column[entry]], value[entry]
        if item_size == 1:
            _add_one(narrow(a, start, count), f, count, out)
        else:
            _add_one(wide(a, start, count), f, count, out)


@fast
def pixel_sum(rows, r, source, pixel):  # type: ignore[no-untyped-def]
    """One row times the grey values of one pixel of the tile."""
    addresses, item_size, start = source
    total = F(0)
    for entry in range(rows.first[r], rows.first[r + 1]):
        a, f = addresses[rows.column[entry]], rows.value[entry]
        total += f * (F(narrow(a, start + pixel, 1)[0]) if item_size == 1 else F(wide(a, start + pixel, 1)[0]))
    return total


@fast
def brightest(frames, source, count, out):  # type: ignore[no-untyped-def]
    """out = the largest grey value of some frames."""
    addresses, item_size, start = source
    fill(out, 0, count, F(0))
    for f in frames:
        if item_size == 1:
            _raise(narrow(addresses[f], start, count), count, out)
        else:
            _raise(wide(addresses[f], start, count), count, out)


@fast
def _raise(a, count, out):  # type: ignore[no-untyped-def]
    for i in range(count):
        out[i] = max(out[i], F(a[i]))


@fast
def load(frames, addresses, item_size, start, count, grey):  # type: ignore[no-untyped-def]
    """Copy grey values of some frames to the rows of `grey`."""
    for n in range(len(frames)):
        if item_size == 1:
            _copy(narrow(addresses[frames[n]], start, count), count, grey[n])
        else:
            _copy(wide(addresses[frames[n]], start, count), count, grey[n])


@fast
def _copy(a, count, out):  # type: ignore[no-untyped-def]
    for i in range(count):
        out[i] = a[i]
