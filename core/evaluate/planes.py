"""The orthogonal fit of a plane, and the judgement of one plane capture by one method."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import TooFewPointsError
from core.lazy import dataclass
from core.model import Array, Floats, Interior, Method, PhaseMap, PlaneEvaluation, PointCloud
from core.numerics import median_of, ranked, sigma_by_median

LEAST_POINTS = 4  # three points fit any plane
LOOK = "check the capture and calibration"
COLLINEAR = 1e-6  # ratio of the second to the first spread below which points lie on a line
OTHER, DISTANT = 10.0, 1e-3  # sigmas by the median, and share of the distance, beyond which lie other surfaces
REGION = 50  # px side by side beyond, at least: so many gross errors do not meet by chance
FORM = 0.1, 2.0  # share of a region that lies within so many times the limit, where the plane's own form leads there
AROUND, BESIDE = 15, 0.1  # px; where such regions are, single points with a tenth of those around beyond belong to them
TRIALS, SAMPLE = 200, 2000  # of the search for the plane of most points


@dataclass(frozen=True)
class Plane:
    """The plane ``normal · X = offset_mm``."""

    normal: Array  #: (3,): unit normal, towards the origin (the camera) for a plane the camera sees
    offset_mm: float

    def deviations(self, points: ArrayLike) -> Array:
        """Signed distances (mm) of points, shape (..., 3), positive on the camera's side."""
        return np.asarray(np.asarray(points, np.float64) @ self.normal - self.offset_mm)


def fit_plane(points: ArrayLike, *, where: str = "plane") -> Plane:
    """Fit a plane to points by least squares of the orthogonal distances.

    The points, (n, 3), are in mm, in the camera's frame, all finite. TooFewPointsError, which says `where` they
    belong, if there are fewer than 4, or they lie on a line.

    The normal is the eigenvector of the least eigenvalue of the points' scatter matrix, taken about their mean in
    double precision.

    Examples
    --------
    >>> plane = fit_plane([[0, 0, -600], [1, 0, -600], [0, 1, -600], [1, 1, -600]])
    >>> [float(v) for v in plane.normal], plane.offset_mm
    ([0.0, 0.0, 1.0], -600.0)
    """
    p = np.asarray(points, np.float64)
    if len(p) < LEAST_POINTS:
        raise TooFewPointsError(where, f"{len(p)} valid points, too few to fit a plane", LOOK)
    columns = p.T.copy()  # sums along them take a tenth of the time
    mean = columns.mean(axis=1)
    columns -= mean[:, None]
    spread, vectors = np.linalg.eigh(columns @ columns.T)
    if spread[1] <= COLLINEAR**2 * spread[2]:
        remedy = "check the capture: no plane follows from a line"
        raise TooFewPointsError(where, f"{len(p)} valid points on one line", remedy)
    normal = vectors[:, 0]
    offset = float(normal @ mean)
    if offset > 0 or (offset == 0 and normal[2] < 0):
        normal, offset = -normal, -offset
    return Plane(normal + 0.0, offset)


def evaluate_plane(
    phase: PhaseMap,
    cloud: PointCloud,
    *,
    capture: str,
    angle_deg: float | None,
    method: Method,
    camera: Interior | None = None,
    outside: str = "no intersection in front of the rig",
) -> PlaneEvaluation:
    """Fit a plane to all points of a capture and describe their deviations from it.

    Parameters
    ----------
    phase, cloud
        What the decoder called valid, and the points of the same pixels, (H, W).
    angle_deg : float or None
        The plane's nominal angle, for the report.
    camera : Interior, optional
        The camera they were reconstructed with, kept for profiles along the plane.
    outside : str
        Why a decoded pixel may have no point.

    Returns
    -------
    evaluation : PlaneEvaluation
        Every point takes part but those on other surfaces, which are counted: r.m.s. = sqrt(Σ d²/n), the largest
        ``|d|`` and the most negative d, where d is the signed distance along the normal, positive towards the camera.
        `deviation_mm` has shape (H, W), NaN without point; `sigma_mm` likewise, predicted, of shape (0, 0) where the
        phase noise is not known.

    Raises
    ------
    TooFewPointsError
        If there are fewer than 4 points, or they lie on a line.

    Notes
    -----
    The predicted sigmas and their r.m.s. come from the noise of pixels alone, the phase's and the depth curves': it
    moves a point along the pixel's ray, and ``X / Z`` is that movement per mm of Z, so d has the sigma
    ``sigma_Z |n · X / Z|``. Errors of the calibration move neighbouring points together; they tilt, shift and bend the
    whole plane and are part of each point's own sigma, not of these.
    """
    valid = cloud.valid
    points = cloud.xyz_mm.reshape(-1, 3).compress(valid.ravel(), axis=0).astype(np.float64)
    elsewhere = _elsewhere(points, valid, capture)
    if len(points) < LEAST_POINTS and (rule := _excluded(phase, valid, elsewhere, outside)[1]):
        seen = f"{len(points)} valid points, too few to fit a plane; of the others: {rule}"
        raise TooFewPointsError(capture, seen, LOOK)
    points = points.compress(~elsewhere[valid], axis=0)
    valid &= ~elsewhere
    plane = fit_plane(points, where=capture)
    deviation = plane.deviations(points)
    pictured = np.full(valid.shape, np.nan, np.float32)
    pictured[valid] = deviation
    sigma = _predicted_sigma(cloud, valid, points, plane)
    known = sigma[np.isfinite(sigma)].astype(np.float64)
    excluded, rule = _excluded(phase, valid, elsewhere, outside)
    return PlaneEvaluation(
        capture=capture,
        angle_deg=angle_deg,
        method=method,
        n=len(points),
        rms_mm=float(np.sqrt(np.mean(deviation**2))),
        max_mm=float(np.abs(deviation).max()),
        min_mm=float(deviation.min()),
        predicted_rms_mm=float(np.sqrt(np.mean(known**2))) if len(known) else None,
        excluded=excluded,
        excluded_rule=rule,
        elsewhere=int(np.count_nonzero(elsewhere)),
        plane=np.array([*plane.normal, plane.offset_mm]),
        deviation_mm=pictured,
        sigma_mm=sigma,
        camera=camera,
    )


def _predicted_sigma(cloud: PointCloud, valid: NDArray[np.bool_], points: Array, plane: Plane) -> Floats:
    if cloud.sigma_depth_mm is None:
        return np.zeros((0, 0), np.float32)
    sigma = np.full(valid.shape, np.nan, np.float32)
    sigma[valid] = np.abs(cloud.sigma_depth_mm[valid] * (points @ plane.normal) / points[:, 2])
    return sigma


def _elsewhere(points: Array, valid: NDArray[np.bool_], where: str) -> NDArray[np.bool_]:
    """Points on other surfaces than the plane of most: a wall behind the plate, what it stands on; (H, W)."""
    sample = points[:: len(points) // SAMPLE + 1]
    a, b, c = sample[np.random.default_rng(0).integers(max(len(sample), 1), size=(3, TRIALS if len(sample) else 0))]
    normals = np.cross(b - a, c - a)
    sound = np.any(normals != 0, axis=1)
    if not sound.any():
        return np.zeros(valid.shape, bool)
    normals = normals[sound] / np.linalg.norm(normals[sound], axis=1, keepdims=True)
    offsets = np.sum(normals * a[sound], axis=1)
    off = np.abs(normals @ sample.T - offsets[:, None])
    best = int(np.argmin(ranked(off, 0.5)))
    limit = max(OTHER * median_of(off[best]), DISTANT * abs(float(offsets[best])))
    plane = fit_plane(sample[off[best] <= limit], where=where)
    deviation = plane.deviations(points)
    beyond = np.zeros(valid.shape, np.float32)  # in limits
    beyond[valid] = np.abs(deviation) / max(OTHER * sigma_by_median(deviation), -DISTANT * plane.offset_mm)
    far = (beyond > 1).astype(np.uint8)
    if np.count_nonzero(far) < REGION:
        return np.zeros(valid.shape, bool)
    _, region, figures, _ = cv2.connectedComponentsWithStats(far)
    area = figures[:, cv2.CC_STAT_AREA]
    near = np.bincount(region[beyond <= FORM[1]], minlength=len(area))
    large = (area >= REGION) & (near <= FORM[0] * area)
    large[0] = False  # what is not beyond
    size = (AROUND, AROUND)
    amid = cv2.blur(far.astype(np.float32), size) > BESIDE * cv2.blur(valid.astype(np.float32), size)
    return np.asarray(large[region] | (amid & (far > 0) & large.any()))


def _excluded(phase: PhaseMap, valid: NDArray[np.bool_], elsewhere: NDArray[np.bool_], outside: str) -> tuple[int, str]:
    """Count the pixels that have a projector coordinate but take no part, and say by which rule."""
    u, v = np.isfinite(phase.u), np.isfinite(phase.v)
    without = (u | v) & ~valid & ~elsewhere
    # all points have what gives the depth; from several projectors some have either, and none of these both
    leads = [axis for axis in (u, v) if not bool((valid & ~axis).any())] or [u & v]
    blind = max((int(np.count_nonzero(without & ~lead)) for lead in leads), default=0)
    rest = int(np.count_nonzero(without)) - blind
    other = int(np.count_nonzero(elsewhere))
    rules = [
        (other, "on another surface"),
        (rest, outside),
        (blind, "the projector coordinate that gives the depth was not decoded"),
    ]
    told = "; ".join(f"{n} {why}" if blind or other else why for n, why in rules if n)
    return rest + blind + other, told


def share_within(evaluation: PlaneEvaluation, times: float) -> float:
    """Give the share of pixels whose deviation is at most so many times the r.m.s. of all."""
    values = evaluation.deviation_mm[np.isfinite(evaluation.deviation_mm)]
    return float(np.mean(np.abs(values) <= times * evaluation.rms_mm)) if len(values) else float("nan")


def heights(xyz_mm: NDArray) -> NDArray[np.float32]:
    """Measure points, shape (H, W, 3), from the plane that fits them best: (H, W) mm, positive towards the camera."""
    valid = np.isfinite(xyz_mm).all(axis=-1)
    found = np.full(valid.shape, np.nan, np.float32)
    if np.count_nonzero(valid) >= 4:
        found[valid] = fit_plane(xyz_mm[valid]).deviations(xyz_mm[valid])
    return found
