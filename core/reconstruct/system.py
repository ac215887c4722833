"""What of a photogrammetric calibration is prepared once and used for every capture.

A camera pixel with viewing direction d (Z = -1) sees the points ``X = d / q`` with the inverse depth q = -1/Z. In the
projector the point has the homogeneous image ``M d + m q`` with ``M = K R``, ``m = K t``, ``K = diag(c, c, -1)``:
linear in q, which is why everything here is written in q.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from core.geometry import Pose, matrix_from_rotation_vector, project, ray_directions
from core.model import Array, DeviceSpec, Floats, Interior, PhotogrammetricCalibration
from core.reconstruct.rays import camera_rays

PARAMETERS = 24
NODES = (17, 17, 12)  # rows, columns, inverse depths of the sigma table
DEPTH_LIMITS = (0.05, 100.0)  # depths tried for the table, in units of the base


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
        Root mean square of |du/dq| and |dv/dq| over the common field of view (lines mm).
    nodes : tuple of arrays
        Rows, columns (px) and inverse depths (1/mm) of the sigma table.
    q2_variance : dict of axes to array, shape (rows, columns, depths, 3)
        Variance of X q² that comes from the calibration's covariance, when "u", "v" or "uv" are observed.
    """

    rays: Floats
    matrix: Array
    vector: Array
    radial: tuple[float, float, float, float, float]
    line_u: tuple[float, float, float]
    line_v: tuple[float, float, float]
    slopes: tuple[float, float]
    nodes: tuple[Array, Array, Array]
    q2_variance: dict[str, Array]


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
    nodes, slopes, variances = _tabulate(camera, projector, pose, np.frombuffer(covariance).reshape(PARAMETERS, -1))
    return System(
        rays=camera_rays(*camera),
        matrix=K[:, None] * pose.rotation,
        vector=K * pose.translation_mm,
        radial=(a1, a2, a5, a6, -a1 * r02 - a2 * r02 * r02),
        line_u=(float(zero[0]), float(affine[0, 0]), float(affine[0, 1])),
        line_v=(float(zero[1]), float(affine[1, 0]), float(affine[1, 1])),
        slopes=slopes,
        nodes=nodes,
        q2_variance=variances,
    )


def _tabulate(
    camera: tuple[DeviceSpec, Interior], projector: tuple[DeviceSpec, Interior], pose: Pose, covariance: Array
) -> tuple[tuple[Array, Array, Array], tuple[float, float], dict[str, Array]]:
    """Propagate the covariance at the nodes of a coarse grid over the common field of view.

    The sigma that comes from the calibration varies slowly over image and depth, so a table costs nothing in accuracy
    and a factor of a hundred in time. ``X q²`` is tabulated because its variance hardly depends on q.
    """
    base_mm = float(np.linalg.norm(pose.translation_mm))
    rows = np.linspace(0, camera[0].height - 1, NODES[0])
    columns = np.linspace(0, camera[0].width - 1, NODES[1])
    uv = np.stack(np.meshgrid(columns, rows), axis=-1)
    tried = np.geomspace(1 / DEPTH_LIMITS[1], 1 / DEPTH_LIMITS[0], 200) / max(base_mm, 1e-3)
    inside = _lit(projector[0], _projected(projector, pose, ray_directions(*camera, uv), tried))
    seen = tried[inside.any(axis=(0, 1))] if inside.any() else tried
    inverse_depths = np.linspace(seen[0], seen[-1], NODES[2])
    slope, derivatives, rays = _derivatives(camera, projector, pose, uv, inverse_depths, covariance)
    lit = _lit(projector[0], _projected(projector, pose, rays, inverse_depths))
    common = slope[lit] if lit.any() else slope[np.isfinite(slope).all(axis=-1)]
    rms = np.sqrt(np.mean(common**2, axis=0)) if len(common) else np.zeros(2)
    variances = {
        axes: _variance(slope, derivatives, rays, inverse_depths, covariance, use)
        for axes, use in (("u", (1.0, 0.0)), ("v", (0.0, 1.0)), ("uv", (1.0, 1.0)))
    }
    return (rows, columns, inverse_depths), (float(rms[0]), float(rms[1])), variances


def _projected(projector: tuple[DeviceSpec, Interior], pose: Pose, rays: Array, inverse_depths: Array) -> Array:
    """Projector coordinates (rows, columns, depths, 2) of the rays (rows, columns, 3) at the inverse depths."""
    points = rays[..., None, :] / inverse_depths[:, None]
    return project(*projector, points, pose)


def _lit(spec: DeviceSpec, uv: Array) -> Array:
    with np.errstate(invalid="ignore"):
        return np.all((uv >= 0) & (uv <= (spec.width - 1, spec.height - 1)), axis=-1)


def _derivatives(
    camera: tuple[DeviceSpec, Interior],
    projector: tuple[DeviceSpec, Interior],
    pose: Pose,
    uv: Array,
    inverse_depths: Array,
    covariance: Array,
) -> tuple[Array, list[tuple[int, Array, Array]], Array]:
    """Central differences of the projector coordinates by q and by every uncertain parameter.

    Returns
    -------
    slope : array, shape (rows, columns, depths, 2)
        d(u, v)/dq, lines mm.
    derivatives : list of (parameter, d(u, v)/dp, d(ray)/dp)
        For the parameters that have a variance.
    rays : array, shape (rows, columns, 3)
    """
    rays = ray_directions(*camera, uv)
    h = inverse_depths[0] * 1e-4
    slope = (
        _projected(projector, pose, rays, inverse_depths + h) - _projected(projector, pose, rays, inverse_depths - h)
    ) / (2 * h)
    derivatives = []
    for p in np.flatnonzero(np.diag(covariance) > 0):
        step = float(np.sqrt(covariance[p, p]))
        ends = []
        for sign in (1, -1):
            moved = _moved(camera, projector, pose, int(p), sign * step)
            ray = ray_directions(*moved[0], uv)
            ends.append((_projected(moved[1], moved[2], ray, inverse_depths), ray))
        (f1, d1), (f2, d2) = ends
        derivatives.append((int(p), (f1 - f2) / (2 * step), (d1 - d2) / (2 * step)))
    return slope, derivatives, rays


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


def _variance(
    slope: Array,
    derivatives: list[tuple[int, Array, Array]],
    rays: Array,
    inverse_depths: Array,
    covariance: Array,
    weights: tuple[float, float],
) -> Array:
    """Variance of X q², shape (rows, columns, depths, 3): q = argmin Σ w (observed - f(q, p))² moves with p."""
    if not derivatives:
        return np.zeros((*slope.shape[:3], 3))
    information = np.sum(weights * slope**2, axis=-1)
    columns = []
    with np.errstate(all="ignore"):
        for _, df, dray in derivatives:
            dq = -np.sum(weights * slope * df, axis=-1) / information
            columns.append(inverse_depths[:, None] * dray[:, :, None, :] - rays[:, :, None, :] * dq[..., None])
        G = np.stack(columns, axis=-1)
        index = [p for p, _, _ in derivatives]
        variance = np.einsum("...ki,ij,...kj->...k", G, covariance[np.ix_(index, index)], G, optimize=True)
    return _filled(variance)


def _filled(table: Array) -> Array:
    """Carry the nearest depth's value to nodes that no point can have (behind the projector)."""
    known = np.isfinite(table).all(axis=-1)
    if known.all() or not known.any():
        return np.nan_to_num(table, nan=np.nan, posinf=np.nan)
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(table[tuple(nearest)])
