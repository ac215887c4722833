"""A reconstructed surface as smooth patches: what it is between pixels, and with how much noise."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from core.geometry import project_with_derivatives, ray_directions
from core.lazy import dataclass
from core.model import AdjustedDevice, Array, PointCloud
from core.numerics import polynomial, polynomial_slopes

LEAST_KNOWN = 0.8  # of a patch's pixels
ROUGH = 2.0  # times the usual misfit of a patch: an edge, a crease


@dataclass(frozen=True)
class Patches:
    """Parabolas of inverse depth fitted round places of the image; one entry a place."""

    #: q, variance: (n,): inverse depth (1/mm) and its variance by noise; NaN where the surface is not known, or not
    #: smooth
    q: Array
    variance: Array
    slopes: Array  #: (n, 2): its change along the image's u and v, by px


@dataclass(frozen=True)
class Surface:
    """The points of a camera's pixels, of which neighbours are averaged by parabolas of inverse depth."""

    cloud: PointCloud
    camera: AdjustedDevice

    @cached_property
    def half(self) -> int:
        """Pixels either side in a patch."""
        return int(np.clip(np.sqrt(self.cloud.xyz_mm[..., 2].size) / 120, 2, 4))

    @cached_property
    def _q(self) -> tuple[Array, Array]:
        q = -1 / self.cloud.xyz_mm[..., 2].astype(np.float64)
        assert self.cloud.sigma_depth_mm is not None
        return q, (self.cloud.sigma_depth_mm.astype(np.float64) * q**2) ** 2

    @cached_property
    def level(self) -> float:
        """A usual inverse depth, 1/mm."""
        return float(np.nanmedian(self._q[0]))

    @cached_property
    def _window(self) -> tuple[NDArray, NDArray, Array]:
        """Rows and columns (k,) of a patch from its middle, and the terms (k, 6) there."""
        y, x = np.mgrid[-self.half : self.half + 1, -self.half : self.half + 1].reshape(2, -1)
        return y, x, polynomial(x / self.half, y / self.half, 2)

    def fitted(self, rows: NDArray, columns: NDArray) -> tuple[Array, Array, Array, Array]:
        """Parabolas (n, 6) of pixels, their cofactors (n, 6, 6), variances of one pixel and misfits (n,)."""
        q, variance = self._q
        dy, dx, terms = self._window
        y, x = rows[:, None] + dy, columns[:, None] + dx
        inside = (y >= 0) & (x >= 0) & (y < q.shape[0]) & (x < q.shape[1])
        place = np.where(inside, y, 0), np.where(inside, x, 0)
        known = inside & np.isfinite(q[place]) & np.isfinite(variance[place])
        value, count = np.where(known, q[place] - self.level, 0.0), np.count_nonzero(known, axis=1)
        few = count < LEAST_KNOWN * len(dy)
        N = np.einsum("nk,ki,kj->nij", known.astype(np.float64), terms, terms)
        N[few] = np.eye(6)
        cofactor = np.linalg.inv(N)
        fit = np.einsum("nij,nj->ni", cofactor, value @ terms)
        single = np.where(known, variance[place], 0.0).sum(axis=1) / np.maximum(count, 1)
        rest = np.where(known, value - fit @ terms.T, 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            misfit = np.where(few, np.nan, np.sum(rest**2, axis=1) / np.maximum(count - 6, 1) / single)
        return fit, cofactor, single, misfit

    @cached_property
    def usual(self) -> float:
        """The usual misfit of patches, 1 where sigmas are true."""
        height, width = self.cloud.xyz_mm.shape[:2]
        grid = np.mgrid[self.half : height : 4 * self.half, self.half : width : 4 * self.half].reshape(2, -1)
        misfit = self.fitted(*grid)[3]
        return float(np.nanmedian(misfit)) if np.isfinite(misfit).any() else 1.0

    def at(self, places: Array) -> Patches:
        """Give the surface at places (n, 2) of the image, px."""
        height, width = self.cloud.xyz_mm.shape[:2]
        with np.errstate(invalid="ignore"):
            inside = np.all((places >= 0) & (places <= (width - 1, height - 1)), axis=1)
        near = np.rint(np.where(inside[:, None], places, 0.0)).astype(np.int64)
        fit, cofactor, variance, misfit = self.fitted(near[:, 1], near[:, 0])
        x, y = ((np.where(inside[:, None], places, 0.0) - near) / self.half).T
        terms, by = polynomial(x, y, 2), polynomial_slopes(x, y, 2) / self.half
        with np.errstate(invalid="ignore"):
            known = inside & (misfit < ROUGH * max(self.usual, 1.0))
            variance = variance * np.maximum(misfit, 1.0)
        q = np.where(known, self.level + np.einsum("ni,ni->n", terms, fit), np.nan)
        return Patches(
            q, variance * np.einsum("ni,nij,nj->n", terms, cofactor, terms), np.einsum("kni,ni->nk", by, fit)
        )

    def gradient(self, patches: Patches, X: Array) -> tuple[Array, Array]:
        """How far points X (n, 3) lie off the surface, in 1/mm, and how that changes with them, (n, 3)."""
        by_point = project_with_derivatives(self.camera.spec, self.camera.interior, X).by_point
        by_x = np.einsum("nk,nki->ni", patches.slopes, by_point)
        by_x[:, 2] -= 1 / X[:, 2] ** 2
        return patches.q + 1 / X[:, 2], by_x

    def points(self, places: Array, patches: Patches) -> Array:
        """Points (n, 3) of the surface at places (n, 2)."""
        return ray_directions(self.camera.spec, self.camera.interior, places) / patches.q[:, None]
