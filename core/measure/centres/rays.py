"""Rays from the centres of dots, in the coordinates of the expected ellipse: a tilted circle is a circle there."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from core.lazy import dataclass
from core.measure.centres.kernels import in_bands, sample_rays
from core.model import Array, Floats

RAYS = 24
ANGLES = np.arange(RAYS) * (2 * np.pi / RAYS)
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)


@dataclass(frozen=True)
class Rays:
    """`RAYS` directions from each of m dots, evenly spaced in the unit disc that `ellipse` maps to the image."""

    centre: Array  # (m, 2) px
    ellipse: Array  # (m, 2, 2) px

    @cached_property
    def unit(self) -> Array:
        """(m, RAYS, 2) px: what one radius of the unit disc is along each ray."""
        return np.ascontiguousarray(DIRECTIONS @ np.swapaxes(self.ellipse, 1, 2))

    @cached_property
    def length(self) -> Array:
        """(m, RAYS) px per radius of the unit disc."""
        return np.hypot(self.unit[..., 0], self.unit[..., 1])

    @cached_property
    def minor(self) -> Array:
        """(m,) px along the shortest ray."""
        return self.length.min(axis=1)

    def offsets(self, radius: Array) -> Array:
        """Pixels (m, RAYS, k, 2) from the centre at radii (m, k) or (k,) that are the same for all rays."""
        r = np.broadcast_to(radius, (len(self.centre), np.shape(radius)[-1]))
        return self.unit[:, :, None, :] * r[:, None, :, None]

    def sample(self, image: Floats, radius: Array) -> Floats:
        """Bilinear values (m, RAYS, k) of an image at radii (m, RAYS, k), (m, k) or (k,); NaN outside and by a NaN."""
        r = radius[:, None, :] if radius.ndim == 2 else radius
        full = np.empty((len(self.centre), RAYS, r.shape[-1]))
        full[:] = r
        out = np.empty(full.shape, np.float32)
        in_bands(sample_rays, image, np.ascontiguousarray(self.centre), self.unit, full, out)
        return out
