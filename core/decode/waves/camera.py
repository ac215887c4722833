"""The camera's own curve: grey values that do not grow evenly with the light, and the way back.

Consumer cameras bend what they record, by a gamma or a tone curve. A pixel's harmonics then depend on its brightness
and on the ambient light, which no response of a projector explains. The curve rises from 0 to saturation and is a
straight line where all its parameters are 0:

    C(s) = s + s (1 - s) sum c_k T_k(2s - 1)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.exposures import DEEPEST, FINEST
from core.decode.frames import Image
from core.model import Array, Note

TERMS = 5
SPREAD = 1.0  # of the parameters over cameras, standard deviation
FLATTEST = 0.05  # slope of a curve
FALL = 0.1  # of full scale: five terms follow a gamma of 2.6 to a tenth, and fall by a fiftieth of that beside 0
STEPS = 4096  # of the light, where a curve is tabulated
TONE = Note(
    "The camera's grey values do not grow evenly with the light: its gamma or tone curve was found in the frames and "
    "taken out. Switch it off, or save raw frames, for less noise.",
    "mended",
)


class Bent(NamedTuple):
    """What a camera makes of light: grey values, slopes by light, and changes by every parameter (..., TERMS)."""

    grey: Array
    slope: Array
    change: Array


def bend(light: Array, curve: Array, full: float) -> Bent:
    """Grey values of light of any shape; both are 0 to `full`, and beyond that the curve goes straight on."""
    x = 2 * np.clip(light / full, 0, 1) - 1
    weight = (1 - x * x) / 4
    terms = np.cos(np.arange(TERMS) * np.arccos(x)[..., None])
    sums = terms @ curve
    steeper = 2 * weight * np.polynomial.chebyshev.chebval(x, np.polynomial.chebyshev.chebder(curve))
    slope = np.maximum(1 - x * sums + steeper, FLATTEST)
    within = full * ((x + 1) / 2 + weight * sums)
    return Bent(within + (light - full * (x + 1) / 2) * slope, slope, full * weight[..., None] * terms)


def rises(curve: Array) -> bool:
    """Whether grey values grow with the light, as those of a camera do; what a fit makes of noise need not."""
    grey = bend(np.linspace(0, 1, STEPS + 1), curve, 1.0).grey
    return bool((np.maximum.accumulate(grey) - grey).max() < FALL)


def unbend(images: Sequence[Image], curve: Array, full: float) -> tuple[list[NDArray[np.uint16]], int]:
    """Give images in even steps of the light, at full scale where they were, and how many these are to a grey value."""
    light = full * np.arange(STEPS + 1) / STEPS
    steps = max(1, min(FINEST, int(DEEPEST / full)))
    seen = np.maximum.accumulate(bend(light, curve, full).grey)
    grey = np.arange(np.iinfo(images[0].dtype).max + 1)
    # no more than full scale where saturated, as means of frames tell the noise
    table = np.where(grey < full, np.rint(steps * np.interp(grey, seen, light)), np.ceil(steps * full))
    table = np.minimum(table, DEEPEST).astype(np.uint16)
    return [table[image] for image in images], steps
