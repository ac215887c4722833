"""What travels along the road: one frozen dataclass for every arrow between two stages.

    capture -> Capture -> decode -> PhaseMap -> measure -> TargetSet -> calibrate -> Photogrammetric / DepthCalibration
    -> reconstruct -> PointCloud -> evaluate -> PlaneEvaluation -> report

Units are in the names; lengths are mm, device pixel coordinates px (camera) or lines (projector). The frames are those
of `core.geometry`. Nothing here computes more than a property.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from core.geometry.rotation import Pose
    from core.patterns import Pattern

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Ints = NDArray[np.int64]

Role = Literal["testfield", "depth", "plane", "object"]
Method = Literal["photogrammetric", "polynomial"]
INTERIOR_NAMES = ("c", "x0", "y0", "A1", "A2", "A3", "A4", "A5", "A6")


# ---------------------------------------------------------------------------------------------- the rig and its project


@dataclass(frozen=True)
class DeviceSpec:
    """A camera or projector before calibration: its pixel (or line) raster and the maker's focal length."""

    width: int
    height: int
    pitch_mm: tuple[float, float]
    nominal_c_mm: float
    r0_mm: float | None = None

    @property
    def zero_radius_mm(self) -> float:
        """Where the radial parameters are zero: the given r0, else 2/3 of half the image diagonal."""
        if self.r0_mm is not None:
            return self.r0_mm
        return float(np.hypot(self.width * self.pitch_mm[0], self.height * self.pitch_mm[1]) / 3)


@dataclass(frozen=True)
class Interior:
    """Interior orientation (c, x0, y0) and the six additional parameters A1..A6 of a device."""

    c_mm: float
    x0_mm: float = 0.0
    y0_mm: float = 0.0
    a: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    r0_mm: float = 0.0

    @property
    def vector(self) -> Array:
        """(c, x0, y0, A1..A6) as an array of shape (9,)."""
        return np.array([self.c_mm, self.x0_mm, self.y0_mm, *self.a])

    @staticmethod
    def from_vector(values: Array, r0_mm: float) -> Interior:
        """Make the orientation from (c, x0, y0, A1..A6), shape (9,)."""
        c, x0, y0, a1, a2, a3, a4, a5, a6 = (float(v) for v in values)
        return Interior(c, x0, y0, (a1, a2, a3, a4, a5, a6), r0_mm)


@dataclass(frozen=True)
class Testfield:
    """The nominal targets of a board, one row of every array per target."""

    __test__ = False  # the field's word, not a test class

    row: Ints
    col: Ints
    xyz_mm: Array  # (n, 3) in the board's frame
    diameter_mm: Array  # (n,)
    polarity: Literal["white-on-black", "black-on-white"] = "white-on-black"

    def index(self) -> dict[tuple[int, int], int]:
        """Position in the arrays of every (row, col)."""
        return {(int(r), int(c)): i for i, (r, c) in enumerate(zip(self.row, self.col, strict=True))}


@dataclass(frozen=True)
class Seed:
    """A target the operator picked: its identity and where it was clicked (px)."""

    row: int
    col: int
    u: float
    v: float


@dataclass(frozen=True)
class Frame:
    """One image of a capture and what the projector was meant to show in it."""

    path: Path
    pattern: Pattern


@dataclass(frozen=True)
class Capture:
    """One sequence of frames: a folder with `capture.json`."""

    path: Path
    role: Role
    frames: tuple[Frame, ...]
    testfield: Testfield | None = None
    z_mm: float | None = None
    angle_deg: float | None = None
    seeds: tuple[Seed, ...] = ()
    excluded: tuple[tuple[int, int], ...] = ()  # (row, col) of targets that the operator does not want used

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.path.name


@dataclass(frozen=True)
class ScaleBar:
    """A measured distance between two targets of the testfield, (row, col) each."""

    start: tuple[int, int]
    stop: tuple[int, int]
    length_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class Project:
    """A project folder: the rig and the list of its captures (folders; read each with `core.project`)."""

    path: Path
    name: str
    camera: DeviceSpec
    projector: DeviceSpec
    scale: ScaleBar | None
    captures: tuple[Path, ...]
    reference: str | None = None  # a published experiment this rig repeats: a file name in resources/reference


# ------------------------------------------------------------------------------------------------ what decoding returns


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


# ---------------------------------------------------------------------------------------------- what measuring returns


@dataclass(frozen=True)
class MissingTarget:
    """A target that was not measured, and why, in words."""

    row: int
    col: int
    reason: str


@dataclass(frozen=True)
class TargetSet:
    """The measured targets of one capture, one row of every array per target.

    `camera_uv` (n, 2) px is the image of the circle's centre: the weighted centroid less `eccentricity_px` (n, 2).
    `camera_cov` (n, 2, 2) px². `projector_uv` (n, 2) lines and `projector_sigma` (n, 2) are NaN where that axis was not
    decoded at the target. `made_from` signs what they were measured from, empty where nobody asked.
    """

    capture: str
    row: Ints
    col: Ints
    camera_uv: Array
    camera_cov: Array
    projector_uv: Array
    projector_sigma: Array
    eccentricity_px: Array
    diameter_px: Array
    missing: tuple[MissingTarget, ...] = ()
    made_from: str = ""


# -------------------------------------------------------------------------------------------- networks and calibrations


@dataclass(frozen=True)
class NetworkDevice:
    """A device of a network and which of its nine parameters are estimated (names of `INTERIOR_NAMES`)."""

    spec: DeviceSpec
    estimate: tuple[str, ...] = INTERIOR_NAMES


@dataclass(frozen=True)
class NetworkScale:
    """A measured distance between two points of a network (indices into its points)."""

    start: int
    stop: int
    length_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class Network:
    """Image observations to be adjusted: stations (one device at one place each), points, and who saw what where.

    Stations that share a `station_pose` number belong to one pose of a rigid rig: within a pose the first device's
    orientation is free and every other device has one constant orientation relative to it. Where every station has a
    pose number of its own, all stations are free.
    """

    devices: Mapping[str, NetworkDevice]
    station_names: tuple[str, ...]
    station_device: tuple[str, ...]
    station_pose: tuple[int, ...]
    point_names: tuple[str, ...]
    point_xyz_mm: Array  # (n, 3) approximate
    observation_station: Ints  # (m,)
    observation_point: Ints  # (m,)
    observation_uv: Array  # (m, 2) px or lines; NaN in one coordinate: that one was not observed
    observation_sigma: Array  # (m, 2) px or lines
    scale: NetworkScale | None = None


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


Calibration = PhotogrammetricCalibration | DepthCalibration


# ---------------------------------------------------------------------------------- what reconstructing, judging return


@dataclass(frozen=True)
class PointCloud:
    """Points in the camera's frame in mm, NaN where invalid; shape (H, W, 3)."""

    xyz_mm: Floats
    sigma_mm: Floats | None = None  # (H, W, 3), phase noise and calibration; photogrammetric only
    sigma_depth_mm: Floats | None = None  # (H, W) of the camera's Z, phase noise alone; both methods


@dataclass(frozen=True)
class PlaneEvaluation:
    """The deviations of one plane capture from its fitted plane, by one method."""

    capture: str
    angle_deg: float | None
    method: Method
    n: int
    rms_mm: float
    max_mm: float  # largest absolute deviation
    min_mm: float  # most negative deviation
    predicted_rms_mm: float | None
    excluded: int  # pixels the decoder called valid that are not among the n
    excluded_rule: str  # why; empty where none
    plane: Array  # (4,): unit normal towards the camera and offset, n . X = d
    deviation_mm: Floats = field(repr=False, compare=False, default_factory=lambda: np.zeros((0, 0), np.float32))
    sigma_mm: Floats = field(repr=False, compare=False, default_factory=lambda: np.zeros((0, 0), np.float32))
    camera: Interior | None = None  # by which the points were reconstructed


Figures = dict[str, Any]  # what `--json` writes: plain numbers, strings, lists and dictionaries
