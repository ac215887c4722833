"""Interior orientations referred to another radius r0, so that parameters of two calibrations can be compared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from core.model import INTERIOR_NAMES, Interior

KEYS = ("c_mm", "x0_mm", "y0_mm", *INTERIOR_NAMES[3:])  # as result files name the nine parameters


def interior_from_mapping(values: Mapping[str, Any]) -> Interior:
    """Read an interior orientation from the keys of a result file; a parameter may be ``{"value": …}``.

    A parameter that is absent is NaN; an absent `r0_mm` too.
    """

    def number(key: str) -> float:
        value = values.get(key)
        value = value.get("value") if isinstance(value, Mapping) else value
        return float("nan") if value is None else float(value)

    return Interior.from_vector(np.array([number(key) for key in KEYS]), number("r0_mm"))


def at_radius(interior: Interior, r0_mm: float) -> Interior:
    """Give the same imaging with the radial terms' zero crossing at another radius.

    Notes
    -----
    Image coordinates scale with c, so a change of r0 leaves ``c (1 - A1 r0² - A2 r0⁴)``, ``c³ A1``, ``c⁵ A2``,
    ``c² A5`` and ``c² A6`` alone. c follows from the first by Newton's method.

    Examples
    --------
    >>> moved = at_radius(Interior(12.0, a=(-6e-4, 0, 0, 0, 0, 0), r0_mm=2.5), 0.0)
    >>> round(moved.c_mm, 6)  # 12 (1 + 6e-4 · 2.5²)
    12.045
    """
    if interior.r0_mm == r0_mm:
        return interior
    a1, a2, a3, a4, a5, a6 = interior.a
    c, old2, new2 = interior.c_mm, interior.r0_mm**2, r0_mm**2
    central = c * (1 - a1 * old2 - a2 * old2**2)
    k1, k2 = a1 * c**3, a2 * c**5
    new = central
    for _ in range(20):
        f = new - k1 * new2 / new**2 - k2 * new2**2 / new**4 - central
        new -= f / (1 + 2 * k1 * new2 / new**3 + 4 * k2 * new2**2 / new**5)
    s = c / new
    return Interior(new, interior.x0_mm, interior.y0_mm, (a1 * s**3, a2 * s**5, a3, a4, a5 * s**2, a6 * s**2), r0_mm)
