"""What an operator may choose about measuring targets; the defaults suit every ordinary board."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class MeasureOptions:
    """Choices of `measure_targets`.

    Attributes
    ----------
    projector : "bilinear" or "plane"
        How projector coordinates follow from the phase map: bilinear interpolation at the target's centre, or a plane
        fitted to all valid pixels of the dot (less noise, but it trusts the board to be flat across a dot).
    side : "front", "back" or "either"
        From which side the camera sees the board. The nominal coordinates are right-handed, so that their Z axis
        points to the viewer ("front"); a field written with y downwards and z = 0 is seen from its "back". Picks that
        show the other side are refused as mirrored.
    """

    projector: Literal["bilinear", "plane"] = "bilinear"
    side: Literal["front", "back", "either"] = "front"
