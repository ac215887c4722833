"""What grey values tell of the camera: their step, and whether they end below full scale."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

LEVELS = 256  # parts of the grey values
PILE, PILED = 0.002, 3.0  # part of the grey values at the highest, and times those just below, from which it is an end
NOISELESS = 8  # times as many of the most frequent grey value as of the next: noise of half a step leaves 4


def quantum(grey: NDArray[Any]) -> float:
    """The step of the grey values: the power of two that divides all (12-bit data are often shifted to 16 bits)."""
    bits = int(np.bitwise_or.reduce(grey.astype(np.int64), axis=None))
    return float(bits & -bits) if bits else 1.0


def cut_off(grey: NDArray[Any]) -> bool:
    """Whether grey values pile up at the highest of them, as in a camera that ends there, and nowhere else.

    Without noise those of evenly bright surfaces pile up, too.
    """
    highest = grey.max()
    at = np.count_nonzero(grey == highest)
    if at <= PILE * grey.size:
        return False
    step = quantum(grey)
    if at <= PILED * (np.count_nonzero(grey >= highest - max(step, highest / LEVELS)) - at):
        return False
    values, counts = np.unique(grey[grey < highest], return_counts=True)
    if not len(values):
        return False
    most = int(counts.argmax())
    beside = counts[np.abs(values - values[most]) == step].max(initial=0)
    return bool(counts[most] < NOISELESS * beside)
