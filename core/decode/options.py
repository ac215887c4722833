"""What the caller may choose, why a pixel can be invalid, and how it is made so."""

from __future__ import annotations

from dataclasses import replace
from enum import IntFlag
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Floats


class Flag(IntFlag):
    """Why a pixel has no coordinate, and which one it lacks; `PhaseMap.flags` holds these bits."""

    LOW_MODULATION = 1
    """Too little light from the projector compared with the noise."""
    SATURATED = 2
    """So many phase steps are at the sensor's full scale that the others do not tell the phase; or a section's peak."""
    UNSURE = 4
    """Bits too close to their threshold, or phases too noisy, to settle the order of the fringe."""
    DISAGREEMENT = 8
    """Code and phase, or the phases of several periods, contradict each other."""
    OUTSIDE = 16
    """The coordinate is none of the projector's lines."""
    BESIDE = 32
    """Lit by the blur of brighter neighbours alone, as beyond the rim of a surface."""
    NO_U = 64
    """u is NaN."""
    NO_V = 128
    """v is NaN."""


def invalidate(place: Floats, sigma: Floats, flags: NDArray[np.uint8], where: Any, why: int) -> None:
    """Take coordinates and sigmas of an axis out, in place, at an index of all three arrays; `why` are flags."""
    place[where] = sigma[where] = np.nan
    flags[where] |= np.uint8(why)


@dataclass(frozen=True)
class DecodeOptions:
    """Thresholds of the decoder."""

    #: least modulation in units of its own standard deviation. At 5 one unlit pixel in 270,000 passes (exp(-12.5)).
    min_snr: float = 5.0
    min_modulation: float = 0.0  #: least modulation in grey values, besides `min_snr`
    #: a bit is unsure when it is nearer to its threshold than this part of half the contrast between on and off
    bit_margin: float = 0.35
    #: grey value from which a pixel counts as saturated; by default the container's largest value, or the largest value
    #: seen in 16-bit files when that is the full scale of a sensor with fewer bits
    saturation: float | None = None
    estimate: bool = False  #: refine the coordinates by all frames (`estimate`, `codes`): less noise, more time
    camera: bool = True  #: look for the camera's own curve, a gamma or tone curve, and take it out
    steps: float = 1  #: of the images to a grey value, which modulation and notes are told in

    def in_steps(self, steps: float, saturation: float) -> Self:
        """Give the same thresholds for images in other steps, saturated from so many."""
        return replace(
            self, steps=self.steps * steps, saturation=saturation, min_modulation=self.min_modulation * steps
        )
