"""Calibrations of one camera and one projector, made without any adjustment."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.geometry import Pose, calibration_of
from core.model import AdjustedDevice, PhotogrammetricCalibration


def calibration_of_pair(
    camera: AdjustedDevice,
    projector: AdjustedDevice,
    projector_from_camera: Pose,
    covariance: np.ndarray,
    names: tuple[str, str] = ("camera", "projector"),
    **figures: Any,
) -> PhotogrammetricCalibration:
    """Make one of devices of these `names`; `covariance` is that of a `Pair`, `figures` as for `calibration_of`."""
    devices = dict(zip(names, (camera, projector), strict=True))
    return calibration_of(devices, {names[1]: projector_from_camera}, covariance, **{"cameras": names[:1], **figures})
