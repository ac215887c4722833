"""What pages share that show a map over the camera's image: levels that are round, and light on a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass

LIGHT = (-0.5, 0.5, 0.7)  # from the upper left, in front of the surface, in the camera's frame
UNLIT = 0.75  # brightness where the slope is not known


@dataclass(frozen=True)
class MapView:
    """A map ready to be shown."""

    image: NDArray  #: (H, W): the values that the cursor reads
    levels: tuple[float, float]
    scale: str
    unit: str
    digits: int
    colours: NDArray[np.uint8] | None = None  #: (H, W, 4): what is painted instead of the scale's colours


def percentile(image: NDArray, percent: float) -> float:
    """Give a percentile of what is finite, 1 where nothing is."""
    finite = image[np.isfinite(image)]
    return float(np.percentile(finite, percent)) if finite.size else 1.0


def round_up(value: float) -> float:
    """Give the next 1, 2, 2.5 or 5 times a power of ten.

    Examples
    --------
    >>> round_up(0.043), round_up(160)
    (0.05, 200.0)
    """
    if not value > 0:
        return 1.0
    size = 10.0 ** np.floor(np.log10(value))
    return float(next(m * size for m in (1, 2, 2.5, 5, 10) if m * size >= value * (1 - 1e-9)))


def round_factor(value: float) -> float:
    """Give the greatest 1, 2 or 5 times a power of ten up to a value.

    Examples
    --------
    >>> round_factor(387.0), round_factor(0.5)
    (200.0, 0.5)
    """
    size = 10.0 ** np.floor(np.log10(value))
    return float(size * max(m for m in (1, 2, 5) if size * m <= value * (1 + 1e-9)))


def hill_shade(xyz_mm: NDArray) -> NDArray[np.float32]:
    """Light a surface, (H, W, 3) mm in the camera's frame, NaN where there is none, from the camera's upper left.

    Gives the cosine of the angle between the light and the surface's normal, (H, W), 0 where it is turned away; NaN
    without neighbours on both sides.
    """
    du = np.full(xyz_mm.shape, np.nan, np.float32)
    dv = np.full(xyz_mm.shape, np.nan, np.float32)
    du[:, 1:-1] = xyz_mm[:, 2:] - xyz_mm[:, :-2]
    dv[1:-1] = xyz_mm[2:] - xyz_mm[:-2]
    normal = np.cross(dv, du)  # v runs down: this one looks towards the camera
    with np.errstate(invalid="ignore", divide="ignore"):
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    light = np.array(LIGHT, np.float32)
    return np.clip(normal @ (light / np.linalg.norm(light)), 0.0, 1.0).astype(np.float32)


def lit_colours(
    image: NDArray, levels: tuple[float, float], table: NDArray[np.uint8], shade: NDArray
) -> NDArray[np.uint8]:
    """Paint values in the colours of a table, shape (256, 3), darkened by the shade; transparent where NaN.

    Examples
    --------
    >>> grey = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    >>> lit_colours(np.array([[10.0, np.nan]]), (0.0, 10.0), grey, np.array([[1.0, 1.0]])).tolist()
    [[[255, 255, 255, 255], [0, 0, 0, 0]]]
    """
    low, high = levels
    known = np.isfinite(image)
    with np.errstate(invalid="ignore"):
        index = np.clip((np.nan_to_num(image) - low) / ((high - low) or 1.0) * 255, 0, 255).astype(np.uint8)
    light = np.where(np.isfinite(shade), shade, UNLIT)[..., None]
    colours = np.zeros((*image.shape, 4), np.uint8)
    colours[..., :3] = table[index] * (0.25 + 0.75 * light)  # shadows keep their colour
    colours[..., 3] = 255
    colours[~known] = 0
    return colours
