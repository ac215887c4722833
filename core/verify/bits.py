"""Bits of a Gray code that are inverted or of another image, told by the edges of the coarser ones.

Where a bit of a reflected Gray code changes, the next finer one is on and all others below are off. That holds at every
edge of any surface, whatever the projector's lines; steps of depth rarely change one bit alone. A bit that is off where
it should be on was described, or shown, the other way round: all coordinates are mirrored within its blocks then, and
no frame contradicts another one. Of a frame that was mirrored, or of another scene, edges of the others tell nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model.finding import Finding
from core.numerics import quantile_of
from core.patterns import Axis, Code, Pattern, axis_of

Grey = NDArray[np.float32]

SECTIONS = 50  # rows and columns of an image that are looked at
BLURRED = 16  # px at most, over which an edge may reach
BRIGHT = 0.3  # of nearly the highest contrast
CLEAR = 0.2  # of a pixel's contrast, from its middle: a bit is on or off
LEAST = 8  # edges that tell
SEEN, FEW = 0.5, 0.1  # of the coarser edges, at which a bit is on or off; of their number, that it has
SHARE = 0.85  # of them that agree; of sound captures 0.95
FOREIGN = 0.75  # of the edges at which a frame of another image may agree with all others, or contradict them


@dataclass(frozen=True)
class Told:
    """How many edges bits have, and at how many (i) finer ones (j) are as Gray codes have them, and reversed."""

    edges: NDArray[np.int64]
    right: NDArray[np.int64]
    wrong: NDArray[np.int64]

    @classmethod
    def of(cls, bit: NDArray[np.intp], both: NDArray[np.bool_], beside: NDArray[np.int8], without: int = -1) -> Told:
        """Count edges (n,) of bits where no other one changes, by all that do, `both`, and what is `beside` (bits, n).

        One bit may be left out of those that change.
        """
        bits = len(both)
        told = cls(np.zeros(bits, np.int64), *np.zeros((2, bits, bits), np.int64))
        others = np.arange(bits) != without
        alone = (np.count_nonzero(both[others], axis=0) == 1) & (bit != without)
        for i in range(bits):
            own = beside[i + 1 :, alone & (bit == i)]
            on, off = (np.count_nonzero(own == way, axis=1) for way in (1, -1))
            told.edges[i] = own.shape[1]
            told.right[i, i + 1 :] = np.append(on[:1], off[1:])
            told.wrong[i, i + 1 :] = np.append(off[:1], on[1:])
        return told

    def foreign(self, bit: int) -> bool:
        """Whether all other bits are as they should be at each other's edges, and this one is anything there."""
        both = self.right + self.wrong
        count = both[:, bit].sum()
        if count < 2 * LEAST or max(self.right[:, bit].sum(), self.wrong[:, bit].sum()) > FOREIGN * count:
            return False
        others = np.arange(len(both)) != bit
        clear = both[:, others] >= LEAST
        fits = self.right[:, others] > SHARE * both[:, others]
        return bool(fits[clear].all() and clear.any(axis=0).sum() > 1)

    def inverted(self) -> tuple[list[int], list[int]]:
        """Bits that are inverted, 0 the coarsest, and those that are not, as far as all coarser edges agree on each."""
        both = self.right + self.wrong
        turned: list[int] = []
        upright: list[int] = []
        for j in range(1, len(both)):
            told = both[:j, j] >= LEAST
            unclear = told.any() and both[:j, j].sum() < SEEN * self.edges[:j].sum()
            if unclear or self.edges[j:].max() < FEW * self.edges[:j].max():
                break  # too fine for the camera: grey, or hardly any edges where there should be twice as many
            wrong = self.wrong[:j, j][told] > SHARE * both[:j, j][told]
            right = self.right[:j, j][told] > SHARE * both[:j, j][told]
            if not (wrong.all() or right.all()):
                return [], []  # they are other frames
            if told.any():
                (turned if wrong.all() else upright).append(j)
        return turned, upright


def wrong_bits(patterns: Sequence[Pattern], images: Sequence[NDArray]) -> list[Finding]:
    """Find bits that are inverted, or of another image."""
    found = []
    axes: tuple[Axis, ...] = ("x", "y")
    for axis in axes:
        frames = {(p.bit, p.inverse): k for k, p in enumerate(patterns) if isinstance(p, Code) and p.axis == axis}
        codes = [p for p in patterns if isinstance(p, Code) and p.axis == axis]
        numbers = sorted({p.bit for p in codes})
        if {p.kind for p in codes} != {"gray"} or len(numbers) < 3 or numbers != [*range(len(numbers))]:
            continue
        shown = [k for k, p in enumerate(patterns) if axis_of(p) in (axis, None)]
        turned, upright = Told.of(*_edges(frames, shown, images, len(numbers))).inverted()
        bits = turned
        if not turned:  # a frame of another image lights what the others do not
            edges = _edges(frames, shown, images, len(numbers), rank=-2)
            bits = [bit for bit in numbers[1:] if Told.of(*edges, without=bit).foreign(bit)]
            if len(bits) != 1:
                continue
        shots = tuple(sorted(k for (bit, _), k in frames.items() if bit in bits))
        told = _inverted(bits, shots, whole=len(turned) > 1 and not upright) if turned else _foreign(shots)
        along = "columns" if axis == "x" else "rows"
        found.append(Finding("identity", "bad", f"frames across {along}: {told}", shots=shots, names="mistake"))
    return found


def _inverted(bits: Sequence[int], shots: Sequence[int], whole: bool) -> str:
    which, those = (", ".join(map(str, each)) for each in (bits, shots))
    if whole:  # of the coarsest one no edges tell
        return "they fit if the code is inverted"
    if len(bits) > 1:
        return f"they fit if bits {which} of the code are inverted, frames {those}"
    if len(shots) == 1:
        return f"they fit if bit {which} of the code is inverted, frame {those}"
    return f"they fit if bit {which} of the code is inverted, frames {those}"


def _foreign(shots: Sequence[int]) -> str:
    why = "mirrored, moved, or of another capture; record again"
    if len(shots) == 1:
        return f"frame {shots[0]} does not fit the edges of the other bits: {why}"
    return f"frames {shots[0]} and {shots[-1]} do not fit the edges of the other bits: {why}"


def _edges(
    frames: dict[tuple[int, bool], int], shown: Sequence[int], images: Sequence[NDArray], bits: int, rank: int = -1
) -> tuple[NDArray[np.intp], NDArray[np.bool_], NDArray[np.int8]]:
    """Look at edges of bits along some rows and columns; `frames` are numbers of bits and of their inverses.

    `shown` are the frames that tell how dark and bright a pixel is, by that of the `rank`. Of each edge: its bit, all
    that change there (bits, n), and which are on there, 1, and off, -1 (bits, n).
    """
    found = []
    for turned in (False, True):
        light, contrast = _lights(frames, {k: _sections(images[k], turned) for k in shown}, bits, rank)
        least = np.maximum(CLEAR * contrast, np.float32(BRIGHT * CLEAR * quantile_of(contrast, 0.97)))
        state = (light > least).astype(np.int8) - (light < -least)
        clear = np.where(state != 0, np.arange(state.shape[2], dtype=np.int32), np.int32(-BLURRED))
        last = np.maximum.accumulate(clear, axis=2)[..., :-1]
        bit, row, before = np.nonzero((state[..., 1:] != 0) & (np.arange(state.shape[2] - 1) - last < BLURRED))
        start, end = last[bit, row, before], before + 1
        own = state[bit, row, start] * state[bit, row, end] < 0
        bit, row, start, end = bit[own], row[own], start[own], end[own]
        both = state[:, row, start] * state[:, row, end] < 0
        found.append((bit, both, state[:, row, (start + end) // 2]))
    (bit, both, beside), more = found
    return np.append(bit, more[0]), np.hstack([both, more[1]]), np.hstack([beside, more[2]])


def _sections(image: NDArray, turned: bool) -> NDArray:
    """Some rows of an image, or columns as rows."""
    image = image.T if turned else image
    return np.ascontiguousarray(image[:: -(-len(image) // SECTIONS)], np.float32)


def _lights(frames: dict[tuple[int, bool], int], grey: dict[int, Grey], bits: int, rank: int) -> tuple[Grey, Grey]:
    """How much brighter than the middle light bits are shown, (bits, rows, columns), and the contrast of pixels."""
    dark, bright = (reduce(choose, grey.values()) for choose in (np.minimum, np.maximum))
    if rank != -1:
        bright = np.partition(np.stack(list(grey.values())), rank, axis=0)[rank]
    middle = (dark + bright) / 2
    light = np.empty((bits, *middle.shape), np.float32)
    for bit, seen in enumerate(light):
        on, off = (grey.get(frames.get((bit, inverse), -1)) for inverse in (False, True))
        if on is not None and off is not None:
            seen[:] = (on - off) / 2
        elif on is not None:
            seen[:] = on - middle
        elif off is not None:
            seen[:] = middle - off
    return light, bright - dark
