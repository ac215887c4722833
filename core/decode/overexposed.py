"""The evenly lit image of pixels that are at full scale in some frames.

Cut off at full scale, the mean of phase steps depends on the phase: bright targets show the fringes, and their centres
move by some hundredths of a pixel. The steps below full scale tell what the others, and white, would be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image, SortedFrames
from core.decode.tables import Rows, Singles
from core.patterns import grey_reason

STEEPEST = 3.0  # condition of the steps that are left, from which they tell too little
SOME, FEWEST = 20000, 100  # pixels below full scale that tell the share
DIM = 0.3  # part of the brightest pixels' amplitude that these must have


def relight(
    image: Singles, images: Sequence[Image], frames: SortedFrames, rows: Rows, saturation: float
) -> NDArray[np.bool_] | None:
    """Correct the even image (H, W), the `rows` of all frames, in place where one of these is at full scale.

    The answer (H, W) is where that was not possible, None where there was nothing to correct.
    """
    weights = dict(zip(rows.column[: rows.first[1]].tolist(), rows.value[: rows.first[1]].tolist(), strict=True))
    phases = [p for axis in frames.axes.values() for p in axis.phases if None not in map(grey_reason, p.patterns)]
    # white is the brightest
    if not weights or all(images[n].max() < saturation for n in frames.white or weights):
        return None
    cut = np.any([images[n] >= saturation for n in weights], axis=0).ravel()
    if not phases:
        return cut.reshape(image.shape)
    whole, left = np.flatnonzero(~cut), np.flatnonzero(cut)
    whole = whole[:: max(1, len(whole) // SOME)]
    more, nothing = np.zeros(len(left), np.float32), np.full(len(left), np.nan, np.float32)
    middle, on = nothing, nothing
    steps = {n for phase in phases for n in phase.frames}
    others = [n for n in weights if n not in steps]  # white, and bits with their inverses, of which half are on
    lit = [n for n in frames.white if n in weights]
    bright = _at(images, lit, whole) if lit else np.sort(_at(images, others, whole), axis=0)[len(others) // 2 :]
    for phase in sorted(phases, key=lambda p: -len(p.frames)):
        shift = np.array([p.shift_rad for p in phase.patterns])
        terms = np.column_stack([np.ones_like(shift), np.cos(shift), np.sin(shift)])
        seen = _at(images, phase.frames, left)
        fitted = _fitted(seen, terms, saturation)
        told = np.isfinite(fitted[0])
        for n, grey, wave in zip(phase.frames, seen, terms @ fitted, strict=True):
            better = np.where(told, np.where(grey >= saturation, wave, grey), middle)  # the same middle for all periods
            more += np.float32(weights.get(n, 0.0)) * (better - grey).astype(np.float32)
        share = _share(_fitted(_at(images, phase.frames, whole), terms, saturation), bright)
        middle = np.where(np.isfinite(middle), middle, fitted[0])
        on = np.where(np.isfinite(on), on, fitted[0] + share * np.hypot(fitted[1], fitted[2]))
    for n, grey in zip(others, _at(images, others, left), strict=True):
        more += np.float32(weights[n]) * np.where(grey >= saturation, on - grey, 0).astype(np.float32)
    image.reshape(-1)[left] += np.where(np.isfinite(more), more, 0)
    cut[left] = ~np.isfinite(more)
    return cut.reshape(image.shape)


def _at(images: Sequence[Image], numbers: Sequence[int], pixels: NDArray[np.intp]) -> Singles:
    """Grey values (frames, n)."""
    return np.array([images[n].reshape(-1)[pixels] for n in numbers], np.float32).reshape(len(numbers), len(pixels))


def _share(fitted: Singles, white: Singles) -> np.float32:
    """By how many amplitudes white is above the mean of the fringes; NaN where too few pixels tell."""
    amplitude = np.hypot(fitted[1], fitted[2])
    told = np.flatnonzero(amplitude > 0)
    if not len(white) or len(told) < FEWEST:
        return np.float32(np.nan)
    bright = told[amplitude[told] > DIM * np.quantile(amplitude[told], 0.9)]
    lit = np.median(white[:, bright], axis=0)  # bits may be at their edges
    return np.float32(np.median((lit - fitted[0, bright]) / amplitude[bright]))


def _fitted(grey: Singles, terms: NDArray[np.float64], saturation: float) -> Singles:
    """Mean, cosine and sine (3, n) of fringes from the steps (steps, n) below full scale; NaN where untold."""
    found = np.full((3, grey.shape[1]), np.nan, np.float32)
    for steps, pixels in _alike(grey < saturation):
        if steps.sum() >= terms.shape[1] and np.linalg.cond(terms[steps]) < STEEPEST:
            found[:, pixels] = np.linalg.pinv(terms[steps]) @ grey[np.ix_(steps, pixels)]
    return found


def _alike(below: NDArray[np.bool_]) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.intp]]]:
    """Pixels by which steps (steps, n) they have."""
    packed = np.packbits(below, axis=0)
    key = np.ascontiguousarray(packed.T).view(np.dtype((np.void, packed.shape[0]))).ravel()
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.append(True, key[order][1:] != key[order][:-1])) if len(order) else np.zeros(0, int)
    for pixels in np.split(order, starts[1:]) if len(order) else ():
        yield below[:, pixels[0]], pixels
