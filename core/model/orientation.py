"""What watching the rig takes and returns: what is known of a scene, and how the projector has moved."""

from __future__ import annotations

from core.lazy import dataclass
from core.model.arrays import Array
from core.model.calibration import Pair


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
    probability of a sign this large if nothing has moved. `pair` is camera and projector as they stand now, with the
    covariance that follows.

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
