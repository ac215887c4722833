"""Interior orientations as result files hold them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from core.geometry import LENSES
from core.model import Interior


def interior_from_mapping(values: Mapping[str, Any]) -> Interior:
    """Read an interior orientation from the keys of a result file; a parameter may be ``{"value": …}``.

    A parameter that is absent is NaN; an absent `r0_mm` too.
    """

    def number(key: str) -> float:
        value = values.get(key)
        value = value.get("value") if isinstance(value, Mapping) else value
        return float("nan") if value is None else float(value)

    lens = LENSES[values.get("model", "A1..A6")]
    return Interior.from_vector(np.array([number(key) for key in lens.keys]), number("r0_mm"), lens.name)
