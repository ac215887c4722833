"""Colour scales of maps: fixed tables of 256 colours, the same as a widget shows and an image uses."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

# control points, evenly spaced; "map" is viridis, "deviation" blue - white - red with equal steps of lightness
_POINTS = {
    "grey": ["#000000", "#ffffff"],
    "map": [
        "#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725",
    ],
    "deviation": ["#08306b", "#2166ac", "#4393c3", "#92c5de", "#f7f7f7", "#f4a582", "#d6604d", "#b2182b", "#67001f"],
}  # fmt: skip


@cache
def lookup(name: str) -> NDArray[np.uint8]:
    """Give a scale's 256 colours, shape (256, 3).

    Examples
    --------
    >>> lookup("grey")[[0, 255]].tolist()
    [[0, 0, 0], [255, 255, 255]]
    """
    points = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in _POINTS[name]])
    at = np.linspace(0, len(points) - 1, 256)
    return (
        np.stack([np.interp(at, np.arange(len(points)), points[:, i]) for i in range(3)], axis=1)
        .round()
        .astype(np.uint8)
    )


def nice_ticks(low: float, high: float, most: int = 6, *, least: float = 0.0) -> list[float]:
    """Give round numbers between two limits, `most` at most and `least` apart at the least.

    Examples
    --------
    >>> nice_ticks(0, 255, 6)
    [0.0, 50.0, 100.0, 150.0, 200.0, 250.0]
    >>> nice_ticks(0, 2, least=1)
    [0.0, 1.0, 2.0]
    """
    span = high - low
    if not np.isfinite(span) or span <= 0:
        return [low]
    raw = max(span / most, least)
    size = 10.0 ** np.floor(np.log10(raw))
    step = next(size * m for m in (1, 2, 2.5, 5, 10) if size * m >= raw)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(np.round(k * step, 12)) + 0.0 for k in np.arange(first, last + 1)]
