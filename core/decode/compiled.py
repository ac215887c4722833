"""The bricks of the compiled kernels: images by address, sums over frames, the angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from core.compiling import njit

F = np.float32
HALF, ONE, TINY = F(0.5), F(1), F(1e-20)
# sums of 32-bit integers are 64-bit ones until they are cast: half as many fit into a vector register
INT = np.int32
NONE = INT(0)
TILE = 4096  # pixels taken together: long enough to read every frame in runs, short enough for the cache
# arctan(z) / (2 pi z) on [0, 1] as a polynomial in z², least maximum error: 2.4e-8 turns in single precision
C0, C1, C2, C3 = F(0.159154832), F(-0.0530461147), F(0.0317458808), F(-0.0221359655)
C4, C5, C6, C7 = F(0.0153452922), F(-0.00889775623), F(0.00347895455), F(-0.000645133085)


def fast(function: Any) -> Any:
    """Compile for vector instructions: no checks for division by zero, products and sums fused.

    Without numba's runtime, which would count references to every array at every call, the threads in turns: compiled
    functions allocate nothing, they are given their scratch memory.
    """
    fused = {"contract", "nsz", "arcp"}
    return njit(cache=True, nogil=True, error_model="numpy", fastmath=fused, _nrt=False)(function)


def _greys(kind: types.Type) -> Any:
    """Make an intrinsic that gives the grey values from an address on as an array, so that a kernel takes any number of images."""

    def typed(typing_context: Any, address: Any, count: Any) -> Any:
        array = types.Array(kind, 1, "C")

        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            made = make_array(array)(context, builder)
            item = context.get_constant(types.intp, kind.bitwidth // 8)
            data = builder.inttoptr(arguments[0], context.get_data_type(kind).as_pointer())
            populate_array(made, data=data, shape=[arguments[1]], strides=[item], itemsize=item, meminfo=None)
            return made._getvalue()

        return array(types.uintp, types.intp), build

    return intrinsic(typed)


narrow, wide = _greys(types.uint8), _greys(types.uint16)


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
def grey_at(source, frame):  # type: ignore[no-untyped-def]
    """Address of the tile's first grey value in a frame."""
    addresses, item_size, start = source
    return addresses[frame] + np.uint64(item_size * start)


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
    column, value = rows.column, rows.value
    entry, end = rows.first[r], rows.first[r + 1]
    fill(out, 0, count, F(0))
    while entry + 1 < end:  # four at a time, for every pass over the sum costs more than a frame
        last = end - 1
        a, b = grey_at(source, column[entry]), grey_at(source, column[entry + 1])
        c, d = grey_at(source, column[min(entry + 2, last)]), grey_at(source, column[min(entry + 3, last)])
        h = value[entry + 2] if entry + 2 < end else F(0)
        k = value[entry + 3] if entry + 3 < end else F(0)
        factors = (value[entry], value[entry + 1], h, k)
        if source[1] == 1:
            _add_four((narrow(a, count), narrow(b, count), narrow(c, count), narrow(d, count)), factors, count, out)
        else:
            _add_four((wide(a, count), wide(b, count), wide(c, count), wide(d, count)), factors, count, out)
        entry += 4
    if entry < end:
        a = grey_at(source, column[entry])
        if source[1] == 1:
            _add_one(narrow(a, count), value[entry], count, out)
        else:
            _add_one(wide(a, count), value[entry], count, out)


@fast
def pixel_sum(rows, r, source, pixel):  # type: ignore[no-untyped-def]
    """One row times the grey values of one pixel of the tile."""
    addresses, item_size, start = source
    total, at = F(0), np.uint64(item_size * (start + pixel))
    for entry in range(rows.first[r], rows.first[r + 1]):
        a = addresses[rows.column[entry]] + at
        total += rows.value[entry] * (F(narrow(a, 1)[0]) if item_size == 1 else F(wide(a, 1)[0]))
    return total


@fast
def brightest(frames, source, count, out):  # type: ignore[no-untyped-def]
    """out = the largest grey value of some frames."""
    fill(out, 0, count, F(0))
    for n in range(len(frames)):
        if source[1] == 1:
            _raise(narrow(grey_at(source, frames[n]), count), count, out)
        else:
            _raise(wide(grey_at(source, frames[n]), count), count, out)


@fast
def _raise(a, count, out):  # type: ignore[no-untyped-def]
    for i in range(count):
        out[i] = max(out[i], F(a[i]))


@fast
def load(frames, source, count, grey):  # type: ignore[no-untyped-def]
    """Copy grey values of some frames to the rows of `grey`."""
    for n in range(len(frames)):
        if source[1] == 1:
            _copy(narrow(grey_at(source, frames[n]), count), count, grey[n])
        else:
            _copy(wide(grey_at(source, frames[n]), count), count, grey[n])


@fast
def _copy(a, count, out):  # type: ignore[no-untyped-def]
    for i in range(count):
        out[i] = a[i]
