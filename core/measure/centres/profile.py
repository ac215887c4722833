"""The profile of every dot along rays from its centre: contour, blur, background, plateau, and what disturbs them.

In the unit disc of the expected ellipse a circle at any tilt has the same contour radius in every direction, up to a
second harmonic that a slightly wrong tilt leaves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.measure.centres.rays import ANGLES, DIRECTIONS, RAYS, Rays
from core.model import Array, Floats
from core.numerics import MEDIAN_OF_NORMAL, inverse_2x2, normal_equations, row_median

STEPS = 25
FOOT = 0.25  # share of the contrast at which a second contour shows what is too dim for the one at one half
PLATEAU = np.array([0.0, 0.15, 0.3, 0.45])
READ_BETWEEN = 1 / 6  # px²: variance of the triangle that bilinear reading at any place blurs by, on average
DEEP = np.linspace(0.0, 0.9, 10)
EDGE = 1.683  # sigmas from 80 % to 20 % of a Gaussian's straight edge
# contour radius over the angle: size, centre, tilt
HARMONICS = np.stack([np.ones(RAYS), *DIRECTIONS.T, np.cos(2 * ANGLES), np.sin(2 * ANGLES)], axis=1)
FIT = np.linalg.pinv(HARMONICS)


@dataclass(frozen=True)
class Outlines:
    """What the rays of m dots tell of their size and light; lengths in px."""

    plateau: Array  # (m,) grey values inside the dot
    plane: Array  # (m, 3) background: value at the centre and its slopes per px in u and v
    slopes: Array  # (m, 2, 2) cofactors of those slopes, of uncorrelated samples
    blur: Array  # (m,) sigma of the edge
    contour: Array  # (m, 5) harmonics of the contour's radius in the unit disc
    window: Array  # (m,) radius in the unit disc that holds the whole blurred dot and no neighbour

    @property
    def contrast(self) -> Array:
        """(m,) plateau above background."""
        return self.plateau - self.plane[:, 0]

    @property
    def spread(self) -> Array:
        """(m,) variance of the edge in px², without what reading between pixels adds."""
        return np.maximum(self.blur**2 - READ_BETWEEN, 1 / 12)


@dataclass(frozen=True)
class Profiles(Outlines):
    """And of what disturbs them."""

    roughness: Array  # (m,) largest distance of the contours (3 rays averaged) from their ellipses; NaN where open
    off_centre: Array  # (m,) distance of the contour's centre from the given centre
    inside: Array  # (m,) largest deviation from the plateau inside, in units of the contrast
    outside: Array  # (m,) brightest disturbance within the window but off the dot, in units of the contrast
    tilt: Array  # (m, 2) relative change of the light per px seen inside, 0 where there is no plateau
    gentle: Array  # (m,) radius in px inside which the plateau is free of the edge's blur, 0 where there is none


def outlines(image: Floats, rays: Rays, spacing: Array) -> Outlines:
    """Measure size and light of bright dots along rays from centres that are good to about a pixel.

    `spacing`, (m,), is the distance of the nearest other target over the dot's radius.
    """
    return _outlined(image, rays, spacing)[0]


def profiles(image: Floats, rays: Rays, spacing: Array, ground: Floats | None = None) -> Profiles:
    """Measure the whole profiles, as `outlines` does the most important; the background in an image of its own."""
    known, radius, value, crossing, closed = _outlined(image, rays, spacing, ground)
    along, minor, contour = rays.length, rays.minor, known.contour
    share = _share(value, radius, rays, known.plane, known.plateau)
    soft = (2.5 * known.blur + 0.7)[:, None, None] / along[:, :, None]
    edge = (contour @ HARMONICS.T)[:, :, None]
    is_out = (radius > edge + soft) & (radius < known.window[:, None, None])
    within = _share(rays.sample(image, DEEP), DEEP[None, None, :], rays, known.plane, known.plateau)
    gentle = np.maximum(contour[:, 0] * minor - 2.5 * known.blur - 0.7, 0.0)
    free = (gentle / minor)[:, None] >= DEEP  # (m, 10), each radius of the disc by its area
    tilt = np.einsum("mrk,mk,rd->md", within, free * DEEP**2, DIRECTIONS) / np.maximum(free @ DEEP**3, 1e-9)[:, None]
    tilt = np.einsum("mij,mi->mj", inverse_2x2(rays.ellipse), tilt) / (RAYS / 2)
    rough = np.maximum(_roughness(crossing, along), _roughness(_crossing(share, radius, FOOT)[0], along))
    return Profiles(
        plateau=known.plateau,
        plane=known.plane,
        slopes=known.slopes,
        blur=known.blur,
        contour=contour,
        window=known.window,
        roughness=np.where(closed, rough, np.nan),
        off_centre=np.linalg.norm(np.einsum("mij,mj->mi", rays.ellipse, contour[:, 1:3]), axis=1),
        inside=np.max(np.where(edge - soft > DEEP, np.abs(within - 1), 0), axis=(1, 2)),
        outside=np.max(np.where(is_out, share, 0), axis=(1, 2)),
        tilt=tilt,
        gentle=gentle,
    )


def _outlined(
    image: Floats, rays: Rays, spacing: Array, ground: Floats | None = None
) -> tuple[Outlines, Array, Floats, Array, NDArray[np.bool_]]:
    """Outlines; radii and values along the rays; where they fall to half the contrast, and whether all do."""
    ground = image if ground is None else ground
    along, minor = rays.length, rays.minor
    plateau = row_median(rays.sample(image, PLATEAU).reshape(len(minor), -1))
    far = np.clip(1.0 + 4.0 / minor, 1.0, spacing / 2)
    plane, _ = _background(ground, rays, far, spacing, rounds=1)

    offset = (3.0 + 0.15 * minor)[:, None] * np.linspace(-1, 1, STEPS)  # (m, steps) px
    radius = np.maximum(1.0 + offset[:, None, :] / along[:, :, None], 0.0)
    value = rays.sample(image, radius)
    share = _share(value, radius, rays, plane, plateau)
    crossing, closed = _crossing(share, radius, 0.5)
    contour = crossing @ FIT.T
    width = (_crossing(share, radius, 0.2)[0] - _crossing(share, radius, 0.8)[0]) * along
    blur = np.clip(row_median(width) / EDGE, 0.3, 4.0)

    window = np.minimum(contour[:, 0] + (3.0 * blur + 1.0) / minor, np.maximum(spacing / 2, 1.0 + 1.0 / minor))
    plane, slopes = _background(ground, rays, window, spacing, rounds=3)
    return Outlines(plateau, plane, slopes, blur, contour, window), radius, value, crossing, closed


def _share(value: Floats, radius: Array, rays: Rays, plane: Array, plateau: Array) -> Floats:
    """Grey values as shares of the contrast: 0 background, 1 plateau."""
    slope = (rays.unit @ plane[:, 1:, None]).astype(np.float32)  # (m, rays, 1) along each ray
    below = plane[:, 0, None, None].astype(np.float32) + slope * radius.astype(np.float32)
    contrast = np.maximum(plateau - plane[:, 0], 1e-9)[:, None, None].astype(np.float32)
    return np.asarray((value - below) / contrast)


def _background(image: Floats, rays: Rays, start: Array, spacing: Array, rounds: int) -> tuple[Array, Array]:
    """Robust plane (m, 3) through the ring between the dot's blur and that of its neighbours; its slopes' cofactors."""
    stop = np.maximum(np.minimum(start + np.maximum(1.0, 5.0 / rays.minor), spacing - start), start + 0.15)
    radius = start[:, None] + (stop - start)[:, None] * np.linspace(0, 1, 4)
    value = rays.sample(image, radius).reshape(len(start), -1)
    d = rays.offsets(radius).reshape(len(start), -1, 2)
    A = np.concatenate([np.ones((*value.shape, 1)), d], axis=2)
    usable = np.isfinite(value)
    value = np.where(usable, value, 0)
    model = row_median(np.where(usable, value, np.nan))[:, None]
    plane, N = np.zeros((len(start), 3)), np.zeros((len(start), 3, 3))
    for _ in range(rounds):
        off = np.where(usable, np.abs(value - model), np.nan).astype(np.float32)
        weight = usable & (off <= 3.5 / MEDIAN_OF_NORMAL * row_median(off)[:, None] + 1e-6)
        N, b = normal_equations(A, weight.astype(np.float64), value[..., None])
        N += 1e-9 * np.eye(3)
        plane = np.asarray(np.linalg.solve(N, b)[..., 0], np.float64)
        model = (A @ plane[..., None])[..., 0]
    return plane, np.asarray(np.linalg.inv(N)[:, 1:, 1:], np.float64)


def _roughness(crossing: Array, along: Array) -> Array:
    """Largest distance (m,) in px, 3 rays averaged, of a contour (m, rays) from the ellipse fitted to it."""
    off = (crossing - crossing @ FIT.T @ HARMONICS.T) * along
    return np.asarray(np.abs(off + np.roll(off, 1, axis=1) + np.roll(off, -1, axis=1)).max(axis=1) / 3)


def _crossing(share: Floats, radius: Array, level: float) -> tuple[Array, NDArray[np.bool_]]:
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
