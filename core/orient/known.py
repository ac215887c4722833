"""What is known of a scene: lengths between its features, or points; as observations of the rig's parameters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from core.errors import InputError
from core.evaluate import fit_sphere
from core.geometry import project_with_derivatives, similarity
from core.geometry.intersection import by_parameters
from core.lazy import dataclass
from core.model import Array, KnownLength, KnownPoints, Pair, PhaseMap
from core.orient.residuals import epipolar_residuals, pixels_within, single_places

FEWEST = 6  # pixels of a feature, and known points

# two features, each the places (n, 2) px from its middle and points (n, 3): their distance, and its change with each
# point of both (n, 3)
Distance = Callable[[Array, Array, Array, Array], tuple[float, Array, Array]]


@dataclass(frozen=True)
class Observed:
    """Observations of the parameters, each in its standard deviations: what remains, and its change (m, k)."""

    rest: Array
    A: Array
    name: str


def _points(at: Array, X: Array, other_at: Array, Y: Array) -> tuple[float, Array, Array]:
    """Of the surface at two places."""
    own, other = (np.linalg.pinv(np.column_stack([np.ones(len(p)), p]))[0] for p in (at, other_at))
    away = other @ Y - own @ X
    length = float(np.linalg.norm(away))
    return length, -own[:, None] * away / length, other[:, None] * away / length


def _balls(_at: Array, X: Array, _other_at: Array, Y: Array) -> tuple[float, Array, Array]:
    """Of the centres of two balls."""
    centres, influence = [], []
    for points in (X, Y):
        ball = fit_sphere(points)
        normals = (points - ball.centre_mm) / np.linalg.norm(points - ball.centre_mm, axis=1)[:, None]
        J = np.column_stack([normals, np.ones(len(points))])
        centres.append(ball.centre_mm)
        influence.append(np.linalg.pinv(J)[:3].T[:, :, None] * normals[:, None, :])
    away = centres[1] - centres[0]
    length = float(np.linalg.norm(away))
    own, other = (np.einsum("nij,i->nj", part, away / length) for part in influence)
    return length, -own, other


def _planes(_at: Array, X: Array, _other_at: Array, Y: Array) -> tuple[float, Array, Array]:
    """Of two parallel planes, such as the faces of a step."""
    middles = X.mean(axis=0), Y.mean(axis=0)
    centred = np.concatenate([X - middles[0], Y - middles[1]])
    axes = np.linalg.eigh(centred.T @ centred)[1]
    normal = axes[:, 0] * np.sign(axes[:, 0] @ (middles[1] - middles[0]))
    J = np.zeros((len(centred), 4))
    J[:, :2] = np.concatenate([X, Y]) @ axes[:, 1:]
    J[: len(X), 2], J[len(X) :, 3] = 1.0, 1.0
    fitted = np.linalg.pinv(J)
    by = (fitted[3] - fitted[2])[:, None] * normal
    return float(normal @ (middles[1] - middles[0])), by[: len(X)], by[len(X) :]


LENGTHS: dict[str, Distance] = {"points": _points, "balls": _balls, "planes": _planes}


def measured_length(known: KnownLength, phase: PhaseMap, pair: Pair) -> tuple[float, float, Array]:
    """Give a length as a pair of devices measures it, its sigma by noise, and its change with the parameters (k,).

    InputError if the features have too few pixels with both coordinates.
    """
    found = []
    for u, v, radius in known.ends:
        sight = pixels_within(phase, u, v, radius)
        if len(sight.uv) < FEWEST:
            seen = f"{len(sight.uv)} pixels have both projector coordinates within {radius:g} px of {u:g},{v:g}"
            raise InputError("--length", seen, "choose a place of the object that is well lit, or a larger radius")
        found.append((sight.pixels - (u, v), epipolar_residuals(sight, pair)))
    (at, one), (other_at, two) = found
    length, by_one, by_two = LENGTHS[known.kind](at, one.xyz_mm, other_at, two.xyz_mm)
    slope, variance = np.zeros(one.A.shape[1]), 0.0
    for by, seen_as in ((by_one, one), (by_two, two)):
        slope += np.einsum("ni,nik->k", by, seen_as.by_xyz)
        variance += float(np.sum((np.einsum("ni,ni->n", by, seen_as.xyz_mm) * seen_as.sigma_log) ** 2))
    return length, float(np.sqrt(variance)), slope


def observed_length(known: KnownLength, phase: PhaseMap, pair: Pair) -> Observed:
    """What a known length says of the parameters."""
    length, noise, slope = measured_length(known, phase, pair)
    sigma = np.hypot(known.sigma_mm, noise)
    name = f"the length of {known.length_mm:g} mm, measured as {length:.4g} mm,"
    return Observed(np.array([(known.length_mm - length) / sigma]), slope[None] / sigma, name)


def observed_points(known: KnownPoints, pair: Pair) -> Observed:
    """What points say whose coordinates are known in a frame of their own, wherever it stands."""
    if len(known.xyz_mm) < FEWEST:
        raise InputError("the known points", f"{len(known.xyz_mm)} are seen", f"show at least {FEWEST}")
    sight = single_places(known.seen[:, :2], known.seen[:, 2:], np.ones((len(known.xyz_mm), 2)))
    _, R, shift = similarity(known.xyz_mm, epipolar_residuals(sight, pair).xyz_mm, scaled=False)
    X = known.xyz_mm @ R.T + shift
    camera, projector = pair.camera, pair.projector
    one = project_with_derivatives(camera.spec, camera.interior, X)
    two = project_with_derivatives(projector.spec, projector.interior, X, pair.projector_from_camera)
    A, n = by_parameters(one, two), len(X)
    by_point = np.concatenate([one.by_point, two.by_point], axis=1)
    turns = np.swapaxes(np.cross(np.eye(3), X[:, None, :]), 1, 2)
    free = by_point @ np.concatenate([turns, np.broadcast_to(np.eye(3), (n, 3, 3))], axis=2)
    rest = known.seen - np.concatenate([one.uv, two.uv], axis=1)
    by_own = by_point @ R
    noise = known.seen_cov + by_own @ known.cov_mm2 @ np.swapaxes(by_own, 1, 2)
    whiten = np.linalg.inv(np.linalg.cholesky(noise))
    r, A, free = ((whiten @ a).reshape(4 * n, -1) for a in (rest[..., None], A, free))
    Q = np.linalg.qr(free)[0]  # where they stand is not known: what a movement of all would explain drops out
    return Observed((r - Q @ (Q.T @ r))[:, 0], A - Q @ (Q.T @ A), "one of the known points")


def lines_at(phase: PhaseMap, u: float, v: float, radius_px: float = 2.0) -> tuple[Array, Array]:
    """Projector coordinates (2,) at a place of the camera's image, and their sigmas; NaN where nothing is decoded."""
    near = pixels_within(phase, u, v, radius_px)
    if len(near.uv) < FEWEST:
        return np.full(2, np.nan), np.full(2, np.nan)
    share = np.linalg.pinv(np.column_stack([np.ones(len(near.uv)), near.pixels - (u, v)]))[0]
    return share @ near.uv, np.sqrt(share**2 @ near.sigma**2)
