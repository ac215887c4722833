"""The bricks of the compiled kernels: images by address, sums over frames, the angle."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.compiling import intrinsic, njit
from core.decode.tables import TOGETHER

F = np.float32
HALF, ONE, TINY = F(0.5), F(1), F(1e-20)
# sums of 32-bit integers are 64-bit ones until they are cast: half as many fit into a vector register
INT = np.int32
NONE = INT(0)
# numba compiles a function once more for every whole number written where it is called; these are no such numbers
ZEROTH, FIRST = np.int64(0), np.int64(1)
TILE = 4096  # pixels taken together: long enough to read every frame in runs, short enough for the cache
# arctan(z) / (2 pi z) on [0, 1] as a polynomial in z², least maximum error: 2.4e-8 turns in single precision
C0, C1, C2, C3 = F(0.159154832), F(-0.0530461147), F(0.0317458808), F(-0.0221359655)
C4, C5, C6, C7 = F(0.0153452922), F(-0.00889775623), F(0.00347895455), F(-0.000645133085)


# For vector instructions: no checks for division by zero, products and sums fused. Without numba's runtime, which would
# count references to every array at every call, the threads in turns: kernels allocate nothing, they are given memory.
_HOW: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "nsz", "arcp"}, "_nrt": False}
fast: Any = njit(cache=True, nogil=True, **_HOW)  # what Python calls
part: Any = njit(**_HOW)  # what only kernels call; `inner` would double the time of the pixels


def _greys(kind: str, size: int) -> Any:
    """Make what gives the grey values from an address on as an array: one kernel takes any number of images."""

    def typed(typing_context: Any, address: Any, count: Any) -> Any:
        from numba import types
        from numba.np.arrayobj import make_array, populate_array

        array = types.Array(getattr(types, kind), 1, "C")

        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            made = make_array(array)(context, builder)
            item = context.get_constant(types.intp, size)
            data = builder.inttoptr(arguments[0], context.get_data_type(array.dtype).as_pointer())
            populate_array(made, data=data, shape=[arguments[1]], strides=[item], itemsize=item, meminfo=None)
            return made._getvalue()

        return array(types.uintp, types.intp), build

    return intrinsic(typed)


narrow, wide, single = _greys("uint8", 1), _greys("uint16", 2), _greys("float32", 4)


@intrinsic
def prefetch(typing_context: Any, address: Any) -> Any:
    """Ask for the memory at an address before it is needed."""
    from llvmlite import ir
    from numba import types

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        name = "llvm.prefetch.p0"
        function = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
        builder.call(function, [builder.inttoptr(arguments[0], byte), number(0), number(2), number(1)])
        return context.get_dummy_value()

    return types.void(types.uintp), build


@part
def angle(c, s):  # type: ignore[no-untyped-def]
    """Angle of the direction (c, s) in turns, from -1/2 to 1/2."""
    x, y = abs(c), abs(s)
    z = min(x, y) / (max(x, y) + F(1e-20))
    q = z * z
    t = z * (C0 + q * (C1 + q * (C2 + q * (C3 + q * (C4 + q * (C5 + q * (C6 + q * C7)))))))
    t = F(0.25) - t if y > x else t
    t = F(0.5) - t if c < F(0) else t
    return -t if s < F(0) else t


@part
def turn_of(turns):  # type: ignore[no-untyped-def]
    """What is left of a number of turns without the whole ones, from -1/2 to 1/2."""
    return turns - np.rint(turns)


@part
def fill(out, start, stop, value):  # type: ignore[no-untyped-def]
    """out[start:stop] = value, which as a slice would take long to compile."""
    for i in range(start, stop):
        out[i] = value


@part
def grey_at(source, frame, count):  # type: ignore[no-untyped-def]
    """Address of the tile's first grey value in a frame; those of the next tile are fetched ahead."""
    addresses, item_size, start = source
    address = addresses[frame] + np.uint64(item_size * start)
    for ahead in range(item_size * count, 2 * item_size * count, 64):
        prefetch(address + np.uint64(ahead))
    return address


@part
def weighted_sum(rows, r, source, count, out):  # type: ignore[no-untyped-def]
    """out = one row times the frames."""
    column, value, end = rows.column, rows.value, rows.first[r + 1]
    fill(out, 0, count, F(0))
    for entry in range(rows.first[r], end, 2):
        other = min(entry + 1, end - 1)
        f, g = value[entry], value[other] if other > entry else F(0)
        a, b = grey_at(source, column[entry], count), grey_at(source, column[other], count)
        if source[1] == 1:
            _add_two(narrow(a, count), narrow(b, count), f, g, count, out)
        else:
            _add_two(wide(a, count), wide(b, count), f, g, count, out)


@part
def _add_two(a, b, f, g, count, out):  # type: ignore[no-untyped-def]
    for i in range(count):
        out[i] += f * F(a[i]) + g * F(b[i])


@part
def three_sums(fits, j, source, count, out):  # type: ignore[no-untyped-def]
    """Mean, cosine and sine part of period j, the three rows of `out`: every frame is read once."""
    fill(out, 0, 3 * TILE, F(0))
    for entry in range(fits.first[j], fits.first[j + 1], TOGETHER):
        a, b = grey_at(source, fits.frame[entry], count), grey_at(source, fits.frame[entry + 1], count)
        c, d = grey_at(source, fits.frame[entry + 2], count), grey_at(source, fits.frame[entry + 3], count)
        factors = fits.value[:, entry : entry + TOGETHER]
        if source[1] == 1:
            _add_to_three((narrow(a, count), narrow(b, count), narrow(c, count), narrow(d, count)), factors, count, out)
        else:
            _add_to_three((wide(a, count), wide(b, count), wide(c, count), wide(d, count)), factors, count, out)


@part
def _add_to_three(frames, factors, count, out):  # type: ignore[no-untyped-def]
    a, b, c, d = frames
    f, g, h, k = factors[0, 0], factors[0, 1], factors[0, 2], factors[0, 3]
    fc, gc, hc, kc = factors[1, 0], factors[1, 1], factors[1, 2], factors[1, 3]
    fs, gs, hs, ks = factors[2, 0], factors[2, 1], factors[2, 2], factors[2, 3]
    for i in range(count):
        p, q, r, s = F(a[i]), F(b[i]), F(c[i]), F(d[i])
        out[i] += (f * p + g * q) + (h * r + k * s)
        out[TILE + i] += (fc * p + gc * q) + (hc * r + kc * s)
        out[2 * TILE + i] += (fs * p + gs * q) + (hs * r + ks * s)


@part
def pixel_sum(rows, r, source, pixel):  # type: ignore[no-untyped-def]
    """One row times the grey values of one pixel of the tile."""
    total = F(0)
    for entry in range(rows.first[r], rows.first[r + 1]):
        total += rows.value[entry] * grey_of(source, rows.column[entry], pixel)
    return total


@part
def grey_of(source, frame, pixel):  # type: ignore[no-untyped-def]
    """Grey value of one pixel of the tile in a frame."""
    addresses, item_size, start = source
    a = addresses[frame] + np.uint64(item_size * (start + pixel))
    return F(narrow(a, 1)[0]) if item_size == 1 else F(wide(a, 1)[0])


@part
def brightest(frames, source, count, out):  # type: ignore[no-untyped-def]
    """out = the largest grey value of some frames."""
    fill(out, 0, count, F(0))
    for n in range(len(frames)):
        if source[1] == 1:
            _raise(narrow(grey_at(source, frames[n], count), count), count, out)
        else:
            _raise(wide(grey_at(source, frames[n], count), count), count, out)


@part
def _raise(a, count, out):  # type: ignore[no-untyped-def]
    for i in range(count):
        out[i] = max(out[i], F(a[i]))


@part
def load(frames, source, count, grey):  # type: ignore[no-untyped-def]
    """Copy grey values of some frames to the rows of `grey`."""
    for n in range(len(frames)):
        if source[1] == 1:
            _copy(narrow(grey_at(source, frames[n], count), count), count, grey[n])
        else:
            _copy(wide(grey_at(source, frames[n], count), count), count, grey[n])


@part
def _copy(a, count, out):  # type: ignore[no-untyped-def]
    for i in range(count):
        out[i] = a[i]
