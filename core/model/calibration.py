"""What calibrating returns: the adjustment, and the calibrations by both methods."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, Protocol

from core.lazy import dataclass
from core.model.arrays import Array, Floats
from core.model.finding import Concern, LeftOut, Verdict
from core.model.network import Network
from core.model.rig import DeviceSpec, Interior

if TYPE_CHECKING:
    from core.geometry.rotation import Pose

Method = str  # the name of a method of calibration, see `core.pipeline.METHODS`


@dataclass(frozen=True)
class AdjustedDevice:
    """A device as the adjustment found it."""

    spec: DeviceSpec
    interior: Interior
    sigma: Array  # (k,) of c, x0, y0 (mm) and the additional parameters; 0 where held fixed
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
    length_sigma_mm: tuple[float, ...] = ()  # of the scale and the lengths, as they are adjusted
    warnings: tuple[str, ...] = ()
    doubts: tuple[Concern, ...] = ()  # those of the warnings that put the result in doubt
    verdict: Verdict | None = None  # None where nobody judged it


@dataclass(frozen=True)
class Orientation:
    """How a device stands to the one that all others of its rig refer to."""

    base: str
    device_from_base: Pose


@dataclass(frozen=True)
class PhotogrammetricCalibration:
    """Cameras and projectors as one photogrammetric system.

    `covariance` (k, k) is of all parameters together, posterior sigma0 applied. `parameter_names` says which: those of
    every device's lens ("camera.c", ...), then "rx", "ry", "rz" (rotation vector, rad, left perturbation), "tx", "ty",
    "tz" (mm) of every device that has an orientation. `core.geometry.pair_of` gives one camera with one projector.
    """

    devices: Mapping[str, AdjustedDevice]
    cameras: tuple[str, ...]  # which of them are cameras; the others, if any, are projectors
    orientations: Mapping[str, Orientation]  # of all devices but the one they refer to
    covariance: Array
    parameter_names: tuple[str, ...]
    sigma0: float
    stations: int
    image_points: int
    object_points: int
    redundancy: int
    object_sigma_rms_um: tuple[float, float, float]
    warnings: tuple[str, ...] = ()
    verdict: Verdict | None = None
    left_out: tuple[LeftOut, ...] = ()

    @property
    def projectors(self) -> tuple[str, ...]:
        """Names of the projectors."""
        return tuple(name for name in self.devices if name not in self.cameras)

    @property
    def camera_name(self) -> str:
        """The camera meant where none is named: the only one, the one called "camera", else the first."""
        return "camera" if "camera" in self.cameras else self.cameras[0]

    @property
    def projector_name(self) -> str:
        """The projector meant where none is named: the only one, the one called "projector", else the first.

        "projector", which `devices` does not hold, where only cameras are calibrated.
        """
        return "projector" if "projector" in self.projectors else next(iter(self.projectors), "projector")

    @property
    def camera(self) -> AdjustedDevice:
        """The only camera, or the one meant where none is named."""
        return self.devices[self.camera_name]

    @property
    def projector(self) -> AdjustedDevice:
        """The only projector, or the one meant where none is named."""
        return self.devices[self.projector_name]

    @property
    def projector_from_camera(self) -> Pose:
        """How these two stand to each other."""
        to_projector, to_camera = (self.orientations.get(n) for n in (self.projector_name, self.camera_name))
        if to_projector is None:
            assert to_camera is not None, "two devices are oriented to each other"
            return to_camera.device_from_base.inverse()
        pose = to_projector.device_from_base
        return pose if to_camera is None else pose @ to_camera.device_from_base.inverse()


@dataclass(frozen=True)
class Pair:
    """One camera with one projector of a calibration.

    `covariance` (k, k): the camera's parameters, the projector's, the rotation vector (rad, left perturbation) and the
    translation (mm) of `projector_from_camera`.
    """

    camera: AdjustedDevice
    projector: AdjustedDevice
    projector_from_camera: Pose
    covariance: Array


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
    bent_rms_mm: float = 0.0  # what polynomials of a higher degree would explain of the residuals
    between_rms_mm: float = 0.0  # by how much curves are off between positions that are no more than they need
    # (k + 8, k + 8) of the camera's parameters, the plate's rotation vector (rad) and shift (mm), its axis' two slopes
    covariance: Array | None = None
    # standard deviation of the coordinates that curves were fitted to, r.m.s. in (h, w) equal cells of the image
    curve_noise_lines: Floats | float | None = None
    devices: tuple[str, str] = ("", "")  # camera and projector by name; empty for those that the rig means


class Calibration(Protocol):
    """What every method of calibration returns: a frozen dataclass with at least these fields."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What an operator should know, a sentence each."""

    @property
    def verdict(self) -> Verdict | None:
        """The verdict; None where nobody judged."""

    @property
    def left_out(self) -> tuple[LeftOut, ...]:
        """Points and captures without a part in it."""
