"""Projector coordinates that a camera decoded, between its pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array, Floats, PhaseMap
from core.numerics import four_pixels

BEND = np.array([[1.0, -2.0, 1.0]], np.float32)
TORN, BENT = 12.0, 0.5  # sigmas, five of a bend's, and slopes: what bends more than both together is two surfaces
PLANE = np.array([[-1.0, 0.0, 1.0]] * 3) / 6  # slope of the plane through 3 by 3 values, along a row


@dataclass(frozen=True)
class Labels:
    """Coordinates of both axes with their variances and slopes."""

    #: values, variances: (H, W, 2): lines and lines²
    values: Floats
    variances: Floats
    #: (H, W, 2, 2): lines a pixel: ``slopes[..., i, j]`` of coordinate i along the image's axis j; NaN beside pixels
    #: without one, and where the coordinates jump
    slopes: Floats

    def at_pixels(self, at: NDArray) -> tuple[Array, Array]:
        """Values and variances (n, 2) of pixels (n, 2)."""
        place = tuple(at.T[::-1])
        return self.values[place].astype(np.float64), self.variances[place].astype(np.float64)

    def between(self, at: Array) -> tuple[Array, Array, Array]:
        """Values, variances (n, 2) and slopes (n, 2, 2) at places (n, 2) of the image, bilinear; NaN outside."""
        rows, columns, share = four_pixels(self.values.shape, at)
        value = np.einsum("kn,kni->ni", share, self.values[rows, columns])
        variance = np.einsum("kn,kni->ni", share**2, self.variances[rows, columns])
        nearest = (np.where(np.isfinite(share[0])[:, None], at, 0.0) + 0.5).astype(int)
        slope = self.slopes[nearest[:, 1], nearest[:, 0]].astype(np.float64)
        return value, variance, slope


def labels_of(phase: PhaseMap) -> Labels:
    """Prepare what was decoded; a coordinate that an image lacks is NaN all over."""
    import cv2

    values: Floats = np.stack([phase.u, phase.v], axis=-1)
    variances = np.stack([phase.sigma_u, phase.sigma_v], axis=-1) ** 2
    slopes: Floats = np.stack(
        [cv2.filter2D(values, -1, kernel.astype(np.float32)) for kernel in (PLANE, PLANE.T)], axis=-1
    )
    slopes[[0, -1]], slopes[:, [0, -1]] = np.nan, np.nan
    bends = np.stack([cv2.filter2D(values, -1, kernel) for kernel in (BEND, BEND.T)], axis=-1)
    limit = TORN * np.sqrt(variances)[..., None] + BENT * np.abs(slopes)
    torn = np.asarray((np.abs(bends) > limit).any(axis=(2, 3)), np.uint8)
    slopes[cv2.dilate(torn, np.ones((3, 3))) > 0] = np.nan  # a pixel of two surfaces bends by nothing
    return Labels(values, variances, slopes)
