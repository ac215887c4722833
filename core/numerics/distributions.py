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
_MOST_TERMS = 100_000

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
    from statistics import NormalDist  # brings decimals and fractions along

    return -NormalDist().inv_cdf(level)


def chi_square_limit(redundancy: float, level: float) -> float:
    """Value that the sum of `redundancy` squared normal deviates exceeds with probability `level`.

    Examples
    --------
    >>> round(chi_square_limit(10, 0.05), 3)
    18.307
    """
    return 2 * _where(lambda x: _gamma_above(redundancy / 2, x), level)


def fisher_limit(first: float, second: float, level: float) -> float:
    """Value that the ratio of two mean squares of `first` and `second` degrees of freedom exceeds with `level`.

    Examples
    --------
    >>> round(fisher_limit(5, 10, 0.05), 3)
    3.326
    """
    return _where(lambda f: fisher_above(first, second, f), level)


def fisher_above(first: float, second: float, value: float) -> float:
    """Probability that the ratio of two mean squares of `first` and `second` degrees of freedom exceeds `value`.

    Examples
    --------
    >>> round(fisher_above(5, 10, 3.326), 3)
    0.05
    """
    return _beta_below(second / 2, first / 2, second / (second + first * value))


def _where(above: Callable[[float], float], level: float) -> float:
    """Where a function that falls from 1 to 0 over the positive numbers equals `level`."""
    low, high = 0.0, 1.0
    while above(high) > level:
        low, high = high, 2 * high
    while high - low > 1e-13 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if above(middle) > level else (low, middle)
        if middle in (low, high) and high - low <= math.ulp(high):
            break
    return (low + high) / 2


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
