"""Any observations of a camera and a projector, not of a raster: points and their covariances."""

from __future__ import annotations

import numpy as np

from core.geometry.device import Projection, pixel_to_image, project_with_derivatives, ray_directions
from core.geometry.lens import undistort
from core.model import Array, Pair

LEAST_SIGMA = 1e-4  # px or lines: one told smaller counts as this
AT_ONCE = 1 << 16  # points intersected together


def intersect_observations(pair: Pair, observed: Array, sigma: Array, S: Array | None) -> tuple[Array, Array]:
    """Points (n, 3) mm in the camera's frame and their covariances (n, 3, 3), of observations (n, 4): px, lines.

    One line coordinate of two may be NaN. `S` is the covariance of the pair's parameters, which that of the points then
    holds. NaN where nothing intersects in front of both.
    """
    xyz, covariance = np.empty((len(observed), 3)), np.empty((len(observed), 3, 3))
    for start in range(0, len(observed), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        xyz[part], covariance[part] = _intersected(pair, observed[part], sigma[part], S)
    return xyz, covariance


def _intersected(calibration: Pair, observed: Array, sigma: Array, S: Array | None) -> tuple[Array, Array]:
    """Points (n, 3) and covariances (n, 3, 3) of observations (n, 4)."""
    camera, projector, pose = calibration.camera, calibration.projector, calibration.projector_from_camera
    known = np.isfinite(observed)
    weight = np.where(known, 1 / np.maximum(sigma, LEAST_SIGMA) ** 2, 0.0)
    weight[~(known[:, 0] & known[:, 1] & (known[:, 2] | known[:, 3]))] = np.nan
    X = _approximate(calibration, observed)
    with np.errstate(all="ignore"):
        for _ in range(12):
            one = project_with_derivatives(camera.spec, camera.interior, X)
            two = project_with_derivatives(projector.spec, projector.interior, X, pose)
            A = np.concatenate([one.by_point, two.by_point], axis=1)
            rest = np.where(known, observed - np.concatenate([one.uv, two.uv], axis=1), 0.0)
            AtP = np.swapaxes(A, 1, 2) * weight[:, None, :]
            inverse = _inverted(AtP @ A)
            step = (inverse @ (AtP @ rest[..., None]))[..., 0]
            X = X + step
            if not np.any(np.abs(step).max(axis=1) > 1e-9 * np.abs(X[:, 2])):
                break
    covariance = inverse
    if S is not None:
        G = inverse @ AtP @ by_parameters(one, two)
        covariance = covariance + G @ S @ np.swapaxes(G, 1, 2)
    lost = ~np.isfinite(X).all(axis=1)
    X[lost], covariance[lost] = np.nan, np.nan
    return X, covariance


def by_parameters(one: Projection, two: Projection) -> Array:
    """Derivatives (n, 4, p) of what a pair sees by its parameters, in the order of their covariance."""
    i, j = one.by_interior.shape[2], two.by_interior.shape[2]
    B = np.zeros((len(one.uv), 4, i + j + 6))
    B[:, :2, :i], B[:, 2:, i : i + j], B[:, 2:, i + j :] = one.by_interior, two.by_interior, two.by_pose
    return B


def _inverted(N: Array) -> Array:
    """Inverses of symmetric matrices (n, 3, 3); NaN where there is none."""
    good = np.isfinite(N).all(axis=(1, 2)) & (np.abs(np.linalg.det(np.nan_to_num(N, posinf=0, neginf=0))) > 0)
    inverse = np.full_like(N, np.nan)
    inverse[good] = np.linalg.inv(N[good])
    return inverse


def _approximate(calibration: Pair, observed: Array) -> Array:
    """Points (n, 3) on the cameras' rays, from the projector without its distortion."""
    camera, projector, pose = calibration.camera, calibration.projector, calibration.projector_from_camera
    direction = ray_directions(camera.spec, camera.interior, observed[:, :2])
    middle = (np.array([projector.spec.width, projector.spec.height]) - 1) / 2
    filled = np.where(np.isfinite(observed[:, 2:]), observed[:, 2:], middle)
    xy = undistort(projector.interior, pixel_to_image(projector.spec, filled))
    R, t, c = pose.rotation, pose.translation_mm, projector.interior.c_mm
    turned = direction @ R.T
    # c (turned_x s + t_x) + x (turned_z s + t_z) = 0, and the same for y
    a = c * turned[:, :2] + xy * turned[:, 2:]
    b = -(c * t[:2] + xy * t[2])
    use = np.isfinite(observed[:, 2:])
    with np.errstate(all="ignore"):
        s = np.sum(np.where(use, a * b, 0), axis=1) / np.sum(np.where(use, a * a, 0), axis=1)
    return direction * np.where(s > 0, s, np.nan)[:, None]
