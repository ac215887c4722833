"""What decoding returns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model.arrays import Array, Floats


@dataclass(frozen=True)
class PhaseMap:
    """Projector coordinates of every camera pixel; all arrays have shape (H, W).

    `u`, `v` are in projector lines, NaN where invalid (all NaN for an axis without patterns), `sigma_u`, `sigma_v`
    their standard deviations in lines. `modulation` and `image` (the scene lit evenly) are in grey values. `flags` says
    why a pixel is invalid: bits of `core.decode.Flag`.

    `response` (k, 2) is the curve of level and light (0 to 1) that sine fringes were found to be projected with, None
    where they are as good as straight. `misfit`, where coordinates were refined by all frames, is the mean squared
    residual of a pixel's frames over its expectation: far above 1 where it sees motion, two surfaces, or light by
    detours. `notes` (`Note`) say in sentences what is wrong with the capture, and the remedy.
    `gaps` is the share of grey values that no frame takes although frames take values just below and above; None where
    nobody asked.
    """

    u: Floats
    v: Floats
    sigma_u: Floats
    sigma_v: Floats
    modulation: Floats
    image: Floats
    flags: NDArray[np.uint8]
    response: Array | None = None
    misfit: Floats | None = None
    notes: tuple[str, ...] = ()
    camera: str = "camera"
    projector: str = "projector"
    gaps: float | None = None
