"""What measuring edges on a surface returns."""

from __future__ import annotations

from core.lazy import dataclass
from core.model.arrays import Array


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
