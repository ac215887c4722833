"""The profile of every dot along rays from its centre: contour, blur, background, plateau, and what disturbs them.

Rays are sampled in the coordinates of the expected ellipse (unit disc), so that a circle at any tilt has the same
contour radius in every direction, up to a second harmonic that a slightly wrong tilt leaves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.measure.kernels import sample
from core.measure.robust import normal_equations, row_median

Array = NDArray[np.float64]

RAYS = 24
STEPS = 25
FOOT = 0.25  # share of the contrast at which a second contour shows what is too dim for the one at one half
ANGLES = np.arange(RAYS) * (2 * np.pi / RAYS)
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
# contour radius over the angle: size, centre, tilt
HARMONICS = np.stack([np.ones(RAYS), *DIRECTIONS.T, np.cos(2 * ANGLES), np.sin(2 * ANGLES)], axis=1)
FIT = np.linalg.pinv(HARMONICS)


@dataclass(frozen=True)
class Profiles:
    """What the rays of m dots tell; lengths in px."""

    plateau: Array  # (m,) grey values inside the dot
    plane: Array  # (m, 3) background: value at the centre and its slopes per px in u and v
    blur: Array  # (m,) sigma of the edge
    contour: Array  # (m, 5) harmonics of the contour's radius in the unit disc
    window: Array  # (m,) radius in the unit disc that holds the whole blurred dot and no neighbour
    roughness: Array  # (m,) largest distance of the contour (3 rays averaged) from its ellipse, at half and at a quarter; NaN: open
    off_centre: Array  # (m,) distance of the contour's centre from the given centre
    inside: Array  # (m,) largest deviation from the plateau inside, in units of the contrast
    outside: Array  # (m,) brightest disturbance within the window but off the dot, in units of the contrast
    gentle: Array  # (m,) radius in px inside which the plateau is free of the edge's blur, 0 where there is none

    @property
    def contrast(self) -> Array:
        """(m,) plateau above background."""
        return self.plateau - self.plane[:, 0]


def on_rays(centre: Array, ellipse: Array, radius: Array) -> Array:
    """Pixels (m, RAYS, k, 2) at `radius` (m, RAYS, k) or (m, 1, k) in the unit disc along the rays of every dot."""
    ray = DIRECTIONS @ np.swapaxes(ellipse, 1, 2)
    return np.asarray(centre[:, None, None, :] + radius[..., None] * ray[:, :, None, :])


def sample_at(image: NDArray[np.float32], uv: Array) -> Array:
    """Bilinear values at points (..., 2); NaN outside the image."""
    out = np.empty(uv[..., 0].size)
    sample(image, np.ascontiguousarray(uv.reshape(-1, 2)), out)
    return out.reshape(uv.shape[:-1])


def profiles(image: NDArray[np.float32], centre: Array, ellipse: Array, spacing: Array) -> Profiles:
    """Measure the profiles of dots.

    Parameters
    ----------
    image : float32, shape (H, W)
        Dots bright.
    centre : array, shape (m, 2)
        Good to about a pixel.
    ellipse : array, shape (m, 2, 2)
        Maps of the unit disc to the dots, px.
    spacing : array, shape (m,)
        Distance of the nearest other target over the dot's radius.
    """
    along = np.linalg.norm(DIRECTIONS @ np.swapaxes(ellipse, 1, 2), axis=2)  # (m, rays) px
    minor = along.min(axis=1)
    inner = sample_at(image, on_rays(centre, ellipse, np.array([0.0, 0.15, 0.3, 0.45])[None, None, :]))
    plateau = row_median(inner.reshape(len(centre), -1))
    far = np.clip(1.0 + 4.0 / minor, 1.0, spacing / 2)
    plane = _background(image, centre, ellipse, far, spacing)

    reach = 3.0 + 0.15 * minor
    offset = reach[:, None] * np.linspace(-1, 1, STEPS)  # (m, steps) px
    radius = np.maximum(1.0 + offset[:, None, :] / along[:, :, None], 0.0)
    at = on_rays(centre, ellipse, radius)
    value = sample_at(image, at)
    share = _share(value, at, centre, plane, plateau)
    crossing, closed = _crossing(share, radius, 0.5)
    foot, _ = _crossing(share, radius, FOOT)
    contour = crossing @ FIT.T
    blur = _blur(np.median(np.where(np.isfinite(share), share, 0.0), axis=1), offset)

    window = np.minimum(contour[:, 0] + (3.0 * blur + 1.0) / minor, np.maximum(spacing / 2, 1.0 + 1.0 / minor))
    window = np.where(np.isfinite(window), window, far)
    plane = _background(image, centre, ellipse, window, spacing)
    share = _share(value, at, centre, plane, plateau)
    rough = np.maximum(_roughness(crossing, along), _roughness(foot, along))
    soft = (2.5 * blur + 0.7)[:, None, None] / along[:, :, None]
    edge = (contour @ HARMONICS.T)[:, :, None]
    is_out = (radius > edge + soft) & (radius < window[:, None, None])
    wide = on_rays(centre, ellipse, np.linspace(0.0, 0.9, 10)[None, None, :])
    deep = np.linspace(0.0, 0.9, 10)[None, None, :] < edge - soft
    within = _share(sample_at(image, wide), wide, centre, plane, plateau)
    return Profiles(
        plateau=plateau,
        plane=plane,
        blur=blur,
        contour=contour,
        window=window,
        roughness=np.where(closed, rough, np.nan),
        off_centre=np.linalg.norm(np.einsum("mij,mj->mi", ellipse, contour[:, 1:3]), axis=1),
        inside=np.max(np.where(deep, np.abs(within - 1.0), 0.0), axis=(1, 2)),
        outside=np.max(np.where(is_out, share, 0.0), axis=(1, 2)),
        gentle=np.maximum(contour[:, 0] * minor - 2.5 * blur - 0.7, 0.0),
    )


def _share(value: Array, at: Array, centre: Array, plane: Array, plateau: Array) -> Array:
    """Grey values as shares of the contrast: 0 background, 1 plateau."""
    d = at - centre[:, None, None, :]
    below = plane[:, 0, None, None] + plane[:, 1, None, None] * d[..., 0] + plane[:, 2, None, None] * d[..., 1]
    contrast = np.maximum(plateau - plane[:, 0], 1e-9)[:, None, None]
    return np.asarray((value - below) / contrast)


def _background(image: NDArray[np.float32], centre: Array, ellipse: Array, start: Array, spacing: Array) -> Array:
    """Robust plane (m, 3) through the ring between the dot's blur and that of its neighbours."""
    minor = np.linalg.svd(ellipse, compute_uv=False)[:, 1]
    stop = np.maximum(np.minimum(start + np.maximum(1.0, 5.0 / minor), spacing - start), start + 0.15)
    radius = start[:, None] + (stop - start)[:, None] * np.linspace(0, 1, 5)
    at = on_rays(centre, ellipse, radius[:, None, :])
    value = sample_at(image, at).reshape(len(centre), -1)
    d = (at - centre[:, None, None, :]).reshape(len(centre), -1, 2)
    A = np.concatenate([np.ones((*value.shape, 1)), d], axis=2)
    usable = np.isfinite(value)
    model = row_median(value)[:, None]
    plane = np.zeros((len(centre), 3))
    for _ in range(3):
        off = np.abs(np.where(usable, value - model, np.nan))
        weight = usable & (off <= 3.5 * 1.4826 * row_median(off)[:, None] + 1e-6)
        N, b = normal_equations(A, weight, np.where(weight, value, 0.0)[..., None])
        plane = np.linalg.solve(N + 1e-9 * np.eye(3), b)[..., 0]
        model = (A @ plane[..., None])[..., 0]
    return plane


def _roughness(crossing: Array, along: Array) -> Array:
    """Largest distance (m,) in px, 3 rays averaged, of a contour (m, rays) from the ellipse fitted to it."""
    off = (crossing - crossing @ FIT.T @ HARMONICS.T) * along
    return np.asarray(np.abs(off + np.roll(off, 1, axis=1) + np.roll(off, -1, axis=1)).max(axis=1) / 3)


def _crossing(share: Array, radius: Array, level: float) -> tuple[Array, NDArray[np.bool_]]:
    """Unit-disc radius (m, rays) where each ray first falls below a level, and whether all rays of a dot do."""
    below = ~(share >= level)
    first = np.argmax(below, axis=2)
    found = np.any(below, axis=2) & (first > 0)
    k = np.maximum(first, 1)[..., None]
    high, low = (np.take_along_axis(share, i, 2)[..., 0] for i in (k - 1, k))
    near, far = (np.take_along_axis(radius, i, 2)[..., 0] for i in (k - 1, k))
    with np.errstate(all="ignore"):
        crossing = near + (far - near) * (high - level) / (high - low)
    return np.where(found & np.isfinite(crossing), crossing, 1.0), np.all(found & np.isfinite(crossing), axis=1)


def _blur(profile: Array, offset: Array) -> Array:
    """Sigma of the edge in px from where the mean profile (m, steps) falls through 80 % and 20 %."""
    edges = []
    for level in (0.8, 0.2):
        k = np.clip(np.argmax(profile < level, axis=1), 1, profile.shape[1] - 1)[:, None]
        high, low = np.take_along_axis(profile, k - 1, 1)[:, 0], np.take_along_axis(profile, k, 1)[:, 0]
        near, far = np.take_along_axis(offset, k - 1, 1)[:, 0], np.take_along_axis(offset, k, 1)[:, 0]
        with np.errstate(all="ignore"):
            edges.append(near + (far - near) * np.clip((high - level) / (high - low), 0, 1))
    sigma = (edges[1] - edges[0]) / 1.683  # a Gaussian's edge needs 1.683 sigma from 80 % to 20 %
    return np.clip(np.nan_to_num(sigma, nan=1.0), 0.3, 4.0)
