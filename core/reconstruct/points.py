"""The stage: phase map and calibration in, points out."""

from __future__ import annotations

from core.errors import InputError
from core.geometry import pair_for
from core.model import DepthCalibration, Pair, PhaseMap, PhotogrammetricCalibration, PointCloud
from core.progress import SILENT, Progress
from core.reconstruct.intersect import intersect
from core.reconstruct.lookup import look_up


def reconstruct(
    phase: PhaseMap,
    calibration: PhotogrammetricCalibration | DepthCalibration | Pair,
    *,
    extrapolate: bool = False,
    progress: Progress = SILENT,
) -> PointCloud:
    """Reconstruct the points that the camera's pixels see, (H, W, 3) mm in its frame, NaN where there is none.

    The calibration says by which method; `extrapolate` also gives points beyond the depths of a depth calibration.

    Raises
    ------
    InputError
        If the phase map has not the size of the calibrated camera, or lacks the axis that gives the depth.
    """
    if isinstance(calibration, DepthCalibration):
        spec, doing = calibration.camera_spec, "looking up depths"
    else:
        spec, doing = pair_for(phase, calibration).camera.spec, "intersecting"
    if phase.u.shape != (spec.height, spec.width):
        height, width = phase.u.shape
        raise InputError(
            "phase map",
            f"is {width}×{height} pixels, but the calibrated camera has {spec.width}×{spec.height}",
            "use captures of the camera that was calibrated",
        )
    progress(0.0, doing)
    if isinstance(calibration, DepthCalibration):
        cloud = look_up(phase, calibration, extrapolate=extrapolate)
    else:
        cloud = intersect(phase, calibration)
    progress(1.0, "points are reconstructed")
    return cloud
