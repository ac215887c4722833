"""What of a photogrammetric calibration is prepared once and used for every capture.

A camera pixel with viewing direction d (Z = -1) sees the points ``X = d / q`` with the inverse depth q = -1/Z. In the
projector the point has the homogeneous image ``M d + m q`` with ``M = K R``, ``m = K t``, ``K = diag(c, c, -1)``:
linear in q, which is why everything here is written in q.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from core.geometry import Pose, matrix_from_rotation_vector, project, ray_directions
from core.model import Array, DeviceSpec, Floats, Interior, PhotogrammetricCalibration
from core.reconstruct.rays import camera_rays

PARAMETERS = 24
NODES = (17, 17, 13)  # rows, columns, projector coordinates of the sigma table
DEPTH_LIMITS = (0.05, 100.0)  # depths tried for the table, in units of the base
MARGIN = 0.15  # nodes this far outside the raster still serve: more than the distance of two nodes


@dataclass(frozen=True)
class SigmaTable:
    """What the calibration's covariance does to a point.

    Attributes
    ----------
    q2_variance : array, shape (rows, columns, lines, 3)
        Variance of X q² at nodes spread evenly over the camera's image and the leading projector coordinate.
    nodes_per_line : float
        By which a projector coordinate becomes a place in the table.
    """

    q2_variance: Array
    nodes_per_line: float


@dataclass(frozen=True)
class System:
    """A calibration prepared for forward intersection.

    Attributes
    ----------
    rays : array, shape (H, W, 2)
        Viewing directions of the camera's pixels, see `camera_rays`.
    matrix, vector : arrays, shape (3, 3) and (3,)
        M and m of the module's text.
    radial : tuple
        (A1, A2, A5, A6, -A1 r0² - A2 r0⁴) of the projector.
    line_u, line_v : tuples
        (k0, kx, ky): the projector coordinate is k0 + kx x' + ky y', with (x', y') the image after radial and
        decentring parameters, without principal point; affine parameters, principal point and pitch are in the three.
    slopes : tuple of float
        Root mean square of du/d(ln q) and dv/d(ln q) over the common field of view (lines).
    tables : dict of str to SigmaTable
        For the observed axes, the leading one first: "u", "v", "uv", "vu".
    """

    rays: Floats
    matrix: Array
    vector: Array
    radial: tuple[float, float, float, float, float]
    line_u: tuple[float, float, float]
    line_v: tuple[float, float, float]
    slopes: tuple[float, float]
    tables: dict[str, SigmaTable]


def prepare(calibration: PhotogrammetricCalibration) -> System:
    """Prepare a calibration; the last two are remembered."""
    pose = calibration.projector_from_camera
    return _prepare(
        (calibration.camera.spec, calibration.camera.interior),
        (calibration.projector.spec, calibration.projector.interior),
        np.ascontiguousarray(pose.rotation, np.float64).tobytes(),
        np.ascontiguousarray(pose.translation_mm, np.float64).tobytes(),
        np.ascontiguousarray(calibration.covariance, np.float64).tobytes(),
    )


@lru_cache(maxsize=2)
def _prepare(
    camera: tuple[DeviceSpec, Interior],
    projector: tuple[DeviceSpec, Interior],
    rotation: bytes,
    translation: bytes,
    covariance: bytes,
) -> System:
    # bytes, because an array cannot be the key of a cache
    pose = Pose(np.frombuffer(rotation).reshape(3, 3), np.frombuffer(translation))
    spec, interior = projector
    a1, a2, a3, a4, a5, a6 = interior.a
    r02 = interior.r0_mm**2
    affine = np.array([[1 + a3, a4], [a4, 1 - a3]]) / np.array([[spec.pitch_mm[0]], [-spec.pitch_mm[1]]])
    zero = affine @ (interior.x0_mm, interior.y0_mm) + ((spec.width - 1) / 2, (spec.height - 1) / 2)
    K = np.array([interior.c_mm, interior.c_mm, -1.0])
    slopes, tables = _tabulate(camera, projector, pose, np.frombuffer(covariance).reshape(PARAMETERS, -1))
    return System(
        rays=camera_rays(*camera),
        matrix=K[:, None] * pose.rotation,
        vector=K * pose.translation_mm,
        radial=(a1, a2, a5, a6, -a1 * r02 - a2 * r02 * r02),
        line_u=(float(zero[0]), float(affine[0, 0]), float(affine[0, 1])),
        line_v=(float(zero[1]), float(affine[1, 0]), float(affine[1, 1])),
        slopes=slopes,
        tables=tables,
    )


def _tabulate(
    camera: tuple[DeviceSpec, Interior], projector: tuple[DeviceSpec, Interior], pose: Pose, covariance: Array
) -> tuple[tuple[float, float], dict[str, SigmaTable]]:
    """Propagate the covariance at the nodes of a coarse grid over the common field of view.

    The sigma that comes from the calibration varies slowly over image and depth, so a table costs nothing in accuracy
    and saves a factor of a hundred in time. ``X q²`` is tabulated because its variance hardly depends on q.
    """
    spec = projector[0]
    rows = np.linspace(0, camera[0].height - 1, NODES[0])
    columns = np.linspace(0, camera[0].width - 1, NODES[1])
    uv = np.stack(np.meshgrid(columns, rows), axis=-1)
    rays = ray_directions(*camera, uv)
    base_mm = max(float(np.linalg.norm(pose.translation_mm)), 1e-3)
    tried = np.geomspace(1 / DEPTH_LIMITS[1], 1 / DEPTH_LIMITS[0], 200) / base_mm
    q = np.broadcast_to(tried, (*rays.shape[:2], len(tried)))
    lines = _projected(projector, pose, rays, q)
    # without distortion: far outside the raster its polynomials fold back into it
    a = projector[1].a
    plain = replace(projector[1], a=(0.0, 0.0, a[2], a[3], 0.0, 0.0))
    pinhole = _projected((spec, plain), pose, rays, q)
    slopes = _slopes(spec, pinhole, tried)
    lit = _lit(spec, pinhole, MARGIN)
    tables = {}
    for axes, lead, weights in (
        ("u", 0, (1.0, 0.0)),
        ("v", 1, (0.0, 1.0)),
        ("uv", 0, (1.0, 1.0)),
        ("vu", 1, (1.0, 1.0)),
    ):
        end = (spec.width, spec.height)[lead] - 1
        nodes = np.linspace(0, end, NODES[2])
        q = _inverse_depths(np.where(lit, lines[..., lead], np.nan), tried, nodes)
        variance = _variance(camera, projector, pose, uv, q, covariance, weights)
        tables[axes] = SigmaTable(_filled(variance), (NODES[2] - 1) / end)
    return slopes, tables


def _projected(projector: tuple[DeviceSpec, Interior], pose: Pose, rays: Array, q: Array) -> Array:
    """Projector coordinates (rows, columns, k, 2) of rays (rows, columns, 3) at inverse depths q (rows, columns, k)."""
    return project(*projector, rays[..., None, :] / q[..., None], pose)


def _lit(spec: DeviceSpec, uv: Array, margin: float) -> NDArray[np.bool_]:
    """Whether projector coordinates lie in the raster enlarged by a share of its size."""
    size = np.array([spec.width - 1, spec.height - 1])
    with np.errstate(invalid="ignore"):
        return np.asarray(np.all((uv >= -margin * size) & (uv <= (1 + margin) * size), axis=-1))


def _slopes(spec: DeviceSpec, lines: Array, q: Array) -> tuple[float, float]:
    """Root mean square of du/d(ln q) and dv/d(ln q) over the common field of view."""
    steps = np.diff(lines, axis=2) / np.diff(np.log(q))[:, None]
    inside = _lit(spec, lines, 0.0)
    both = inside[..., 1:] & inside[..., :-1]
    rms = np.sqrt(np.mean(steps[both] ** 2, axis=0)) if both.any() else np.ones(2)
    return float(rms[0]), float(rms[1])


def _inverse_depths(lines: Array, tried: Array, nodes: Array) -> Array:
    """Inverse depth at which each ray has the projector coordinates `nodes`, NaN where it never has one."""
    q = np.full((*lines.shape[:2], len(nodes)), np.nan)
    for index in np.ndindex(lines.shape[:2]):
        known = np.isfinite(lines[index])
        if np.count_nonzero(known) > 1:
            found, at = lines[index][known], tried[known]
            order = np.argsort(found)
            q[index] = np.interp(nodes, found[order], at[order], left=np.nan, right=np.nan)
    return q


def _variance(
    camera: tuple[DeviceSpec, Interior],
    projector: tuple[DeviceSpec, Interior],
    pose: Pose,
    uv: Array,
    q: Array,
    covariance: Array,
    weights: tuple[float, float],
) -> Array:
    """Variance of X q², shape (rows, columns, k, 3): q = argmin Σ w (observed - f(q, p))² moves with the parameters p.

    ``dq/dp = -Σ w J df/dp / Σ w J²`` with ``J = df/dq``, and ``d(X q²)/dp = q dd/dp - d dq/dp`` for the viewing
    direction d; the derivatives are central differences, over a sigma for the parameters.
    """
    uncertain = np.flatnonzero(np.diag(covariance) > 0)
    if not len(uncertain):
        return np.zeros((*q.shape, 3))
    rays = ray_directions(*camera, uv)
    h = 1e-4 * q
    J = (_projected(projector, pose, rays, q + h) - _projected(projector, pose, rays, q - h)) / (2 * h[..., None])
    information = np.sum(weights * J**2, axis=-1)
    columns = []
    for p in uncertain:
        step = float(np.sqrt(covariance[p, p]))
        ends = []
        for sign in (1, -1):
            moved = _moved(camera, projector, pose, int(p), sign * step)
            ray = ray_directions(*moved[0], uv)
            ends.append((_projected(moved[1], moved[2], ray, q), ray))
        df, dray = ((one - other) / (2 * step) for one, other in zip(*ends, strict=True))
        dq = -np.sum(weights * J * df, axis=-1) / information
        columns.append(q[..., None] * dray[:, :, None, :] - rays[:, :, None, :] * dq[..., None])
    G = np.stack(columns, axis=-1)
    return np.asarray(np.einsum("...ki,ij,...kj->...k", G, covariance[np.ix_(uncertain, uncertain)], G, optimize=True))


def _moved(
    camera: tuple[DeviceSpec, Interior], projector: tuple[DeviceSpec, Interior], pose: Pose, parameter: int, step: float
) -> tuple[tuple[DeviceSpec, Interior], tuple[DeviceSpec, Interior], Pose]:
    """Change one of the 24 parameters in the order of `PhotogrammetricCalibration.covariance`."""
    change = np.zeros(PARAMETERS)
    change[parameter] = step
    cam = Interior.from_vector(camera[1].vector + change[:9], camera[1].r0_mm)
    proj = Interior.from_vector(projector[1].vector + change[9:18], projector[1].r0_mm)
    turned = matrix_from_rotation_vector(change[18:21]) @ pose.rotation
    return (camera[0], cam), (projector[0], proj), Pose(turned, pose.translation_mm + change[21:24])


def _filled(table: Array) -> Array:
    """Carry the nearest known value to nodes that no point can have."""
    known = np.isfinite(table).all(axis=-1)
    if known.all() or not known.any():
        return table
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(table[tuple(nearest)])
