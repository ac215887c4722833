"""The test of the calibrated orientation, and the corrected one with its covariance."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.geometry import Pose, cross_matrix, matrix_from_rotation_vector, pair_for, perturbed, ray_directions
from core.model import AdjustedDevice, Array, Pair, PhaseMap, PhotogrammetricCalibration, RigMotion
from core.numerics import sigma_by_median
from core.orient.residuals import Residuals, Sight, epipolar_residuals
from core.progress import SILENT, Progress

HUBER = 2.0  # standard deviations beyond which a residual counts less
GROSS = 25.0  # and beyond which it is no measurement: a wrong word, or two surfaces in one pixel
TILES = 400  # lie on the object: residuals of one may hang together
FEWEST_TILES, FEWEST_PIXELS = 30, 500
FOOTPRINT_PX2 = 0.2  # about what lenses and pixels have
FREE = 1e-6
SOME = 1500  # pixels by which the calibration's own uncertainty is carried over


@dataclass(frozen=True)
class OrientOptions:
    """How the rig is watched.

    Attributes
    ----------
    significance : float
        Share of captures of an unmoved rig that may be called moved.
    rotation_prior_rad, shift_prior_mm : float
        Standard deviation of what rigs drift by, as observations of zero.
    most_pixels : int
        Pixels beyond these are thinned out evenly.
    rounds : int
        Of the linearised estimate.
    """

    significance: float = 1e-3
    rotation_prior_rad: float = 2e-3
    shift_prior_mm: float = 0.5
    most_pixels: int = 400_000
    rounds: int = 3


DEFAULT = OrientOptions()


def find_motion(
    phase: PhaseMap,
    calibration: PhotogrammetricCalibration | Pair,
    *,
    capture: str = "capture",
    options: OrientOptions = DEFAULT,
    progress: Progress = SILENT,
) -> RigMotion:
    """Say whether the projector still stands where the calibration put it, and where it stands now.

    Parameters
    ----------
    phase : PhaseMap
        Of any object, with columns and rows.
    calibration : PhotogrammetricCalibration or Pair
    capture : str
        Name, for the result and for messages.
    options : OrientOptions
    progress : Progress

    Returns
    -------
    motion : RigMotion

    Raises
    ------
    InputError
        If too few pixels have both coordinates.

    Notes
    -----
    The estimate is by Huber's weights, with drifts of the given size as observations; the pixels' footprint, which
    draws coordinates to the brighter side, is estimated with it. Its covariance has two parts: the noise, from the
    scatter of the scores of image tiles, so that noise may hang together within a tile (the sandwich form of White,
    doi:10.2307/1912934), and what the calibration's errors do. The test is Wald's, of no movement, on the estimate
    without the drifts.
    """
    pair = pair_for(phase, calibration)
    sight = _sight(phase, pair.camera, capture, options.most_pixels)
    pose, projector = pair.projector_from_camera, pair.projector
    sight, start = _checked(sight, epipolar_residuals(sight, projector, pose), capture)
    tiles = np.unique(sight.at, return_inverse=True)[1]
    basis = _basis(pose)
    prior = np.diag([options.rotation_prior_rad**-2.0] * 3 + [options.shift_prior_mm**-2.0] * 2 + [FOOTPRINT_PX2**-2.0])
    x, now = np.zeros(6), start
    for i in range(options.rounds):
        progress(0.2 + 0.6 * i / options.rounds, "turning the projector")
        progress.check()
        x = x + _step(now.e - x[5] * now.pulled, _columns(now, basis), prior, x)
        now = epipolar_residuals(sight, projector, _moved(pose, basis @ x[:5]))
    A, e = _columns(now, basis), now.e - x[5] * now.pulled
    weight = _weights(e)
    information, scatter = (A * weight[:, None]).T @ A, _scatter(A * (weight * e)[:, None], tiles)
    lax = prior * FREE  # next to nothing: a prior would make slight movements slighter
    lax[5, 5] = prior[5, 5]
    G = _carried(sight, pair, A, weight, lax)
    C = pair.covariance
    free = np.linalg.inv(information + lax)
    shown = x + free @ (A.T @ (weight * e) - lax @ x)
    p = _significance(shown[:5], (free @ (scatter + lax) @ free + G @ C @ G.T)[:5, :5], int(tiles.max()) + 1)
    inverse = np.linalg.inv(information + prior)
    noise = basis @ (inverse @ (scatter + prior) @ inverse)[:5, :5] @ basis.T
    by_calibration = basis @ G[:5]
    motion_cov = noise + by_calibration @ C @ by_calibration.T
    rotation, shift = np.split(basis @ x[:5], 2)
    return RigMotion(
        capture=capture,
        moved=bool(p < options.significance),
        p=p,
        rotation_rad=rotation,
        shift_mm=shift,
        covariance=motion_cov,
        noise=noise,
        by_calibration=by_calibration,
        depth_change_mm=float(np.median(1 / start.q - 1 / now.q)),
        depth_sigma_mm=_depth_sigma(sight, projector, _moved(pose, basis @ x[:5]), motion_cov),
        pixels=len(sight.at),
        residual_rms=sigma_by_median(start.e),
        corrected_rms=sigma_by_median(e),
        projector_from_camera=_moved(pose, basis @ x[:5]),
        camera=phase.camera,
        projector=phase.projector,
    )


def corrected_pair(pair: Pair, motion: RigMotion) -> Pair:
    """Give camera and projector with the projector where a capture found it, and the covariance that follows.

    What the residuals show of the orientation is known anew; it hangs together with the errors of the interior
    orientations that it was found with. What they do not show, the length of the base, stays as it was.
    """
    pose = pair.projector_from_camera
    # from the motion in the camera's frame to left perturbations of projector_from_camera: R' = R exp(-w), so the
    # rotation is -R w; t' = -R' (p + s) changes by R (w x p) - R s
    R, K = pose.rotation, cross_matrix(pose.origin_mm)
    J = np.block([[-R, np.zeros((3, 3))], [-R @ K, -R]])
    whole = np.eye(len(pair.covariance))
    whole[-6:] += J @ motion.by_calibration
    covariance = whole @ pair.covariance @ whole.T
    covariance[-6:, -6:] += J @ motion.noise @ J.T
    return replace(pair, projector_from_camera=motion.projector_from_camera, covariance=covariance)


def _sight(phase: PhaseMap, camera: AdjustedDevice, capture: str, most: int) -> Sight:
    """Take the pixels that have both coordinates, thinned out evenly to `most` at the most."""
    valid = np.isfinite(phase.u) & np.isfinite(phase.v) & np.isfinite(phase.sigma_u) & np.isfinite(phase.sigma_v)
    count = int(np.count_nonzero(valid))
    if count == 0:
        seen = "no pixel has both projector coordinates"
        raise InputError(capture, seen, "capture columns and rows: with one axis nothing tells whether the rig moved")
    step = int(np.ceil(np.sqrt(count / most)))
    rows, columns = np.nonzero(valid[::step, ::step])
    rows, columns = rows * step, columns * step
    size = max(np.sqrt(count / TILES), 1.0)
    at = (rows / size).astype(np.int64) * valid.shape[1] + (columns / size).astype(np.int64)
    pixels = np.stack([columns, rows], axis=1).astype(np.float64)
    uv = np.stack([phase.u[rows, columns], phase.v[rows, columns]], axis=1).astype(np.float64)
    sigma = np.stack([phase.sigma_u[rows, columns], phase.sigma_v[rows, columns]], axis=1).astype(np.float64)
    return Sight(
        at, pixels, ray_directions(camera.spec, camera.interior, pixels), uv, sigma, _pull(phase, rows, columns)
    )


def _pull(phase: PhaseMap, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Array:
    """How a change of reflectance draws the coordinates, (n, 2) lines a px²: ``grad(u) . grad(image) / image``."""
    with np.errstate(invalid="ignore", divide="ignore"):
        brightness = [g / phase.image for g in np.gradient(phase.image)]
        pull = [sum(g * b for g, b in zip(np.gradient(place), brightness, strict=True)) for place in (phase.u, phase.v)]
    return np.nan_to_num(np.stack([p[rows, columns] for p in pull], axis=1).astype(np.float64), posinf=0, neginf=0)


def _checked(sight: Sight, found: Residuals, capture: str) -> tuple[Sight, Residuals]:
    """Leave out what is no measurement, and see that enough is left."""
    with np.errstate(invalid="ignore"):
        kept = np.abs(found.e - np.nanmedian(found.e)) < GROSS * max(float(np.nanstd(found.e)) / 5, 1.0)
        kept &= found.q > 0
    if kept.sum() < FEWEST_PIXELS or len(np.unique(sight.at[kept])) < FEWEST_TILES:
        raise InputError(
            capture,
            f"{int(kept.sum())} pixels have both projector coordinates",
            "capture an object that fills more of the field, with columns and rows",
        )
    return sight.only(kept), Residuals(*(getattr(found, f.name)[kept] for f in fields(Residuals)))


def _basis(pose: Pose) -> Array:
    """What is observed of rotation and shift, shape (6, 5): all rotations, and shifts across the base."""
    base = pose.origin_mm / np.linalg.norm(pose.origin_mm)
    across = np.linalg.svd(base[None])[2][1:].T
    basis = np.zeros((6, 5))
    basis[:3, :3], basis[3:, 3:] = np.eye(3), across
    return basis


def _depth_sigma(sight: Sight, projector: AdjustedDevice, pose: Pose, covariance: Array) -> float:
    """Standard deviation of the median depth that the uncertain movement leaves, in mm."""
    few = sight.only(slice(None, None, max(1, len(sight.at) // SOME)))
    ends = []
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-5 if k < 3 else 1e-2
        q = [epipolar_residuals(few, projector, _moved(pose, sign * step)).q for sign in (1, -1)]
        ends.append(float(np.median(1 / q[0] - 1 / q[1])) / (2 * step[k]))
    return float(np.sqrt(np.array(ends) @ covariance @ np.array(ends)))


def _columns(now: Residuals, basis: Array) -> Array:
    """What the residuals change with: the five elements, and the footprint of the pixels."""
    return np.column_stack([now.A @ basis, now.pulled])


def _moved(pose: Pose, motion: Array) -> Pose:
    """Turn and shift the projector, in the camera's frame."""
    R = pose.rotation @ matrix_from_rotation_vector(motion[:3]).T
    return Pose(R, -R @ (pose.origin_mm + motion[3:]))


def _weights(e: Array) -> Array:
    return np.minimum(1.0, HUBER * max(sigma_by_median(e), 1.0) / np.maximum(np.abs(e), 1e-12))


def _step(e: Array, A: Array, prior: Array, x: Array) -> Array:
    """One linear estimate by Huber's weights, iterated to rest."""
    step: Array = np.zeros(A.shape[1])
    for _ in range(8):
        weighted = A * _weights(e - A @ step)[:, None]
        new = np.asarray(np.linalg.solve(weighted.T @ A + prior, weighted.T @ e - prior @ x), np.float64)
        done = np.abs(new - step).max() < 1e-9
        step = new
        if done:
            break
    return step


def _scatter(scores: Array, tiles: NDArray[np.int64]) -> Array:
    """Covariance of the sum of scores (n, 5), from the sums of the tiles."""
    sums = np.stack([np.bincount(tiles, column) for column in scores.T], axis=1)
    count = len(sums)
    return np.asarray(sums.T @ sums * count / max(count - scores.shape[1], 1))


def _carried(sight: Sight, pair: Pair, A: Array, weight: Array, lax: Array) -> Array:
    """What errors of the calibration's parameters are taken for, shape (6, k): the movement that explains them best."""
    sigma = np.sqrt(np.diagonal(pair.covariance))
    every = slice(None, None, max(1, len(sight.at) // SOME))
    few, by_parameters = sight.only(every), np.zeros((len(A[every]), len(sigma)))
    for k in np.flatnonzero(sigma > 0):
        ends, change = [], np.zeros(len(sigma))
        change[k] = sigma[k]
        for moved in (perturbed(pair, change), perturbed(pair, -change)):
            rays = ray_directions(moved.camera.spec, moved.camera.interior, few.pixels)
            seen = replace(few, rays=rays)
            ends.append(epipolar_residuals(seen, moved.projector, moved.projector_from_camera).e)
        by_parameters[:, k] = (ends[0] - ends[1]) / (2 * sigma[k])
    weighted = A[every] * weight[every, None]
    part = len(A[every]) / len(A)
    return np.asarray(np.linalg.solve(weighted.T @ A[every] + part * lax, weighted.T @ by_parameters))


def _significance(x: Array, covariance: Array, tiles: int) -> float:
    """Probability of an estimate this far from zero by chance: Hotelling's test, with the scatter of so many tiles."""
    from scipy.special import fdtrc

    t2 = float(x @ np.linalg.solve(covariance, x))
    rank, freedom = len(x), tiles - len(x)
    return float(fdtrc(rank, freedom - rank + 1, t2 * (freedom - rank + 1) / (freedom * rank)))
