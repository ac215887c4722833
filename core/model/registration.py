"""How several captures of one object stand to each other, the rig or the object having been moved between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from core.lazy import dataclass
from core.model.arrays import Array

if TYPE_CHECKING:
    from core.geometry.rotation import Pose


@dataclass(frozen=True)
class Overlap:
    """What ties two captures together: so many targets, or places of the surface that both see.

    `misfit` is the r.m.s. of what remains between them in standard deviations by noise, the calibration's errors apart.
    """

    captures: tuple[str, str]
    kind: Literal["targets", "places"]
    number: int
    misfit: float


@dataclass(frozen=True)
class Registration:
    """Poses of the rig in the captures of one object, ``view_from_first``: the first one's is fixed.

    `covariance` (6(n-1), 6(n-1)) is by noise: rotation vector (rad, turning from the left) and shift (mm) of all but
    the first. `by_calibration` (6(n-1), k) is their change with the calibration's parameters, whose errors all share.
    """

    captures: tuple[str, ...]
    poses: tuple[Pose, ...]
    covariance: Array
    by_calibration: Array
    overlaps: tuple[Overlap, ...]

    def sigmas(self, calibration: Array) -> Array:
        """Standard deviations (n-1, 6) with the part of a calibration's covariance (k, k)."""
        J = self.by_calibration
        return np.sqrt(np.diagonal(self.covariance + J @ calibration @ J.T)).reshape(-1, 6)
