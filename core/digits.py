"""How many digits of a length are written: rigs may be a thousand times smaller than a desk. Mistaken units."""

from __future__ import annotations

from math import floor, isfinite, log10

UNITS = {0.1: "cm", 1 / 25.4: "inches", 0.001: "m", 1000.0: "µm"}  # numbers in a unit over those in mm


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


def unit_hint(*ratios: float, within: float = 0.02) -> str:
    """Ask for the unit where a length that is given, over the true one, is that of another unit over mm."""
    units = [unit for factor, unit in UNITS.items() if any(abs(ratio / factor - 1) < within for ratio in ratios)]
    return f"; is it in {' or '.join(units)} instead of mm?" if units else ""
