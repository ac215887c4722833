"""What calibrating returns: the adjustment, and the calibrations by both methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from core.model.arrays import Array, Floats
from core.model.network import Network
from core.model.rig import DeviceSpec, Interior
from core.model.verdict import LeftOut, Verdict

if TYPE_CHECKING:
    from core.geometry.rotation import Pose

Method = Literal["photogrammetric", "polynomial"]


@dataclass(frozen=True)
class AdjustedDevice:
    """A device as the adjustment found it."""

    spec: DeviceSpec
    interior: Interior
    sigma: Array  # (9,) of c, x0, y0 (mm), A1..A6; 0 where held fixed
    residual_rms_um: tuple[float, float]  # x, y in the image
    image_points: int


@dataclass(frozen=True)
class Adjustment:
    """Everything one bundle adjustment knows at its end."""

    network: Network
    devices: Mapping[str, AdjustedDevice]
    station_from_object: tuple[Pose, ...]  # of every station
    relative: Mapping[str, Pose]  # rigid rig: other device from first device
    points_mm: Array  # (n, 3)
    point_cov_mm2: Array  # (n, 3, 3)
    residuals: Array  # (m, 2) observed minus computed, px or lines
    redundancy_numbers: Array  # (m, 2)
    sigma0: float
    redundancy: int
    iterations: int
    convergence: tuple[float, ...]  # weighted sum of squares at each iteration
    variance_factors: Mapping[str, float]  # per device, from variance components (1 where not estimated)
    parameter_names: tuple[str, ...]  # of `parameter_cov`: "cam.c" ..., "proj.A6", "proj.rx" ... "proj.tz"
    parameter_cov: Array  # interior orientations and relative orientations, posterior sigma0 applied
    warnings: tuple[str, ...] = ()
    verdict: Verdict | None = None  # None where nobody judged it


@dataclass(frozen=True)
class PhotogrammetricCalibration:
    """Camera and projector as one photogrammetric system."""

    camera: AdjustedDevice
    projector: AdjustedDevice
    projector_from_camera: Pose
    covariance: Array  # (24, 24): camera 9, projector 9, rotation vector 3 (rad, left perturbation), translation 3 (mm)
    sigma0: float
    stations: int
    image_points: int
    object_points: int
    redundancy: int
    object_sigma_rms_um: tuple[float, float, float]
    warnings: tuple[str, ...] = ()
    verdict: Verdict | None = None
    left_out: tuple[LeftOut, ...] = ()


@dataclass(frozen=True)
class DepthCalibration:
    """Per-pixel depth of the plate along its axis as a function of the projector coordinate.

    A polynomial of `degree` in the normalised coordinate ``t = (u - centre) / half`` per pixel, or for `degree` None a
    table of the calibrated u at every depth, interpolated linearly. `axis` names the projector coordinate used.
    """

    axis: Literal["u", "v"]
    depths_mm: Array  # (k,)
    degree: int | None
    coefficients: Floats  # (degree + 1, H, W) mm, or (k, H, W) lines for the table
    u_range: Floats  # (2, H, W): least and greatest calibrated u; NaN where the pixel was not calibrated
    residual_rms_mm: float
    valid_pixels: int
    camera_spec: DeviceSpec
    camera: Interior
    camera_from_plate: Pose  # the plate's frame at z = 0; the plate moves along `axis_direction` in that frame
    axis_direction: Array  # (3,) movement of the plate per mm of z
    warnings: tuple[str, ...] = ()
    verdict: Verdict | None = None
    left_out: tuple[LeftOut, ...] = ()
    noise_rms_mm: float | None = None  # what the noise of the coordinates alone would leave


Calibration = PhotogrammetricCalibration | DepthCalibration
