"""What watching the rig returns: how the projector has moved since the calibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from core.model.arrays import Array

if TYPE_CHECKING:
    from core.geometry.rotation import Pose


@dataclass(frozen=True)
class RigMotion:
    """The movement of the projector against the calibration, as one capture of any object shows it.

    Rotation vector and shift are in the camera's frame; the shift has no part along the base. `covariance` (6, 6) is of
    both, rotation first: `noise` of the pixels, and what the calibration's own errors do, which are carried over by
    `by_calibration` (6, k), k as in the calibration's covariance. `p` is the probability of a sign this large if
    nothing has moved.
    """

    capture: str
    moved: bool
    p: float
    rotation_rad: Array  # (3,)
    shift_mm: Array  # (3,)
    covariance: Array  # (6, 6)
    noise: Array  # (6, 6)
    by_calibration: Array  # (6, k)
    depth_change_mm: float  # median over the pixels, corrected less calibrated
    depth_sigma_mm: float  # of that change
    pixels: int
    residual_rms: float  # of the epipolar residuals, in their own sigmas, before correction
    corrected_rms: float  # and after it
    projector_from_camera: Pose  # corrected
    unobserved: tuple[str, ...] = ("base length", "c")
    camera: str = "camera"
    projector: str = "projector"
