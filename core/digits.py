"""How many digits of a length are written: rigs may be a thousand times smaller than a desk."""

from __future__ import annotations

from math import floor, isfinite, log10


def fixed(value: float, decimals: int, sign: str = "") -> str:
    """Write a length with so many decimals, or more where it would lose all but its first digit.

    Parameters
    ----------
    sign : str
        "+" to write that of positive lengths, too.

    Examples
    --------
    >>> fixed(0.0309, 3), fixed(0.00213, 3), fixed(0.00000213, 3, "+"), fixed(0.0, 3)
    ('0.031', '0.0021', '+0.0000021', '0.000')
    """
    if value and isfinite(value):
        decimals = max(decimals, min(1 - floor(log10(abs(value))), 9))
    return f"{value:{sign}.{decimals}f}"
