"""Every pixel's curve z(u): polynomials by least squares, or the table."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import inner, njit
from core.lazy import dataclass
from core.model import Array, Floats
from core.numerics.small import solve_in_place
from core.parallel import run_in_bands

LEAST_STEP_LINES = 0.05  # u must change by so much from one position to the next, else nothing moved


@dataclass(frozen=True)
class Curves:
    """The curves of all pixels."""

    coefficients: Floats  #: (degree + 1, H, W), lines: as in `core.model.DepthCalibration`
    u_range: Floats  #: (2, H, W): least and greatest calibrated u, NaN where the pixel has no curve
    #: squares, count: (H, W): sum of the squared residuals in mm² and their number
    squares: Floats
    count: NDArray[np.uint8]
    not_monotonic: int  #: pixels left out because u does not rise or fall steadily with the position


def fit_curves(depths_mm: Array, used: Floats, measured: Floats, degree: int | None, least: int) -> Curves:
    """Fit every pixel of at least `least` planes, at rising depths, its curve.

    `used`, (planes, H, W), NaN where invalid, is fitted; by `measured`, unsmoothed, the residuals are judged. With a
    `degree` a polynomial z(t), t = (u - centre) / half, in which all planes have the same weight: the sigma of u,
    estimated from a few frames, varies more by its own uncertainty than from plane to plane. Without, the table of u at
    every plane, gaps between two closed by interpolation; the residual of an inner plane is taken against the straight
    line between its neighbours.
    """
    planes, height, width = used.shape
    coefficients = np.full((planes if degree is None else degree + 1, height, width), np.nan, np.float32)
    u_range = np.full((2, height, width), np.nan, np.float32)
    squares, count = np.zeros((height, width), np.float32), np.zeros((height, width), np.uint8)
    broken = np.zeros(height, np.int64)
    given = depths_mm, used, measured, least, coefficients, u_range, squares, count, broken
    fit = _table_rows if degree is None else _fit_rows
    run_in_bands(lambda start, stop: fit(*given, start, stop), height)
    return Curves(coefficients, u_range, squares, count, int(broken.sum()))


@inner
def _steady(u, n):  # type: ignore[no-untyped-def]
    """Whether the first n values rise or fall steadily."""
    rising = u[n - 1] > u[0]
    for i in range(1, n):
        step = u[i] - u[i - 1] if rising else u[i - 1] - u[i]
        if not step >= LEAST_STEP_LINES:
            return False
    return True


@inner
def _gather(depths, used, r, c, least, u, z):  # type: ignore[no-untyped-def]
    """A pixel's valid values, and their number; 0 where they are too few, -1 where they are not steady."""
    n = 0
    for i in range(len(depths)):
        if np.isfinite(used[i, r, c]):
            u[n], z[n] = used[i, r, c], depths[i]
            n += 1
    if n < least:
        return 0
    return n if _steady(u, n) else -1


@inner
def _value(t, terms, b):  # type: ignore[no-untyped-def]
    z = 0.0
    for k in range(terms - 1, -1, -1):
        z = z * t + b[k]
    return z


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_rows(depths, used, measured, least, coefficients, u_range, squares, count, broken, start, stop):  # type: ignore[no-untyped-def]
    """Fit the polynomials of rows start to stop - 1."""
    planes, terms = used.shape[0], coefficients.shape[0]
    u, z = np.empty(planes), np.empty(planes)
    N, b, power = np.empty((terms, terms)), np.empty(terms), np.empty(2 * terms)
    for r in range(start, stop):
        for c in range(used.shape[2]):
            n = _gather(depths, used, r, c, least, u, z)
            if n <= 0:
                broken[r] += n < 0
                continue
            low, high = min(u[0], u[n - 1]), max(u[0], u[n - 1])
            centre, half = 0.5 * (low + high), 0.5 * (high - low)
            for k in range(terms):
                b[k] = 0.0
                for m in range(k + 1):
                    N[k, m] = 0.0
            for i in range(n):
                t = (u[i] - centre) / half
                power[0] = 1.0
                for k in range(1, 2 * terms - 1):
                    power[k] = power[k - 1] * t
                for k in range(terms):
                    b[k] += power[k] * z[i]
                    for m in range(k + 1):
                        N[k, m] += power[k + m]
            if not solve_in_place(N, b):
                continue
            for i in range(planes):
                if np.isfinite(measured[i, r, c]):
                    rest = _value((measured[i, r, c] - centre) / half, terms, b) - depths[i]
                    squares[r, c] += rest * rest
                    count[r, c] += 1
            u_range[0, r, c], u_range[1, r, c] = low, high
            for k in range(terms):
                coefficients[k, r, c] = b[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _table_rows(depths, used, measured, least, table, u_range, squares, count, broken, start, stop):  # type: ignore[no-untyped-def]
    """Make the tables of rows start to stop - 1."""
    planes = used.shape[0]
    u, z = np.empty(planes), np.empty(planes)
    for r in range(start, stop):
        for c in range(used.shape[2]):
            n = _gather(depths, used, r, c, least, u, z)
            if n <= 0:
                broken[r] += n < 0
                continue
            k = 0
            for i in range(planes):
                if depths[i] < z[0] or depths[i] > z[n - 1]:
                    continue
                while k < n - 2 and depths[i] > z[k + 1]:
                    k += 1
                table[i, r, c] = u[k] + (u[k + 1] - u[k]) * (depths[i] - z[k]) / (z[k + 1] - z[k])
            u_range[0, r, c], u_range[1, r, c] = min(u[0], u[n - 1]), max(u[0], u[n - 1])
            for i in range(1, planes - 1):
                before, after = np.float64(table[i - 1, r, c]), np.float64(table[i + 1, r, c])
                if np.isfinite(measured[i, r, c]) and np.isfinite(before) and np.isfinite(after):
                    share = (measured[i, r, c] - before) / (after - before)
                    rest = depths[i - 1] + share * (depths[i + 1] - depths[i - 1]) - depths[i]
                    squares[r, c] += rest * rest
                    count[r, c] += 1
