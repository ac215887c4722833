"""What the calibration's covariance does to a point, as polynomials on a coarse grid over the camera's image.

With q the inverse depth (see `system`), the sigma of ``X q²`` at a pixel is smooth in q, but may grow a thousandfold
towards the raster's edge, where distortion is poorly known: a polynomial is fitted to it, not to its square, with equal
relative weights. Its coefficients vary slowly over the image, so that interpolating them costs nothing in accuracy and
saves a factor of a hundred in time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.geometry import Pose, distort, image_to_pixel, lens_of, project, project_with_derivatives, ray_directions
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Interior
from core.numerics import inverse_2x2, nearest

NODES = 25  # rows, and about as many columns
LANES = 4  # columns between nodes are a multiple: what a processor works on at once
DEGREE = 6
SAMPLES = 11  # inverse depths at which a polynomial is fitted
DEPTH_LIMITS = (0.05, 100.0)  # depths tried, in units of the base
MARGIN = 0.15  # points this far outside the raster still count: more than the distance of two nodes


@dataclass(frozen=True)
class Devices:
    """Camera and projector with their specifications, and how they stand to each other."""

    camera: tuple[DeviceSpec, Interior]
    projector: tuple[DeviceSpec, Interior]
    projector_from_camera: Pose


@dataclass(frozen=True)
class SigmaTable:
    """What the calibration's covariance does to a point."""

    #: (rows, columns, 23): of the polynomials for the sigmas of X q², Y q² and Z q² seven coefficients each, highest
    #: power first, and the least and the greatest x at which they hold. The variable is x = q `per_q` - 1.
    nodes: Array
    step: int  #: image columns from node to node, from column 0 on; the rows of nodes are spread evenly over the image
    per_q: float  #: in mm


def depth_slopes(devices: Devices) -> tuple[float, float]:
    """Root mean square of du/d(ln q) and dv/d(ln q), in lines, over the common field of view; (1, 1) without one."""
    uv = _camera_nodes(devices)[::4, ::4]
    rays = ray_directions(*devices.camera, uv)
    tried = _tried(devices)
    lines = _pinhole(devices, rays, tried)
    steps = np.diff(lines, axis=2) / np.diff(np.log(tried))[:, None]
    inside = _lit(devices.projector[0], lines, 0.0)
    both = inside[..., 1:] & inside[..., :-1]
    rms = np.sqrt(np.mean(steps[both] ** 2, axis=0)) if both.any() else np.ones(2)
    return float(rms[0]), float(rms[1])


def make_table(devices: Devices, covariance: Array, axes: str) -> SigmaTable:
    """Propagate the covariance, (k, k) in the order of `Pair.covariance`, at the nodes.

    The observed projector coordinates, `axes`, count with equal weight.
    """
    uv = _camera_nodes(devices)
    step = int(uv[0, 1, 0])
    if not np.diag(covariance).any():
        return SigmaTable(np.zeros((*uv.shape[:2], 3 * (DEGREE + 1) + 2)), step, 1.0)
    least, greatest = _lit_depths(devices, ray_directions(*devices.camera, uv))
    q = least[..., None] + (greatest - least)[..., None] * np.linspace(0, 1, SAMPLES)
    weights = np.array([float("u" in axes), float("v" in axes)])
    per_q = 2 / (np.nanmin(least) + np.nanmax(greatest)) if np.isfinite(least).any() else 1.0
    x = q * per_q - 1
    coefficients = _fitted(x, _variance(devices, uv, q, covariance, weights))
    nodes = np.concatenate([coefficients.reshape(*uv.shape[:2], -1), x[..., :1], x[..., -1:]], axis=-1)
    return SigmaTable(_filled(nodes), step, float(per_q))


def _camera_nodes(devices: Devices) -> Array:
    """Pixel coordinates (rows, columns, 2) of the nodes; the last column lies outside of the image."""
    spec = devices.camera[0]
    step = LANES * -(-spec.width // ((NODES - 1) * LANES))
    rows, columns = np.linspace(0, spec.height - 1, NODES), np.arange(0, spec.width + step, step)
    return np.stack(np.meshgrid(columns, rows), axis=-1)


def _tried(devices: Devices) -> Array:
    """Inverse depths (1/mm) that span whatever the rig may see."""
    base_mm = max(float(np.linalg.norm(devices.projector_from_camera.translation_mm)), 1e-3)
    return np.geomspace(1 / DEPTH_LIMITS[1], 1 / DEPTH_LIMITS[0], 200) / base_mm


def _projected(devices: Devices, rays: Array, q: Array) -> Array:
    """Projector coordinates (rows, columns, k, 2) of rays (rows, columns, 3) at inverse depths q (rows, columns, k)."""
    return project(*devices.projector, rays[..., None, :] / q[..., None], devices.projector_from_camera)


def _pinhole(devices: Devices, rays: Array, tried: Array) -> Array:
    """The same without distortion, whose polynomials fold back into the raster far outside of it."""
    spec, interior = devices.projector
    plain = lens_of(interior).plain(interior)
    q = np.broadcast_to(tried, (*rays.shape[:2], len(tried)))
    return _projected(replace(devices, projector=(spec, plain)), rays, q)


def _lit(spec: DeviceSpec, uv: Array, margin: float) -> NDArray[np.bool_]:
    """Whether projector coordinates lie in the raster enlarged by a share of its size."""
    size = np.array([spec.width - 1, spec.height - 1])
    with np.errstate(invalid="ignore"):
        return np.asarray(np.all((uv >= -margin * size) & (uv <= (1 + margin) * size), axis=-1))


def _lit_depths(devices: Devices, rays: Array) -> tuple[Array, Array]:
    """The least and the greatest of the inverse depths tried at which a ray is lit; NaN where it is at none.

    As `_lit` says of `_pinhole`: that a point lies within an edge of the raster, times its depth, is linear in q.
    """
    spec, interior = devices.projector
    pose, plain = devices.projector_from_camera, lens_of(interior).plain(interior)
    corner = image_to_pixel(spec, distort(plain, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    by_xy = plain.c_mm * (corner[1:] - corner[0])
    parts = []
    for X, Y, Z in (np.moveaxis(rays @ pose.rotation.T, -1, 0), pose.translation_mm):
        seen = X[..., None] * by_xy[0] + Y[..., None] * by_xy[1]
        size = np.array([spec.width - 1, spec.height - 1])
        low, high = (-Z[..., None] * (edge - corner[0]) for edge in (-MARGIN * size, (1 + MARGIN) * size))
        parts.append(np.concatenate([seen - low, high - seen, -Z[..., None]], axis=-1))
    fixed, by_q = parts
    tried = _tried(devices)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = -fixed / by_q
    first = np.searchsorted(tried, np.where(by_q > 0, ends, -np.inf).max(axis=-1))
    last = np.searchsorted(tried, np.where(by_q < 0, ends, np.inf).min(axis=-1), side="right") - 1
    lit = (first <= last) & ~(np.isnan(fixed) | ((by_q == 0) & (fixed < 0))).any(axis=-1)
    held = np.where(lit, [first, last], 0)
    return np.where(lit, tried[held[0]], np.nan), np.where(lit, tried[held[1]], np.nan)


def _fitted(x: Array, variance: Array) -> Array:
    """Polynomials (rows, columns, 3, 7) through the roots of variances (rows, columns, k, 3) at x (rows, cols, k)."""
    known = np.isfinite(variance).all(axis=(-1, -2))
    coefficients = np.full((*known.shape, 3, DEGREE + 1), np.nan)
    powers = x[known][..., None] ** np.arange(DEGREE, -1, -1)
    sigma = np.sqrt(np.maximum(np.swapaxes(variance[known], -1, -2), 0.0))[..., None]  # rounding leaves less than 0
    relative = powers[:, None] / np.maximum(sigma, 1e-6 * sigma.max(axis=-2, keepdims=True) + 1e-30)
    Q, R = np.linalg.qr(relative)
    size = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    sound = size.min(axis=-1) > 1e-13 * size.max(axis=-1)
    solved = np.empty((*sound.shape, DEGREE + 1))
    solved[sound] = np.linalg.solve(R[sound], Q[sound].sum(axis=-2)[..., None])[..., 0]
    solved[~sound] = np.linalg.pinv(relative[~sound]).sum(axis=-1)  # points at one distance only
    coefficients[known] = solved
    return coefficients


def _variance(devices: Devices, uv: Array, q: Array, covariance: Array, weights: Array) -> Array:
    """Variance of X q², shape (rows, columns, k, 3): q = argmin Σ w (observed - f(q, p))² moves with the parameters p.

    ``dq/dp = -Σ w J df/dp / Σ w J²`` with ``J = df/dq``, and ``d(X q²)/dp = q dd/dp - d dq/dp`` for the viewing
    direction d, which moves with the camera's parameters so that its image stands still.
    """
    rays = ray_directions(*devices.camera, uv)[:, :, None]
    seen = project_with_derivatives(*devices.camera, rays)
    dray = np.zeros((*rays.shape, seen.by_interior.shape[-1]))
    dray[..., :2, :] = -inverse_2x2(seen.by_point[..., :2]) @ seen.by_interior
    lit = project_with_derivatives(*devices.projector, rays / q[..., None], devices.projector_from_camera)
    q = q[..., None, None]
    J = -(lit.by_point @ rays[..., None])[..., 0] / q[..., 0] ** 2
    df = np.concatenate([lit.by_point @ dray / q, lit.by_interior, lit.by_pose], axis=-1)
    dq = -((weights * J)[..., None, :] @ df) / np.sum(weights * J**2, axis=-1)[..., None, None]
    G = -rays[..., None] * dq
    G[..., : dray.shape[-1]] += q * dray
    return np.asarray(np.sum((G @ covariance) * G, axis=-1))


def _filled(nodes: Array) -> Array:
    """Carry the nearest known polynomials to nodes where no point can be."""
    known = np.isfinite(nodes).all(axis=-1)
    if known.all() or not known.any():
        return nodes
    filled, there = nodes.copy(), np.argwhere(known)
    missing = np.argwhere(~known)
    filled[~known] = nodes[tuple(there[nearest(there, of=missing)[:, 0]].T)]
    return filled
