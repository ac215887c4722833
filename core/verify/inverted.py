"""Bits of a Gray code that are inverted, told by the edges of the coarser ones.

Where a bit of a reflected Gray code changes, the next finer one is on and all others below are off. That holds at every
edge of any surface, whatever the projector's lines; steps of depth rarely change one bit alone. A bit that is off where
it should be on was described, or shown, the other way round: all coordinates are mirrored within its blocks then, and
no frame contradicts another one.
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


@dataclass(frozen=True)
class Told:
    """How many edges bits have, and at how many (i) finer ones (j) are as Gray codes have them, and reversed."""

    edges: NDArray[np.int64]
    right: NDArray[np.int64]
    wrong: NDArray[np.int64]

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


def inverted_bits(patterns: Sequence[Pattern], images: Sequence[NDArray]) -> list[Finding]:
    """Find bits that are inverted; findings on whole codes name no frames."""
    found = []
    axes: tuple[Axis, ...] = ("x", "y")
    for axis in axes:
        frames = {(p.bit, p.inverse): k for k, p in enumerate(patterns) if isinstance(p, Code) and p.axis == axis}
        codes = [p for p in patterns if isinstance(p, Code) and p.axis == axis]
        numbers = sorted({p.bit for p in codes})
        if {p.kind for p in codes} != {"gray"} or len(numbers) < 3 or numbers != [*range(len(numbers))]:
            continue
        shown = [k for k, p in enumerate(patterns) if axis_of(p) in (axis, None)]
        turned, upright = _told(frames, shown, images, len(numbers)).inverted()
        if not turned:
            continue
        along, whole = "columns" if axis == "x" else "rows", len(turned) > 1 and not upright
        shots = tuple(sorted(k for (bit, _), k in frames.items() if bit in turned and not whole))
        which, those = (", ".join(map(str, each)) for each in (turned, shots))
        if whole:  # of the coarsest one no edges tell
            text = f"frames across {along}: they fit if the code is inverted"
        elif len(turned) > 1:
            text = f"frames across {along}: they fit if bits {which} of the code are inverted: frames {those}"
        elif len(shots) == 1:
            text = f"frames across {along}: they fit if bit {which} of the code is inverted: frame {those}"
        else:
            text = f"frames across {along}: they fit if bit {which} of the code is inverted: frames {those}"
        found.append(Finding("identity", "bad", text, shots=shots, names="mistake"))
    return found


def _told(frames: dict[tuple[int, bool], int], shown: Sequence[int], images: Sequence[NDArray], bits: int) -> Told:
    """Look at edges of bits along some rows and columns; `frames` are numbers of bits and of their inverses.

    `shown` are the frames that tell how dark and bright a pixel is.
    """
    told = Told(np.zeros(bits, np.int64), *np.zeros((2, bits, bits), np.int64))
    for turned in (False, True):
        light, contrast = _lights(frames, {k: _sections(images[k], turned) for k in shown}, bits)
        least = np.maximum(CLEAR * contrast, np.float32(BRIGHT * CLEAR * quantile_of(contrast, 0.97)))
        state = (light > least).astype(np.int8) - (light < -least)
        clear = np.where(state != 0, np.arange(state.shape[2], dtype=np.int32), np.int32(-BLURRED))
        last = np.maximum.accumulate(clear, axis=2)[..., :-1]
        bit, row, before = np.nonzero((state[..., 1:] != 0) & (np.arange(state.shape[2] - 1) - last < BLURRED))
        start, end = last[bit, row, before], before + 1
        both = state[:, row, start] * state[:, row, end] < 0
        alone = both[bit, np.arange(len(bit))] & (np.count_nonzero(both, axis=0) == 1)
        beside = state[:, row[alone], (start + end)[alone] // 2]
        for i in range(bits):
            on, off = (np.count_nonzero(beside[i + 1 :, bit[alone] == i] == way, axis=1) for way in (1, -1))
            told.edges[i] += np.count_nonzero(bit[alone] == i)
            told.right[i, i + 1 :] += np.append(on[:1], off[1:])
            told.wrong[i, i + 1 :] += np.append(off[:1], on[1:])
    return told


def _sections(image: NDArray, turned: bool) -> NDArray:
    """Some rows of an image, or columns as rows."""
    image = image.T if turned else image
    return np.ascontiguousarray(image[:: -(-len(image) // SECTIONS)], np.float32)


def _lights(frames: dict[tuple[int, bool], int], grey: dict[int, Grey], bits: int) -> tuple[Grey, Grey]:
    """How much brighter than the middle light bits are shown, (bits, rows, columns), and the contrast of pixels."""
    dark, bright = (reduce(choose, grey.values()) for choose in (np.minimum, np.maximum))
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
