"""Spatial resection of single stations: where a device stood, from points it saw."""

from __future__ import annotations

import cv2
import numpy as np

from core.geometry import Pose
from core.model import Array

NARROW = 0.1  # of the principal distance: the size of a view whose rays are nearly parallel
FLAT = 0.05  # a field whose depth is a smaller share of its width is seen like a plane, with its second solution
OUTLYING = 8.0  # median residuals of a view that none of its points exceeds unless one is wrong
MISFIT = 0.15  # median residual, as a share of the view's own size, above which a pose explains nothing
DRAWS = 40  # of five points: with three in ten wrong, 999 times in 1000 one draw at least has none of them
DRAWN = 5
_CV_FROM_DEVICE = np.diag([1.0, -1.0, -1.0])  # OpenCV's camera looks along +Z with Y down


def resect(points: Array, tangents: Array) -> list[Pose]:
    """All ``device_from_object`` that explain a view, those behind the device left out: a few.

    At least 4 points, (n, 3) mm in the object frame; their tangents (n, 2) are ``-X/Z`` and ``-Y/Z`` in the device
    frame. A flat field seen with little perspective fits two poses almost equally (Collins, Bartoli, *Infinitesimal
    plane-based pose estimation*, IJCV 109, 2014); the general solution is that of Terzakis, Lourakis, *A consistently
    fast and globally optimal solution to the perspective-n-point problem*, ECCV 2020.
    """
    centre = points.mean(axis=0)
    local = points - centre
    axes = np.linalg.eigh(local.T @ local)[1][:, ::-1].T
    axes[2] *= np.sign(np.linalg.det(axes))  # right-handed
    along = local @ axes.T
    extent = along.max(axis=0) - along.min(axis=0)
    image = np.ascontiguousarray(tangents * [1.0, -1.0])
    poses = []
    if extent[2] < FLAT * extent[1] and extent[1] > 0:
        flat = local - np.outer(along[:, 2], axes[2])
        poses += _pnp(flat, image, cv2.SOLVEPNP_IPPE)
    if extent[2] > 1e-6 * extent[0] or not poses:
        poses += _pnp(local, image, cv2.SOLVEPNP_SQPNP)
    if np.ptp(tangents, axis=0).max() < NARROW:  # of which the general solution finds none
        flattened = extent[2] < FLAT * extent[1]
        poses += [Pose(R @ axes, t) for R, t in _from_afar(along[:, : 2 if flattened else 3], tangents)]
    if len(points) == 4 and extent[2] >= FLAT * extent[1]:  # of so few the general solution misses one in fifty
        poses += _pnp(local, image, cv2.SOLVEPNP_AP3P)
    shifted = [Pose(p.rotation, p.translation_mm - p.rotation @ centre) for p in poses]
    return [p for p in shifted if (p.apply(points)[:, 2] < 0).all()]


def _from_afar(points: Array, tangents: Array) -> list[tuple[Array, Array]]:
    """Rotations and shifts by which parallel rays explain a view: one of points (n, 3), two of those of a plane (n, 2).

    ``tangents = M points + m`` with two rows of a rotation over the distance in M (Huttenlocher, Ullman, *Recognizing
    solid objects by alignment with an image*, IJCV 5, 1990).
    """
    affine = np.linalg.lstsq(np.column_stack([points, np.ones(len(points))]), tangents, rcond=None)[0].T
    M, m = affine[:, :-1], affine[:, -1]
    if M.shape[1] == 3:
        U, sizes, Vt = np.linalg.svd(M, full_matrices=False)
        scale = float(sizes.mean())
        turns = [np.vstack([U @ Vt, np.cross(*(U @ Vt))])]
    else:
        (a, b), (_, d) = M.T @ M
        scale = float(np.sqrt((a + d + np.hypot(a - d, 2 * b)) / 2))
        depth = np.sqrt(np.maximum(scale**2 - np.array([a, d]), 0.0)) * [1.0, -1.0 if b > 0 else 1.0]
        columns = [np.vstack([M, sign * depth]).T / max(scale, 1e-300) for sign in (1.0, -1.0)]
        turns = [np.column_stack([*pair, np.cross(*pair)]) for pair in columns]
    if not scale > 0:
        return []
    return [(R, np.array([*m, -1.0]) / scale) for R in turns]


def resect_despite_errors(points: Array, tangents: Array) -> list[Pose]:
    """As `resect`, from the points that agree where some are wrong.

    Of the poses of random draws, that of the least median residual tells which points agree (Rousseeuw, *Least median
    of squares regression*, JASA 79, 1984).
    """
    poses = resect(points, tangents)
    size = float(np.mean(np.linalg.norm(tangents - np.median(tangents, axis=0), axis=1)))
    left = [residuals_of(p, points, tangents) for p in poses]
    if any(r.max() < OUTLYING * np.median(r) and np.median(r) < MISFIT * size for r in left) or len(points) <= DRAWN:
        return poses
    rng, best = np.random.default_rng(0), np.full(len(points), MISFIT * size)
    for _ in range(DRAWS):
        draw = rng.choice(len(points), DRAWN, replace=False)
        for pose in resect(points[draw], tangents[draw]):
            residuals = residuals_of(pose, points, tangents)
            if np.median(residuals) < np.median(best):
                best = residuals
    agree = best < OUTLYING * np.median(best)
    return poses if agree.all() else resect(points[agree], tangents[agree]) or poses


def residuals_of(pose: Pose, points: Array, tangents: Array) -> Array:
    """Distances in the image over the principal distance, shape (n,); infinite behind the device."""
    X, Y, Z = pose.apply(points).T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(Z < 0, np.hypot(-X / Z - tangents[:, 0], -Y / Z - tangents[:, 1]), np.inf)


def _pnp(points: Array, image: Array, method: int) -> list[Pose]:
    try:
        solutions = cv2.solvePnPGeneric(np.ascontiguousarray(points), image, np.eye(3), None, flags=method)
    except cv2.error:  # it asserts on degenerate points
        return []
    poses = []
    for rotation, shift in zip(solutions[1], solutions[2], strict=True):
        R, t = cv2.Rodrigues(rotation)[0], np.asarray(shift, dtype=np.float64).ravel()
        if np.all(np.isfinite(R)) and np.all(np.isfinite(t)):
            poses.append(Pose(_CV_FROM_DEVICE @ R, _CV_FROM_DEVICE @ t))
    return poses
