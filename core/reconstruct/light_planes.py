"""Points that do not lie where their label's light is, as all other points tell where that is.

A projector's line i lights a plane, so that its coordinate follows from a point by a fraction of two linear forms,
``L = (a0 + a X) / (1 + b X)``, seven numbers that the points themselves give. What its lens bends is smooth over the
image: a cubic of label and place takes it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.model import Array
from core.numerics import quantile_of, sigma_by_median, spaced

FEWEST = 100  # points that tell light planes
SAMPLES = 20_000
STEPS = 6
STIFF = 1e-6  # keeps what no point tells small: on one plane, all but a few combinations of the seven
TYPICAL, TIMES, BESIDE_LINES = 0.95, 4.0, 1.0  # off is what exceeds so many times this quantile, and a line


def off_their_planes(xyz_mm: Array, lines: Array, place: Array) -> NDArray[np.bool_]:
    """Whether points (n, 3) are off the light of their labels (n,), by more than most; `place` (n,) is any across."""
    if len(lines) < FEWEST:
        return np.zeros(len(lines), bool)
    some = spaced(len(lines), SAMPLES)
    x, label, at = (_scaled(values, some) for values in (xyz_mm, lines, place))
    A = np.column_stack([np.ones(len(x)), x, -label[:, None] * x])
    p = _fitted(A[some], label[some])
    rest = (A @ p - label) / (1 + x @ p[4:])
    B = np.column_stack([at**i * label**j for i in range(4) for j in range(4 - i)])
    rest -= B @ _fitted(B[some], rest[some])
    off = np.abs(rest) * np.std(lines[some])
    return np.asarray(off > TIMES * quantile_of(off[some], TYPICAL) + BESIDE_LINES)


def _scaled(values: Array, some: NDArray) -> Array:
    return np.asarray((values - values[some].mean(axis=0)) / values[some].std(axis=0).max())


def _fitted(A: Array, y: Array) -> Array:
    """Least squares that a minority of gross errors does not move."""
    weight = np.ones(len(y))
    for _ in range(STEPS):
        W = A * weight[:, None]
        p = np.linalg.solve(W.T @ A + STIFF * len(y) * np.eye(A.shape[1]), W.T @ y)
        rest = A @ p - y
        weight = 1 / (1 + (rest / max(3 * sigma_by_median(rest), 1e-9)) ** 2) ** 2
    return np.asarray(p)
