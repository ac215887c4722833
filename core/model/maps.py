"""What decoding, reconstructing and judging return: maps over the camera's image."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model.arrays import Array, Floats
from core.model.calibration import Method
from core.model.finding import Verdict
from core.model.rig import Interior


@dataclass(frozen=True)
class PhaseMap:
    """Projector coordinates of every camera pixel; all arrays have shape (H, W).

    `u`, `v` are in projector lines, NaN where invalid (all NaN for an axis without patterns), `sigma_u`, `sigma_v`
    their standard deviations in lines. `modulation` and `image` (the scene lit evenly) are in grey values. `flags` says
    why a pixel is invalid: bits of `core.decode.Flag`.

    `response` (k, 2) is the curve of level and light (0 to 1) that sine fringes were found to be projected with, None
    where they are as good as straight. `misfit`, where coordinates were refined by all frames, is the mean squared
    residual of a pixel's frames over its expectation: far above 1 where it sees motion, two surfaces, or light by
    detours. `notes` (`Note`) say in sentences what is wrong with the capture, and the remedy.
    `gaps` is the share of grey values that no frame takes although frames take values just below and above; None where
    nobody asked. `clipped` is where `image` lacks light that frames at full scale did not see; None where it is whole.
    """

    u: Floats
    v: Floats
    sigma_u: Floats
    sigma_v: Floats
    modulation: Floats
    image: Floats
    flags: NDArray[np.uint8]
    response: Array | None = None
    misfit: Floats | None = None
    notes: tuple[str, ...] = ()
    camera: str = "camera"
    projector: str = "projector"
    gaps: float | None = None
    clipped: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class PointCloud:
    """Points in the camera's frame in mm, NaN where invalid; shape (H, W, 3)."""

    xyz_mm: Floats
    sigma_mm: Floats | None = None  # (H, W, 3), phase noise and calibration
    sigma_depth_mm: Floats | None = None  # (H, W) of the camera's Z, noise of capture and depth curves; both methods
    sight: NDArray[np.uint8] | None = None  # (H, W), how many saw it: `core.reconstruct.Sight`; several cameras only
    source: NDArray[np.uint8] | None = None  # (H, W), by which of the cameras a joined cloud has it
    object_px: int | None = None  # that the object takes in the first camera's image, where its holes were filled
    by_depth: bool = False  # from the depth method: its sigma leaves out the errors of the plate's places
    verdict: Verdict | None = None  # None: nobody judged them

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Which pixels have a point, (H, W)."""
        x, y, z = np.moveaxis(self.xyz_mm, -1, 0)  # a tenth of the time of `all` over three numbers each
        return np.asarray(np.isfinite(x) & np.isfinite(y) & np.isfinite(z))


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
    devices: tuple[str, str] = ("camera", "projector")  # whose points
    form_pv_um: float | None = None  # peak to valley of the low-passed deviations
    noisy: bool = True  # deviations and form are no more than noise leaves; else the calibration's sigma explains them
    verdict: Verdict | None = None
    elsewhere: int = 0  # of those excluded: on other surfaces than the plane
