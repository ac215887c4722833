"""Limits that chance alone exceeds with a given probability, and the error function.

SciPy has all of them, and takes as long to import as numpy, OpenCV and numba together. Sources: Abramowitz and Stegun,
*Handbook of Mathematical Functions*, 6.5.29, 6.5.31, 26.5.8; the continued fractions by Lentz's method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

_TINY = 1e-300
_MOST_TERMS, _MOST_STEPS = 100_000, 200

_erf = np.frompyfunc(math.erf, 1, 1)


def erf(x: ArrayLike) -> NDArray[np.float64]:
    """Error function of every element; for tables, not for images."""
    return np.asarray(_erf(np.asarray(x, np.float64)), np.float64)


def normal_limit(level: float) -> float:
    """Value that a standard normal deviate exceeds with probability `level`.

    Examples
    --------
    >>> round(normal_limit(0.025), 3)
    1.96
    """
    if level > 0.5:
        return -normal_limit(1 - level)
    return _where(lambda x: math.erfc(x / math.sqrt(2)) / 2, level, 1.0)


def chi_square_limit(redundancy: float, level: float) -> float:
    """Value that the sum of `redundancy` squared normal deviates exceeds with probability `level`.

    Examples
    --------
    >>> round(chi_square_limit(10, 0.05), 3)
    18.307
    """
    return 2 * _where(lambda x: _gamma_above(redundancy / 2, x), level, redundancy / 2)


def fisher_limit(first: float, second: float, level: float) -> float:
    """Value that the ratio of two mean squares of `first` and `second` degrees of freedom exceeds with `level`.

    Examples
    --------
    >>> round(fisher_limit(5, 10, 0.05), 3)
    3.326
    """
    return _where(lambda f: fisher_above(first, second, f), level, 1.0)


def fisher_above(first: float, second: float, value: float) -> float:
    """Probability that the ratio of two mean squares of `first` and `second` degrees of freedom exceeds `value`.

    Examples
    --------
    >>> round(fisher_above(5, 10, 3.326), 3)
    0.05
    """
    return _beta_below(second / 2, first / 2, second / (second + first * value))


def _where(above: Callable[[float], float], level: float, near: float) -> float:
    """Where a function that falls to 0 over the positive numbers equals `level`, by Ridders' method from `near` on.

    Ridders, *A new algorithm for computing a single root*, IEEE Trans. Circuits Syst. 26 (1979).
    """
    low, high, found = 0.0, near, math.inf
    at_low, at_high = above(low) - level, above(high) - level
    while at_high > 0:
        low, at_low, high = high, at_high, 2 * high
        at_high = above(high) - level
    for _ in range(_MOST_STEPS):
        middle, before = (low + high) / 2, found
        at_middle = above(middle) - level
        found = middle + (middle - low) * at_middle / (math.sqrt(at_middle**2 - at_low * at_high) or _TINY)
        at_found = above(found) - level
        if at_found == 0 or abs(found - before) <= 1e-13 * found:
            break
        for x, value in ((middle, at_middle), (found, at_found)):
            if value > 0 and x > low:
                low, at_low = x, value
            elif value <= 0 and x < high:
                high, at_high = x, value
    return found


def _gamma_above(a: float, x: float) -> float:
    """Upper regularised incomplete gamma function."""
    if x <= 0:
        return 1.0
    front = math.exp(a * math.log(x) - x - math.lgamma(a))
    if x < a + 1:
        term = total = 1 / a
        for n in range(1, _MOST_TERMS):
            term *= x / (a + n)
            total += term
            if term < 1e-16 * total:
                break
        return 1 - front * total
    steps = ((-n * (n - a), x + 2 * n + 1 - a) for n in range(1, _MOST_TERMS))
    return front / _continued(x + 1 - a, steps)


def _beta_below(a: float, b: float, x: float) -> float:
    """Lower regularised incomplete beta function."""
    if x <= 0 or x >= 1:
        return float(x >= 1)
    front = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    if x > (a + 1) / (a + b + 2):
        return 1 - _beta_below(b, a, 1 - x)

    def steps() -> Iterator[tuple[float, float]]:
        for m in range(_MOST_TERMS):
            yield -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)), 1.0
            n = m + 1
            yield n * (b - n) * x / ((a + 2 * n - 1) * (a + 2 * n)), 1.0

    return math.exp(front) / a / _continued(1.0, steps())


def _continued(first: float, steps: Iterator[tuple[float, float]]) -> float:
    """Evaluate b0 + a1 / (b1 + a2 / (b2 + ...)) by the modified method of Lentz."""
    value = numerator = first or _TINY
    denominator = 0.0
    for a, b in steps:
        denominator = 1 / ((b + a * denominator) or _TINY)
        numerator = (b + a / numerator) or _TINY
        value *= numerator * denominator
        if abs(numerator * denominator - 1) < 1e-15:
            break
    return value
