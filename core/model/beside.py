"""What the work beside the road takes and returns: watching the rig, joining captures, measuring edges on surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from core.lazy import dataclass
from core.model.arrays import Array
from core.model.calibration import Pair, PhotogrammetricCalibration
from core.model.finding import Verdict

if TYPE_CHECKING:
    from core.geometry.rotation import Pose


@dataclass(frozen=True)
class KnownLength:
    """A known distance between two features of a scene.

    `kind` is one of `core.orient.LENGTHS`; each of `ends` is (u, v, radius) in px: the pixels around a place of the
    camera's image that belong to the feature.
    """

    kind: str
    ends: tuple[tuple[float, float, float], tuple[float, float, float]]
    length_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class KnownPoints:
    """Points measured before, in a frame of their own, and where camera and projector see them now.

    `xyz_mm` (n, 3) and `cov_mm2` (n, 3, 3); `seen` (n, 4), the camera's u and v in px and the projector's in lines, and
    `seen_cov` (n, 4, 4).
    """

    xyz_mm: Array
    cov_mm2: Array
    seen: Array
    seen_cov: Array


@dataclass(frozen=True)
class RigMotion:
    """The movement of the projector against the calibration, as one capture shows it.

    Rotation vector and shift are in the camera's frame, their `covariance` (6, 6) with the calibration's own errors and
    likely drifts of c, x0 and y0; without a known length or points the shift has no part along the base. `p` is the
    probability of a sign this large if nothing has moved, by all that is known of the scene. `pair` is camera and
    projector as they stand now, with the covariance that follows.

    `shown` (5,) is the same for comparison among captures, with no prior on drifts: rotation, and two shifts across
    the base; `noise` (5, 5) is its covariance by noise alone, from a scatter as of so many independent `tiles`, and
    `by_calibration` (5, k) what it makes of the calibration's errors, which are the same in every capture.
    """

    capture: str
    moved: bool
    p: float
    rotation_rad: Array  # (3,)
    shift_mm: Array  # (3,)
    covariance: Array  # (6, 6)
    depth_change_mm: float  # median over the pixels, corrected less calibrated
    depth_sigma_mm: float  # of the corrected depth: by noise, by the calibration, and by what was not seen to move
    pixels: int
    residual_rms: float  # of the epipolar residuals, in a pixel's sigmas, before correction
    corrected_rms: float  # and after it
    pair: Pair
    change: Array  # (k,), of the parameters of the pair
    shown: Array  # (5,)
    noise: Array  # (5, 5)
    by_calibration: Array  # (5, k)
    tiles: int
    unobserved: tuple[str, ...] = ("base length", "c")
    lengths: tuple[KnownLength, ...] = ()
    lengths_mm: tuple[tuple[float, float], ...] = ()  # of those: as calibrated, and as corrected
    points: int = 0  # known ones
    stretch: float = 1.0  # times the usual drifts of shift and interior orientation: how much was allowed for
    camera: str = "camera"
    projector: str = "projector"


@dataclass(frozen=True)
class RigCorrection:
    """Where all devices of a rig stand, as one capture shows it.

    `calibration` has them there, with the covariance that follows. `devices` that it shows have moved against the one
    that all refer to by `rotation_rad` and `shift_mm` (d, 3) in its frame, with standard deviations `sigma` (d, 6): all
    but the size of the whole rig, which fits every residual. `pairs` are those that showed it.
    """

    capture: str
    calibration: PhotogrammetricCalibration
    devices: tuple[str, ...]
    rotation_rad: Array
    shift_mm: Array
    sigma: Array
    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class DriftPoint:
    """One capture in the control chart of a rig.

    `value`, `expected` and `sigma` (5,) are rotations about X, Y, Z of the camera's frame (rad) and two shifts across
    the base (mm): what the capture shows, what those before it lead to expect, and the standard deviation of the
    difference in a rig at rest. `p` is of all five together; `state` "steady", "warning" (p < 0.05) or "action" (p
    below the stated share of false alarms).
    """

    capture: str
    camera: str
    projector: str
    value: Array
    expected: Array
    sigma: Array
    p: float
    state: str


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


@dataclass(frozen=True)
class Feature:
    """An edge of the evenly lit image, intersected with the measured surface, in the camera's frame.

    `kind` is "circle" (or any ellipse in space) or "line". `uv` is where the camera sees `centre_mm`, `uv_cov` its
    covariance by the edge alone; `cov_mm2` (3, 3) adds the surface's noise and what the calibration leaves uncertain.
    `axes_mm` are the two semi-axes (2, 3) of an ellipse, longest first, or half of a line (1, 3); `sigma_mm` is of
    their lengths by the noise, `size_mm` their mean, a circle's radius, and its standard deviation.
    """

    kind: str
    uv: Array  # (2,) px
    uv_cov: Array  # (2, 2) px²
    centre_mm: Array  # (3,)
    cov_mm2: Array  # (3, 3)
    axes_mm: Array  # (2, 3) or (1, 3)
    sigma_mm: Array
    size_mm: tuple[float, float]
    normal: Array  # (3,) of the surface, towards the camera
    blur_px: float
    pixels: int
    verdict: Verdict | None = None  # of the surface; None: nobody judged it
