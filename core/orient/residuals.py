"""What places of a camera's image show: their points, the epipolar residual, and how both change with the calibration.

A place's ray d and inverse depth q put the point ``X = d / q`` into the camera's frame, which the projector sees at
``f(X)``. Of the two residuals of u and v, weighted by their sigmas, the part along the change with q is taken up by the
depth. What remains, across it, is the epipolar residual, in units of its standard deviation.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from core.geometry import project_with_derivatives, ray_directions
from core.lazy import dataclass
from core.model import AdjustedDevice, Array, Floats, Pair, PhaseMap
from core.numerics import inverse_2x2, median_of, quantile_of

LEAST_SIGMA = 1e-3  # lines; what a sigma is at least
WHOLE, ASIDE = 0.9, 0.02  # of a block's pixels, which have coordinates; of its side, by which their middle is off it
LEAST_BLOCK = 2  # pixels a side: the changes within a block tell where its reflectance changes
SMOOTH_PX = 1.5  # of brightness, where it changes slowly
FLATTEST = 0.2, 0.84  # share of the blocks by which grey noise is told, and how far below the mean of a normal it lies
EDGE = 3.0  # sigmas of noise by which a block's own slope differs from the smoothed one where there is an edge
GRAZING = 1.4  # times the usual slope of the coordinates: the phase of a footprint is no longer that of its middle
CREASED, STEPPED = 5.0, 0.15  # sigmas and lines: what a block of one smooth surface may leave of a plane, r.m.s.


class _Columns:
    """Arrays with one entry a place."""

    def only(self, chosen: NDArray[np.bool_]) -> Self:
        """Give some of the places."""
        return type(self)(*(getattr(self, f.name)[chosen] for f in fields(self)))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Sight(_Columns):
    """Places of an image that saw column and row: single pixels, or means over square blocks of them."""

    at: NDArray[np.int64]  #: (n, 2): row and column of a place in the grid of blocks
    pixels: Array  #: (n, 2): where they are in the camera's image, px
    #: uv, sigma: (n, 2): projector coordinates in lines
    uv: Array
    sigma: Array
    slopes: Array  #: (n, 2, 2): how u and v change along rows and columns of a block, lines/px
    #: (n, 2): where reflectance changes within a pixel's footprint its coordinate is drawn to the brighter side: by
    #: this, in lines, for a footprint of 1 px² (variance)
    pull: Array


@dataclass(frozen=True)
class Residuals(_Columns):
    """Epipolar residuals and points of places, and what they depend on."""

    e: Array  #: (n,): observed less computed, in standard deviations
    A: Array  #: (n, k): change of the computed value with the parameters of the pair, in the order of its covariance
    pulled: Array  #: (n,): change of the observed value with the footprint, by px²
    xyz_mm: Array  #: (n, 3): the points in the camera's frame
    #: by_q, by_ray: (n, k), (n, 2, i): change with the parameters of their inverse depth, 1/mm, and of their rays
    by_q: Array
    by_ray: Array
    sigma_log: Array  #: (n,): relative standard deviation of their distances by noise

    @property
    def by_depth(self) -> Array:
        """Change of their depth -Z with the parameters, (n, k)."""
        return np.asarray(-(self.xyz_mm[:, 2:] ** 2) * self.by_q)

    @property
    def by_xyz(self) -> Array:
        """Change of the points with the parameters, (n, 3, k)."""
        depth = -self.xyz_mm[:, 2, None, None]
        by = -depth * self.xyz_mm[..., None] * self.by_q[:, None, :]
        by[:, :2, : self.by_ray.shape[2]] += depth * self.by_ray
        return np.asarray(by)


def blocks_of(phase: PhaseMap, most: int, tiles: int) -> tuple[Sight, int, float]:
    """Average pixels with both coordinates over square blocks, about `most` of them.

    Also given are the blocks' side, px, and in blocks that of squares of which so many `tiles` hold the pixels.

    The epipolar condition is nearly linear over a block (see `of_middles`), so that means keep it, with less noise.
    Blocks that lack more than single pixels, or hold more than one smooth surface, are left out: an edge, a wrong word.
    So are those seen at a grazing angle, as towards the outline of a ball.
    """
    whole = np.isfinite(phase.u) & np.isfinite(phase.v) & np.isfinite(phase.sigma_u) & np.isfinite(phase.sigma_v)
    count = int(np.count_nonzero(whole))
    side = max(LEAST_BLOCK, int(np.sqrt(count / most) + 0.5))
    blocks = _Blocks(whole, side)
    (u, off_u), (v, off_v) = (blocks.fitted(blocks.completed(image)) for image in (phase.u, phase.v))
    grey, off_grey = blocks.fitted(blocks.of(phase.image))
    sigmas = phase.sigma_u, phase.sigma_v
    variance = np.stack([np.nanmean(blocks.of(s**2), axis=1) / blocks.share for s in sigmas], axis=1).astype(np.float64)
    smooth = (np.stack([off_u, off_v], axis=1) < np.maximum(CREASED**2 * variance, STEPPED**2)).all(axis=1)
    slopes = np.stack([u[:, 1:], v[:, 1:]], axis=1)
    steep = np.linalg.norm(slopes, axis=(1, 2))
    if smooth.any():
        smooth &= steep < GRAZING * median_of(steep[smooth])
    blurred = np.asarray(cv2.GaussianBlur(phase.image, (0, 0), SMOOTH_PX), np.float32)
    grey_slopes = _slopes(grey[:, 1:], blocks.fitted(blocks.of(blurred))[0][:, 1:], off_grey, side, blocks.square)
    with np.errstate(invalid="ignore", divide="ignore"):
        pull = np.einsum("nki,ni->nk", slopes, grey_slopes / grey[:, :1])
    tile = max(float(np.sqrt(count / tiles)) / side, 1.0)
    at = np.stack([blocks.rows, blocks.columns], axis=1)
    pixels = at[:, ::-1].astype(np.float64) * side + (side - 1) / 2
    uv = np.stack([u[:, 0], v[:, 0]], axis=1)
    pull = np.nan_to_num(pull, posinf=0, neginf=0)
    sight = Sight(at, pixels, uv, np.sqrt(variance) / side, slopes, pull)
    return sight.only(np.asarray(smooth)), side, tile


class _Blocks:
    """Square blocks of an image, of those that have coordinates in nearly all their pixels, (n, k)."""

    def __init__(self, whole: NDArray[np.bool_], side: int) -> None:
        self.side = side
        y, x = (np.mgrid[:side, :side] - (side - 1) / 2).reshape(2, -1).astype(np.float32)
        self.square = max(float(x @ x), 1e-9)
        self._planes = np.stack([np.full_like(x, side**-2.0), x / self.square, y / self.square], axis=1)
        self._shape = np.stack([np.ones_like(x), x, y])
        known = self._cut(whole)
        share, aside = known.mean(axis=2), np.hypot(known @ x, known @ y) / side**2
        self.rows, self.columns = np.nonzero((share > WHOLE) & (aside < ASIDE * side))
        self._known, self.share = known[self.rows, self.columns], share[self.rows, self.columns]

    def _cut(self, image: NDArray) -> NDArray:
        side, (h, w) = self.side, (n // self.side for n in image.shape)
        return image[: h * side, : w * side].reshape(h, side, w, side).swapaxes(1, 2).reshape(h, w, side * side)

    def of(self, image: Floats) -> Floats:
        """The pixels of the blocks."""
        return self._cut(image)[self.rows, self.columns]

    def completed(self, image: Floats) -> Floats:
        """The same, pixels that are lacking where the plane through the others of their block has them."""
        values = self.of(image)
        lacking = np.flatnonzero(~self._known.all(axis=1))
        there = self._known[lacking].astype(np.float32)
        own = np.where(self._known[lacking], values[lacking], 0)
        middle = own.sum(axis=1, keepdims=True) / there.sum(axis=1, keepdims=True)
        N = np.einsum("nk,ik,jk->nij", there, self._shape, self._shape)
        plane = np.linalg.solve(N, np.einsum("nk,ik->ni", there * (own - middle), self._shape)[..., None])[..., 0]
        values[lacking] = np.where(self._known[lacking], own, middle + plane @ self._shape)
        return values

    def fitted(self, values: Floats) -> tuple[Array, Array]:
        """Planes of values (n, k): mean and slopes (n, 3); and the mean square of what they leave (n,)."""
        beside = values - values[:, :1]
        rest = beside - (beside @ self._planes) @ self._shape
        square = np.einsum("nk,nk->n", rest, rest).astype(np.float64) / self.side**2
        return (values @ self._planes).astype(np.float64), square


def _slopes(sharp: Array, smooth: Array, off: Array, side: int, square: float) -> Array:
    """Choose slopes of brightness (n, 2): smoothed, but for edges that the pixels of a block show beyond their noise.

    Noise in slopes would make the footprint seem smaller than it is. Its variance is told by what the flattest blocks
    leave of a plane, `off` (n,): white noise has that at their quantile (Wilson and Hilferty).
    """
    freedom = max(side**2 - 3, 1)
    usual = (1 - 2 / (9 * freedom) - FLATTEST[1] * np.sqrt(2 / (9 * freedom))) ** 3
    noise = quantile_of(off, FLATTEST[0]) * side**2 / freedom / usual if len(off) else 0.0
    edge = np.abs(sharp - smooth).max(axis=1) > EDGE * np.sqrt(noise / square)
    return np.where(edge[:, None], sharp, smooth)


def pixels_within(phase: PhaseMap, u: float, v: float, radius_px: float) -> Sight:
    """Give the single pixels with both coordinates within a radius of a place of the image."""
    rows, columns = np.mgrid[
        max(0, int(v - radius_px)) : int(v + radius_px) + 2, max(0, int(u - radius_px)) : int(u + radius_px) + 2
    ].reshape(2, -1)
    near = (np.hypot(columns - u, rows - v) <= radius_px) & (rows < phase.u.shape[0]) & (columns < phase.u.shape[1])
    rows, columns = rows[near], columns[near]
    uv, sigma = (
        np.stack([a[rows, columns], b[rows, columns]], axis=1).astype(np.float64)
        for a, b in ((phase.u, phase.v), (phase.sigma_u, phase.sigma_v))
    )
    pixels = np.stack([columns, rows], axis=1).astype(np.float64)
    return single_places(pixels, uv, sigma).only(np.asarray(np.isfinite(uv + sigma).all(axis=1)))


def single_places(pixels: Array, uv: Array, sigma: Array) -> Sight:
    """Give a sight of places (n, 2) that are no blocks."""
    return Sight(np.zeros((len(uv), 2), np.int64), pixels, uv, sigma, np.zeros((len(uv), 2, 2)), np.zeros_like(uv))


def of_middles(sight: Sight, side: int, pair: Pair) -> Sight:
    """Take from the means over blocks by what they miss the epipolar lines of the blocks' middles.

    The condition ``b · (t × R d) = 0`` of directions b and d is bilinear: the mean of a block's pixels differs from the
    condition on the means by the covariance of b and d within the block, and the means of b and d by what lenses bend.
    """
    camera, projector, pose = pair.camera, pair.projector, pair.projector_from_camera
    spread = (side**2 - 1) / 12

    def seen(device: AdjustedDevice, at: Array) -> tuple[Array, Array, Array]:
        """Directions (n, 3), and their first and second derivatives (n, 2, 3) by u and v."""
        here, *beside = (
            ray_directions(device.spec, device.interior, at + side / 2 * np.array(step))
            for step in ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1))
        )
        up, down = np.stack(beside[:2], axis=1), np.stack(beside[2:], axis=1)
        return here, (up - down) / side, (up + down - 2 * here[:, None]) * (4 / side**2)

    d, by_pixel, bent = (np.cross(pose.translation_mm, a @ pose.rotation.T) for a in seen(camera, sight.pixels))
    b, by_line, curved = seen(projector, sight.uv)
    excess = spread * np.einsum("nij,nki,nkj->n", by_pixel, sight.slopes, by_line)
    excess += spread / 2 * np.einsum("nij,nj->n", bent, b)
    excess += spread / 2 * np.einsum("nkj,nki,nj->n", curved, sight.slopes**2, d)
    across = np.einsum("nkj,nj->nk", by_line, d)
    turned = sight.sigma**2 * across
    share = excess / np.maximum(np.einsum("nk,nk->n", across, turned), np.finfo(float).tiny)
    return replace(sight, uv=sight.uv + share[:, None] * turned)


def epipolar_residuals(sight: Sight, pair: Pair) -> Residuals:
    """Compute the residuals and the points of all places.

    The epipolar residual is stationary in q, so that q may come from the place where both rays come closest; the points
    are one step of least squares from there.
    """
    camera, projector, pose = pair.camera, pair.projector, pair.projector_from_camera
    rays = ray_directions(camera.spec, camera.interior, sight.pixels)
    own = project_with_derivatives(camera.spec, camera.interior, rays)
    by_ray = -inverse_2x2(own.by_point[:, :, :2]) @ own.by_interior
    q = _closest(sight, rays, pair)
    with np.errstate(invalid="ignore", divide="ignore"):
        seen = project_with_derivatives(projector.spec, projector.interior, rays / q[:, None], pose)
        weight = 1 / np.maximum(sight.sigma, LEAST_SIGMA)
        rest = weight * (sight.uv - seen.uv)
        along = -weight * (seen.by_point @ rays[..., None])[..., 0] / q[:, None] ** 2
        by_camera = seen.by_point[:, :, :2] @ by_ray / q[:, None, None]
        by = weight[..., None] * np.concatenate([by_camera, seen.by_interior, seen.by_pose], axis=2)
        information = np.einsum("ni,ni->n", along, along)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.sqrt(information)[:, None]
        q = q + np.einsum("ni,ni->n", along, rest) / information
        by_q = -np.einsum("ni,nik->nk", along, by) / information[:, None]
    return Residuals(
        np.einsum("ni,ni->n", across, rest),
        np.einsum("ni,nik->nk", across, by),
        np.einsum("ni,ni->n", across, weight * sight.pull),
        rays / q[:, None],
        by_q,
        by_ray,
        1 / np.sqrt(information) / np.abs(q),
    )


def _closest(sight: Sight, rays: Array, pair: Pair) -> Array:
    """Inverse depths at which the rays come closest, as seen from the projector."""
    pose = pair.projector_from_camera
    towards = rays @ pose.rotation.T
    back = ray_directions(pair.projector.spec, pair.projector.interior, sight.uv)
    # towards + q t is parallel to back: its cross product with back vanishes
    left, right = np.cross(back, pose.translation_mm), np.cross(back, towards)
    return np.asarray(-np.sum(left * right, axis=1) / np.sum(left**2, axis=1))
