"""Lists of lines that are the bits of a code, begun anywhere in it: they decode as that code."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import pi
from typing import Literal, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from core.decode.known import AXES
from core.decode.options import Flag, invalidate
from core.model import PhaseMap
from core.patterns import Axis, Code, Lines, Pattern, Phase, axis_of

HALF = 0.5  # a line: from its centre to its edge
MOST_BITS = 16


class Coded(NamedTuple):
    """Patterns in which lists are bits; numbers of lines, u and v: all of the code, before the projector's own, own."""

    patterns: tuple[Pattern, ...]
    lines: tuple[int, int] | None
    before: tuple[int, int]
    own: tuple[float, float]

    def moved(self, phase: PhaseMap) -> PhaseMap:
        """Coordinates of the projector, from those of the code."""
        u, v = (at - np.float32(before) for at, before in zip((phase.u, phase.v), self.before, strict=True))
        sigma_u, sigma_v, flags = phase.sigma_u.copy(), phase.sigma_v.copy(), phase.flags.copy()
        for at, sigma, own, lack in zip((u, v), (sigma_u, sigma_v), self.own, (Flag.NO_U, Flag.NO_V), strict=True):
            invalidate(at, sigma, flags, (at < -HALF) | (at > own - HALF), Flag.OUTSIDE | lack)
        return replace(phase, u=u, v=v, sigma_u=sigma_u, sigma_v=sigma_v, flags=flags)


@lru_cache(maxsize=8)
def as_coded(patterns: tuple[Pattern, ...], lines: tuple[int, int] | None) -> Coded | None:
    """Find codes whose bits are given as lists; None where there are none."""
    found, before, own = list(patterns), [0, 0], [float(n) for n in lines or (np.inf, np.inf)]
    for number, axis in enumerate(AXES):
        mine = [k for k, p in enumerate(patterns) if axis_of(p) == axis]
        lists = {k: p.values for k in mine if isinstance(p := patterns[k], Lines)}
        if not lists or any(isinstance(patterns[k], Code) for k in mine):
            continue
        texts = [values for values in lists.values() if isinstance(values, str)]
        if len(texts) < len(lists) or len(set(map(len, texts))) > 1:
            continue
        shown = np.array([np.frombuffer(text.encode(), np.uint8) == ord("1") for text in texts])
        code = _code(shown, "gray", axis) or _code(shown, "binary", axis)
        if code is None:
            continue
        bits, before[number] = code
        own[number] = shown.shape[1]
        for k, bit in zip(lists, bits, strict=True):
            found[k] = bit
        for k in mine:
            if isinstance(p := found[k], Phase):
                found[k] = replace(p, shift_rad=p.shift_rad + 2 * pi * before[number] / p.period)
    if found == list(patterns):
        return None
    size = lines and (lines[0] + before[0], lines[1] + before[1])
    return Coded(tuple(found), size, (before[0], before[1]), (own[0], own[1]))


def _code(shown: NDArray[np.bool_], kind: Literal["gray", "binary"], axis: Axis) -> tuple[list[Code], int] | None:
    """The bits that frames (k, lines) show, and how many lines of their code are before the first; None if they do not.

    Every bit of the code must be there, in itself or inverted.
    """
    edges = np.flatnonzero((shown[:, 1:] != shown[:, :-1]).any(axis=0)) + 1
    if len(edges) < 2 or len(cells := np.unique(np.diff(edges))) > 1:
        return None
    cell = int(cells[0])
    begins = np.arange(-(-edges[0] % cell), shown.shape[1], cell)  # of the first only a part may be seen
    seen = shown[:, np.maximum(begins, 0)]
    plain = seen ^ seen[:, :1]
    rows, which = np.unique(plain, axis=0, return_inverse=True)
    bits, length = rows.shape
    if bits > MOST_BITS or length > 1 << bits:
        return None
    number = np.arange(1 << bits)
    number = number ^ (number >> 1) if kind == "gray" else number
    table = (number >> np.arange(bits)[::-1, None] & 1).astype(np.bool_)
    finest_first = np.argsort(-np.count_nonzero(rows[:, 1:] != rows[:, :-1], axis=1), kind="stable")
    places = np.arange((1 << bits) - length + 1)
    for row, bit in zip(finest_first, range(bits - 1, -1, -1), strict=True):
        there = sliding_window_view(table[bit], length)[places]
        places = places[((there ^ there[:, :1]) == rows[row]).all(axis=1)]
    if not len(places):
        return None
    first = int(places[0])
    bit_of = np.empty(bits, np.intp)
    bit_of[finest_first] = np.arange(bits)[::-1]
    told = bit_of[which.ravel()]
    inverse = table[told, first] ^ seen[:, 0]
    codes = [Code(kind, axis, int(bit), bits, cell, bool(other)) for bit, other in zip(told, inverse, strict=True)]
    return codes, first * cell - int(begins[0])
