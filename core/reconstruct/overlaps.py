"""Clouds of one object from several stations: where they see the same place, its mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from core.geometry import project_with_derivatives
from core.lazy import dataclass
from core.model import Array, PointCloud
from core.reconstruct.placed import Device

AGREE = 4.0  # standard deviations by which two stations may see the same place apart
ROUGH = 0.2  # pixels on the surface that its noise may be: beyond, slopes come from more pixels than four
AROUND, UNEVEN = 3, 1.6  # these, to either side; what planes may leave of their noise
OBLIQUE = 0.25  # cosine between a ray of either view and the surface's normal: below, it slides past the surface


@dataclass(frozen=True)
class Seen:
    """What a camera saw of an object at a station: its cloud (H, W) in its own frame, sigmas along the base's axes."""

    cloud: PointCloud
    camera: Device
    station: int


@dataclass(frozen=True)
class _Points:
    """Points (n) of a view: pixels, rays that end at depth 1, depths, and variances of depths by noise."""

    at: tuple[NDArray, NDArray]
    rays: Array
    depth: Array
    noise: Array
    shared: Array  # (n, 3), sigmas by calibration and poses along the axes of the common frame

    @classmethod
    def of(cls, view: Seen) -> _Points:
        cloud = view.cloud
        assert cloud.sigma_mm is not None
        assert cloud.sigma_depth_mm is not None
        at = np.nonzero(np.isfinite(cloud.xyz_mm[..., 2]))
        X, noise = cloud.xyz_mm[at].astype(np.float64), cloud.sigma_depth_mm[at].astype(np.float64) ** 2
        rays = -X / X[:, 2:]
        by_noise = (rays @ view.camera.from_base.rotation) ** 2 * noise[:, None]
        shared = np.sqrt(np.maximum(cloud.sigma_mm[at].astype(np.float64) ** 2 - by_noise, 0.0))
        return cls((at[0], at[1]), rays, -X[:, 2], noise, shared)


def averaged(views: Sequence[Seen]) -> list[tuple[PointCloud, NDArray[np.int64]]]:
    """Give each place once, from the first station that sees it, at the mean of all that do.

    For each view: the cloud with the places that it gives, NaN elsewhere, and which views have a part in each pixel,
    (H, W), as bits. Points stay on the rays of their pixels; views of one station are not compared with each other.

    A ray meets the surface of another view, bilinear between four pixels; where that is steep to the other view's own
    rays, it joins two surfaces at an outline, and is no surface. Depths are weighed by their noise; errors of
    the calibration and of poses, which views share to a part that is not worked out, count as if they were the same:
    their sigma is the mean of the views' sigmas, which theirs never exceeds. Where views differ by more than their
    noise, as where texture draws coordinates in each, the mean's noise is taken to be larger by the same ratio.
    """
    found = []
    seen = [_Points.of(view) for view in views]
    for i, (view, points) in enumerate(zip(views, seen, strict=True)):
        X = points.rays * points.depth[:, None]
        weights, sums, squares = 1 / points.noise, np.zeros(len(X)), np.zeros(len(X))
        shared, made = points.shared / points.noise[:, None], np.full(len(X), 1 << i)
        first, many = np.ones(len(X), bool), np.ones(len(X), np.int64)
        for j, other in enumerate(views):
            if other.station == view.station:
                continue
            relative = other.camera.from_base @ view.camera.from_base.inverse()
            shift, noise, theirs = _met(relative.apply(X), points.rays @ relative.rotation.T, other, seen[j])
            limit = points.noise + noise + np.sum((points.shared + theirs) ** 2, axis=1)
            with np.errstate(invalid="ignore"):
                same = shift**2 < AGREE**2 * limit
            weight, shift = np.where(same, 1 / noise, 0.0), np.where(same, shift, 0.0)
            weights, sums, squares = weights + weight, sums + weight * shift, squares + weight * shift**2
            shared = shared + np.where(same[:, None], theirs, 0.0) * weight[:, None]
            made[same] |= 1 << j
            many[same] += 1
            first &= ~(same & (j < i))
        noise = _misfit(squares - sums**2 / weights, many) / weights
        found.append(_changed(view, points, first, sums / weights, noise, shared / weights[:, None], made))
    return found


def _misfit(squares: Array, many: NDArray[np.int64]) -> Array:
    """By how much more than noise makes them so many views differ, as variances, at least 1 (Birge's ratio)."""
    factor = np.ones(len(many))
    for n in np.unique(many[many > 1]):
        alike = many == n
        factor[alike] = max(1.0, float(np.mean(squares[alike])) / (n - 1))
    return factor


def _met(X: Array, rays: Array, other: Seen, points: _Points) -> tuple[Array, Array, Array]:
    """Change of depth of points (n, 3) on rays to another view's surface, NaN unless met from outside; noise,
    sigmas.
    """
    height, width = other.cloud.xyz_mm.shape[:2]
    q, noise, index = (np.full((height, width), np.nan) for _ in range(3))
    q[points.at], noise[points.at], index[points.at] = (
        1 / points.depth,
        points.noise / points.depth**4,
        np.arange(len(points.depth)),
    )
    seen = project_with_derivatives(other.camera.spec, other.camera.interior, X)
    with np.errstate(invalid="ignore"):
        inside = np.all((seen.uv >= 0) & (seen.uv < (width - 1, height - 1)), axis=1) & (X[:, 2] < 0)
    corner = np.where(inside[:, None], np.floor(seen.uv), 0).astype(np.int64)
    u, v = (np.where(inside[:, None], seen.uv, 0.0) - corner).T
    corners = [(corner[:, 1] + down, corner[:, 0] + right) for down in (0, 1) for right in (0, 1)]
    a, b, c, d = (q[at] for at in corners)
    share = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])
    surface = share[0] * a + share[1] * b + share[2] * c + share[3] * d
    variance = sum(s**2 * noise[at] for s, at in zip(share, corners, strict=True))
    slopes = np.stack([(1 - v) * (b - a) + v * (d - c), (1 - u) * (c - a) + u * (d - b)], axis=1)
    near = corner[:, 1] + np.rint(v).astype(int), corner[:, 0] + np.rint(u).astype(int)
    wide, even = (each[near] for each in _wide(q, noise))
    focal = other.camera.interior.c_mm / min(other.camera.spec.pitch_mm)
    rough = even & (focal**2 * variance > ROUGH**2 * surface**2)
    slopes = np.where(rough[:, None], wide, slopes)
    by_point = np.einsum("nk,nki->ni", slopes, seen.by_point)
    by_point[:, 2] -= 1 / X[:, 2] ** 2
    along = np.einsum("ni,ni->n", by_point, rays)
    size, own = np.linalg.norm(by_point, axis=1), np.einsum("ni,ni->n", by_point, X)
    with np.errstate(invalid="ignore"):
        inside &= along > OBLIQUE * size * np.linalg.norm(rays, axis=1)
        inside &= own > OBLIQUE * size * np.linalg.norm(X, axis=1)  # else it joins two surfaces at an outline
        along = np.where(inside, along, np.nan)
    return (
        -(surface + 1 / X[:, 2]) / along,
        variance / along**2,
        points.shared[np.nan_to_num(index[near]).astype(np.int64)],
    )


def _wide(q: Array, noise: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Slopes (H, W, 2) of planes through the pixels around each, and where these are valid and even but for noise."""
    valid = np.isfinite(q)
    side, values = 2 * AROUND + 1, np.where(valid, q, 0.0)
    steps, ones = np.arange(-AROUND, AROUND + 1.0), np.ones(side)

    def summed(of: Array, rows: Array = ones, columns: Array = ones) -> Array:
        return np.asarray(cv2.sepFilter2D(of, cv2.CV_64F, columns, rows, borderType=cv2.BORDER_CONSTANT))

    square = side * float(steps @ steps)
    slopes = np.stack([summed(values, columns=steps), summed(values, rows=steps)], axis=-1) / square
    left = summed(values**2) - summed(values) ** 2 / side**2 - square * np.sum(slopes**2, axis=-1)
    whole = summed(valid.astype(float)) > side**2 - 0.5
    return slopes, whole & (left < UNEVEN * summed(np.where(valid, noise, 0.0)))


def _changed(
    view: Seen, points: _Points, kept: NDArray[np.bool_], shift: Array, noise: Array, shared: Array, made: NDArray
) -> tuple[PointCloud, NDArray[np.int64]]:
    """The view's cloud with depths shifted, of the points that are kept."""
    cloud, at = view.cloud, tuple(index[kept] for index in points.at)
    xyz, sigma = (np.full_like(a, np.nan) for a in (cloud.xyz_mm, cloud.sigma_mm))
    depth, by = np.full_like(cloud.sigma_depth_mm, np.nan), np.zeros(cloud.xyz_mm.shape[:2], np.int64)
    rays = points.rays[kept]
    xyz[at] = rays * (points.depth + shift)[kept][:, None]
    by_noise = (rays @ view.camera.from_base.rotation) ** 2 * noise[kept][:, None]
    sigma[at], depth[at], by[at] = np.sqrt(by_noise + shared[kept] ** 2), np.sqrt(noise[kept]), made[kept]
    return replace(cloud, xyz_mm=xyz, sigma_mm=sigma, sigma_depth_mm=depth), by
