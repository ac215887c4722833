"""What decoding returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.model.arrays import Floats


@dataclass(frozen=True)
class PhaseMap:
    """Projector coordinates of every camera pixel; all arrays have shape (H, W).

    `u`, `v` are in projector lines, NaN where invalid (all NaN for an axis without patterns), `sigma_u`, `sigma_v`
    their standard deviations in lines. `modulation` and `image` (the scene lit evenly) are in grey values. `flags` says
    why a pixel is invalid: bits of `core.decode.Flag`.
    """

    u: Floats
    v: Floats
    sigma_u: Floats
    sigma_v: Floats
    modulation: Floats
    image: Floats
    flags: NDArray[np.uint8]
