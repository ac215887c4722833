"""Captures of one object from several stations: how the rig stood in each, from targets and from the surface.

Where two captures see the same place, its point from the one, taken into the frame of the other, lies on the other's
surface: one observation, in the direction across it. A target seen by both gives three. All captures are adjusted
together. With r the residuals, A and B their changes with the poses and with the calibration, W the weights by noise,

    x = -(AᵀWA)⁻¹ AᵀW r,    dx = -(AᵀWA)⁻¹ AᵀW B dc

so that the errors dc of the calibration, which all captures share, are carried beside the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import combinations
from typing import Literal

import numpy as np

from core.errors import InputError
from core.geometry import Pose, cross_matrix, pair_derivatives, pair_for, project, rotation_vector_from_matrix
from core.lazy import dataclass
from core.model import Array, Overlap, Pair, PhaseMap, PhotogrammetricCalibration, PointCloud, Registration, TargetSet
from core.numerics import chi_square_limit, sigma_by_median
from core.orient.residuals import Residuals, epipolar_residuals, single_places
from core.orient.surface import Surface
from core.progress import SILENT, Progress

By = Literal["both", "targets", "surface"]
Targets = dict[tuple[int, int], tuple[Array, Array, Array]]

MOST_PLACES = 6000  # of a surface
ROUNDS = 60
SETTLED = 0.01  # of a standard deviation
HUBER, GROSS = 2.0, 5.0  # sigmas, the residuals' own scatter among them
FACING = 0.5  # cosine between normals of what may be one surface
TILES = 8  # a side of the image; what remains within one may hang together
STEP = 0.01  # px or lines, for a derivative
CONTRADICTION, CHANCE = 1.6, 1e-3  # times as far as sigmas allow by chance: surfaces are known to a half
SLIDES = 0.25  # share of what seems to hold two surfaces that may be due to their noise


@dataclass(frozen=True)
class View:
    """One capture: what one camera and one projector measured of it."""

    phase: PhaseMap
    cloud: PointCloud
    targets: TargetSet | None = None
    name: str = ""


@dataclass(frozen=True)
class _Rows:
    """Observations between two views: residuals (n,) in mm, by both poses (n, 6), by the calibration (n, k)."""

    views: tuple[int, int]
    r: Array
    by_first: Array
    by_second: Array
    by_pair: Array
    variance: Array
    tile: Array  # (n,), -1 for targets
    astray: Array  # (n, 12), by how much the changes by both poses differ from what the other view's normals make them

    @property
    def of_targets(self) -> bool:
        """Whether these are of targets, not of the surface."""
        return bool(np.any(self.tile < 0))

    def only(self, chosen: Array) -> _Rows:
        arrays = ("r", "by_first", "by_second", "by_pair", "variance", "tile", "astray")
        return replace(self, **{name: getattr(self, name)[chosen] for name in arrays})


class _Seen:
    """A view with what of it is worked out once."""

    def __init__(self, view: View, pair: Pair) -> None:
        self.view, self.pair = view, pair
        self.surface = Surface(view.cloud, pair.camera)

    @cached_property
    def places(self) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Places (n, 2) spread over the image, their points, change with the calibration, noise, normals and tiles."""
        height, width = self.view.cloud.xyz_mm.shape[:2]
        step = max(2 * self.surface.half + 1, int(np.sqrt(height * width / MOST_PLACES)))
        v, u = np.mgrid[step // 2 : height : step, step // 2 : width : step].reshape(2, -1)
        at = np.stack([u, v], axis=1).astype(np.float64)
        patches = self.surface.at(at)
        good = np.isfinite(patches.q)
        at, patches = at[good], type(patches)(*(getattr(patches, f)[good] for f in patches.__dataclass_fields__))
        X = self.surface.points(at, patches)
        _, normal = self.surface.gradient(patches, X)
        tile = (at // (np.array([width, height]) / TILES)).astype(int) @ (1, TILES)
        noise = X * (np.sqrt(patches.variance) / patches.q)[:, None]  # one standard deviation along the ray
        return at, X, self.by_pair(at, X), noise, normal / np.linalg.norm(normal, axis=1)[:, None], tile

    def by_pair(self, at: Array, X: Array) -> Array:
        """How points X (n, 3) of the surface at places (n, 2) change with the pair's parameters, (n, 3, k)."""
        projector = self.pair.projector
        uv = project(projector.spec, projector.interior, X, self.pair.projector_from_camera)
        row, column = np.rint(at[:, ::-1]).astype(int).T
        sigma = np.stack([self.view.phase.sigma_u[row, column], self.view.phase.sigma_v[row, column]], axis=1)
        sigma = np.where(np.isfinite(sigma), sigma, 1e6).astype(np.float64)  # an axis that was not decoded
        return epipolar_residuals(single_places(at, uv, sigma), self.pair).by_xyz

    @cached_property
    def targets(self) -> Targets:
        """What `target_points` gives."""
        return target_points(self.view, self.pair)


def target_points(view: View, pair: Pair) -> Targets:
    """Points, covariances by noise (3, 3) and changes with the pair's parameters (3, k) of targets, by their names."""
    t = view.targets
    if t is None or not len(t.row):
        return {}
    use = np.isfinite(t.projector_uv).all(axis=1) & np.isfinite(t.camera_uv).all(axis=1)
    seen = np.concatenate([t.camera_uv, t.projector_uv], axis=1)[use]

    def residuals(seen: Array) -> Residuals:
        return epipolar_residuals(single_places(seen[:, :2], seen[:, 2:], t.projector_sigma[use]), pair)

    here, steps = residuals(seen), STEP * np.eye(4)
    J = np.stack([residuals(seen + s).xyz_mm - residuals(seen - s).xyz_mm for s in steps], axis=2) / (2 * STEP)
    noise = J @ t.cov[use] @ np.swapaxes(J, 1, 2)
    names = zip(t.row[use].tolist(), t.col[use].tolist(), strict=True)
    return {name: (here.xyz_mm[i], noise[i], here.by_xyz[i]) for i, name in enumerate(names)}


def register(
    views: Sequence[View],
    calibration: PhotogrammetricCalibration,
    starts: Sequence[Pose],
    *,
    by: By = "both",
    progress: Progress = SILENT,
) -> Registration:
    """Adjust the poses of all views, by the same camera and projector, but the first.

    Parameters
    ----------
    starts : sequence of Pose
        Approximate ``view_from_first``, the first one's among them.
    by : {"both", "targets", "surface"}
        What ties the views.

    Raises
    ------
    InputError
        If a view is tied to no other, or by a surface along which it could slide.
    """
    pair = pair_for(views[0].phase, calibration)
    seen, poses = [_Seen(view, pair) for view in views], list(starts)
    size = 6 * (len(views) - 1)
    x = sigma = np.ones(size)
    for i in range(ROUNDS):
        progress(i / ROUNDS, "registering views")
        progress.check()
        rows = _observed(seen, poses, by)
        A, r, weight = _system(rows, len(views))
        _refuse_untied(rows, views)
        _refuse_sliding(rows, A, weight, views, np.inf)  # far from where they belong, normals differ without noise
        cofactor = np.linalg.inv(A.T @ (A * weight[:, None]))
        x, sigma = -cofactor @ (A.T @ (weight * r)), np.sqrt(np.diagonal(cofactor))
        poses[1:] = [pose.changed(step) for pose, step in zip(poses[1:], x.reshape(-1, 6), strict=True)]
        if np.all(np.abs(x) < SETTLED * sigma):
            break
    _refuse_sliding(rows, A, weight, views, SLIDES)
    if np.any(np.abs(x) > sigma):
        told = ", ".join(view.name for view in views)
        raise InputError(told, "do not settle on one another", "give targets that both see, or views less apart")
    B = np.concatenate([each.by_pair for each in rows])
    by_pair = -cofactor @ (A.T @ (weight[:, None] * B))
    rest = _rest(rows, A, B, weight, pair.covariance)
    factors = np.concatenate([np.full(len(z), 1.0 if each.of_targets else _together(z, each.tile)) for each, z in rest])
    covariance = cofactor @ (A.T @ (A * (weight * factors)[:, None])) @ cofactor
    L = pair_derivatives(calibration, *_names(views[0].phase, calibration))
    overlaps = tuple(_overlap(views, each, z) for each, z in rest)
    return Registration(tuple(v.name for v in views), tuple(poses), covariance, by_pair @ L, overlaps)


def apart(
    views: Sequence[View], calibration: PhotogrammetricCalibration, registered: Registration
) -> dict[str, tuple[float, float]]:
    """Which views stand elsewhere by their targets than by their surface; by how much at the object, and sigma, mm.

    None where one of the two does not tell how they stand. They were `registered` by targets alone, or by both.
    """
    one, poses, found = registered, registered.poses, {}
    try:
        if any(each.kind != "targets" for each in registered.overlaps):
            one = register(views, calibration, poses, by="targets")
        two = register(views, calibration, poses, by="surface")
    except InputError:
        return {}
    J = one.by_calibration - two.by_calibration
    whole = one.covariance + two.covariance + J @ calibration.covariance @ J.T
    middle = views[0].cloud.xyz_mm[views[0].cloud.valid].mean(axis=0, dtype=float)
    for k, (name, a, b) in enumerate(zip(one.captures[1:], one.poses[1:], two.poses[1:], strict=True)):
        C = whole[6 * k : 6 * k + 6, 6 * k : 6 * k + 6]
        off = np.append(rotation_vector_from_matrix(b.rotation @ a.rotation.T), b.translation_mm - a.translation_mm)
        if off @ np.linalg.solve(C, off) > CONTRADICTION**2 * chi_square_limit(6, CHANCE):
            by_pose = np.hstack([-cross_matrix(a.rotation @ middle), np.eye(3)])
            away = by_pose @ off
            along = away / np.linalg.norm(away) @ by_pose
            found[name] = float(np.linalg.norm(away)), float(np.sqrt(along @ C @ along))
    return found


def _names(phase: PhaseMap, calibration: PhotogrammetricCalibration) -> tuple[str, str]:
    camera = phase.camera if len(calibration.cameras) > 1 else calibration.camera_name
    return camera, phase.projector if len(calibration.projectors) > 1 else calibration.projector_name


def _observed(seen: Sequence[_Seen], poses: Sequence[Pose], by: By) -> list[_Rows]:
    """All observations between pairs of views, weighed so that what m views see counts m - 1 times."""
    rows, share = [], {}
    for i, j in combinations(range(len(seen)), 2):
        if by != "surface" and (common := seen[i].targets.keys() & seen[j].targets.keys()):
            many = np.array([sum(name in one.targets for one in seen) for name in sorted(common)])
            rows.append(_of_targets(seen, poses, (i, j), sorted(common), many))
        if by != "targets" and (found := _of_surface(seen, poses, (i, j))) is not None:
            rows.append(found)
            share[i, j] = share[j, i] = len(found.r) / len(seen[j].places[0])
    others = [[k for k in range(len(seen)) if k not in each.views] for each in rows]
    more = [sum(share.get((each.views[1], k), 0.0) for k in rest) for each, rest in zip(rows, others, strict=True)]
    return [
        each if each.of_targets else replace(each, variance=each.variance * (1 + m / 2))
        for each, m in zip(rows, more, strict=True)
    ]


def _relative(poses: Sequence[Pose], views: tuple[int, int], X: Array) -> tuple[Array, Pose, Array, Array]:
    """Points X (n, 3) of the second view in the first's frame, that pose, and changes with both poses (n, 3, 6)."""
    one, two = (poses[k] for k in views)
    relative = one @ two.inverse()
    middle = two.inverse().apply(X)
    turned = middle @ one.rotation.T

    def crossed(v: Array) -> Array:
        return np.cross(v[:, None, :], np.eye(3)).swapaxes(1, 2)  # the matrix [v]x

    eye = np.broadcast_to(np.eye(3), (len(X), 3, 3))
    by_one = np.concatenate([-crossed(turned), eye], axis=2)
    by_two = relative.rotation @ np.concatenate([crossed(X - two.translation_mm), -eye], axis=2)
    return turned + one.translation_mm, relative, by_one, by_two


def _of_surface(seen: Sequence[_Seen], poses: Sequence[Pose], views: tuple[int, int]) -> _Rows | None:
    one, two = (seen[k] for k in views)
    _, X, by_pair, noise, normals, tile = two.places
    there, relative, by_one, by_two = _relative(poses, views, X)
    camera = one.pair.camera
    at = project(camera.spec, camera.interior, there)
    patches = one.surface.at(at)
    off, by_x = one.surface.gradient(patches, there)
    steep = np.linalg.norm(by_x, axis=1)
    with np.errstate(invalid="ignore"):
        facing = np.einsum("ni,ni->n", by_x, normals @ relative.rotation.T) / steep
        good = np.isfinite(off) & (facing > FACING)
        if np.count_nonzero(good) < 20:
            return None
        r, n = off / steep, by_x / steep[:, None]
        variance = patches.variance / steep**2 + np.einsum("ni,ni->n", n, noise @ relative.rotation.T) ** 2
    good &= np.isfinite(variance)
    own = np.full_like(by_pair, np.nan)
    own[good] = one.by_pair(at[good], there[good])
    changes = np.einsum("ni,nik->nk", n, relative.rotation @ by_pair - own)
    both = np.concatenate([by_one, by_two], axis=2)
    astray = np.einsum("ni,nik->nk", n - normals @ relative.rotation.T, both)
    J = np.einsum("ni,nik->nk", n, both)
    return _Rows(views, r, J[:, :6], J[:, 6:], changes, variance, tile, astray).only(good)


def _of_targets(
    seen: Sequence[_Seen], poses: Sequence[Pose], views: tuple[int, int], names: Sequence[tuple[int, int]], many: Array
) -> _Rows:
    (X, C, B), (Y, D, E) = (
        (np.stack(column) for column in zip(*(seen[k].targets[name] for name in names), strict=True)) for k in views
    )
    there, relative, by_one, by_two = _relative(poses, views, Y)
    R = relative.rotation
    whiten = np.linalg.inv(np.linalg.cholesky((C + R @ D @ R.T) * (many / 2)[:, None, None]))
    r, J, K, B = ((whiten @ a).reshape(3 * len(names), -1) for a in ((there - X)[..., None], by_one, by_two, R @ E - B))
    n = len(r)
    return _Rows(views, r[:, 0], J, K, B, np.ones(n), np.full(n, -1), np.zeros((n, 12)))


def _system(rows: Sequence[_Rows], count: int) -> tuple[Array, Array, Array]:
    """Design (n, 6(count-1)), residuals (n,) and robust weights (n,)."""
    parts, residuals, weights = [np.zeros((0, 6 * (count - 1)))], [np.zeros(0)], [np.zeros(0)]
    for each in rows:
        A = np.zeros((len(each.r), 6 * count))
        for k, J in zip(each.views, (each.by_first, each.by_second), strict=True):
            A[:, 6 * k : 6 * k + 6] = J
        z = np.abs(each.r) / np.sqrt(each.variance)
        limit = max(sigma_by_median(z), 1.0)
        weight = np.minimum(1.0, HUBER * limit / np.maximum(z, 1e-12)) * (z < GROSS * limit)
        parts.append(A[:, 6:])
        residuals.append(each.r)
        weights.append(weight / each.variance)
    return np.concatenate(parts), np.concatenate(residuals), np.concatenate(weights)


def _refuse_untied(rows: Sequence[_Rows], views: Sequence[View]) -> None:
    """See that every view is tied to the first."""
    tied = {0}
    for _ in views:
        tied |= {k for each in rows if tied & set(each.views) for k in each.views}
    for k, view in enumerate(views):
        if k not in tied:
            remedy = "choose captures that overlap, or put targets where both see them"
            raise InputError(view.name, "sees nothing that the others see", remedy)


def _refuse_sliding(rows: Sequence[_Rows], A: Array, weight: Array, views: Sequence[View], most: float) -> None:
    """See that what holds the views is not feigned by noise in the surface's slopes, for more than a share of it."""
    N, loose = A.T @ (A * weight[:, None]), np.zeros((A.shape[1] + 6,) * 2)
    start = 0
    for each in rows:
        own = weight[start : start + len(each.r)]
        start += len(each.r)
        total = each.astray.T @ (each.astray * own[:, None]) / 2  # half of it is by this view's normals
        index = np.concatenate([np.arange(6 * k, 6 * k + 6) for k in each.views])
        loose[np.ix_(index, index)] += total
    scale = 1 / np.sqrt(np.maximum(np.diagonal(N), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(N * np.outer(scale, scale))
    feigned = np.einsum("ik,ij,jk->k", vectors, loose[6:, 6:] * np.outer(scale, scale), vectors)
    if values[0] <= 1e-12 or np.any(feigned > most * values):
        view = views[1 + int(np.argmax(np.abs(vectors[:, np.argmax(feigned / np.maximum(values, 1e-15))]))) // 6]
        seen = "could slide along what the others see of the surface"
        raise InputError(view.name, seen, "put targets where both see them, or let more of the object's form be seen")


def _rest(rows: Sequence[_Rows], A: Array, B: Array, weight: Array, C: Array) -> list[tuple[_Rows, Array]]:
    """What remains of each pair's rows, in sigmas, where poses and calibration may change; 0 without weight."""
    spread = np.linalg.cholesky(C + 1e-30 * np.eye(len(C))) if np.any(C) else np.zeros_like(C)
    Z = np.concatenate([A, B @ spread], axis=1)
    r = np.concatenate([each.r for each in rows])
    N = Z.T @ (Z * weight[:, None])
    N[A.shape[1] :, A.shape[1] :] += np.eye(len(C))
    left = r - Z @ np.linalg.solve(N, Z.T @ (weight * r))
    variance = np.concatenate([each.variance for each in rows])
    z = np.where(weight > 0, left * np.sqrt(np.minimum(weight * variance, 1.0) / variance), 0.0)
    ends = np.cumsum([len(each.r) for each in rows])
    return list(zip(rows, np.split(z, ends[:-1]), strict=True))


def _together(z: Array, tile: Array) -> float:
    """By how much sums over tiles vary more than if their places were independent and their sigmas true."""
    sums, tiles = np.bincount(tile, z), len(np.unique(tile))
    return max(1.0, float(np.sum(sums**2) / len(z)) * tiles / max(tiles - 6, tiles / 3))


def _overlap(views: Sequence[View], rows: _Rows, z: Array) -> Overlap:
    used = z[z != 0]
    number = len(used) // 3 if rows.of_targets else len(used)
    names = views[rows.views[0]].name, views[rows.views[1]].name
    return Overlap(
        names, "targets" if rows.of_targets else "places", number, float(np.sqrt(np.mean(used**2))) if number else 0.0
    )
