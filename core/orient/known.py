"""What is known of a scene: lengths between its features, or points; as observations of the rig's parameters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from core.digits import fixed, unit_hint
from core.errors import InputError, StripeError
from core.evaluate import fit_sphere
from core.geometry import project_with_derivatives, similarity
from core.geometry.intersection import by_parameters
from core.lazy import dataclass
from core.model import Array, KnownLength, KnownPoints, Pair, PhaseMap
from core.orient.residuals import Residuals, epipolar_residuals, pixels_within, single_places

FEWEST = 6  # pixels of a feature, and known points
OUT_OF_FORM, ROUGH = 0.02, 5.0  # r.m.s. of points off their form: as a share of what is seen, and over their noise
LEAST_SEEN, VAGUE = 0.1, 0.1  # of a ball's radius: half of what is seen, and its standard deviation
MOST_OFF, SURE = 0.05, 3.0  # of a length: off by more it is between other places, or in another unit; sigmas


@dataclass(frozen=True)
class Surface:
    """What is seen at one end of a known length."""

    name: str
    at: Array  # (n, 2): places, px from the middle
    xyz_mm: Array  # (n, 3)
    noise_mm: Array  # (n,), along the line of sight

    @property
    def half_mm(self) -> float:
        """Half its size: the radius of a disc that spreads as much."""
        return float(np.sqrt(2 * np.mean(np.sum((self.xyz_mm - self.xyz_mm.mean(axis=0)) ** 2, axis=1))))

    def bends(self, off_mm: Array) -> bool:
        """Whether the points are off a form (n,) by more than noise and calibration explain."""
        most = max(ROUGH * float(np.sqrt(np.mean(self.noise_mm**2))), OUT_OF_FORM * self.half_mm)
        return float(np.sqrt(np.mean(off_mm**2))) > most


# of two features: their distance, and its change with each point of both (n, 3)
Distance = Callable[[Surface, Surface], tuple[float, Array, Array]]


@dataclass(frozen=True)
class Observed:
    """Observations of the parameters, each in its standard deviations: what remains, and its change (m, k)."""

    rest: Array
    A: Array
    name: str


def _points(one: Surface, two: Surface) -> tuple[float, Array, Array]:
    """Of the surface at two places."""
    own, other = (np.linalg.pinv(np.column_stack([np.ones(len(s.at)), s.at]))[0] for s in (one, two))
    away = other @ two.xyz_mm - own @ one.xyz_mm
    length = float(np.linalg.norm(away))
    return length, -own[:, None] * away / length, other[:, None] * away / length


def _ball(seen: Surface) -> tuple[Array, Array]:
    """Fit a ball: its centre (3,), and the change of that with each point (n, 3, 3)."""
    remedy = "choose a place and radius that hold a ball alone, or measure between points or planes"
    try:
        ball = fit_sphere(seen.xyz_mm)
    except StripeError as error:
        raise InputError("--length", f"no ball is seen {seen.name}: {error.seen}", remedy) from None
    normals = (seen.xyz_mm - ball.centre_mm) / np.linalg.norm(seen.xyz_mm - ball.centre_mm, axis=1)[:, None]
    influence = np.linalg.pinv(np.column_stack([normals, np.ones(len(normals))]))
    rays = seen.xyz_mm / np.linalg.norm(seen.xyz_mm, axis=1)[:, None]
    radius, sigma = ball.radius_mm, float(np.linalg.norm(influence[3] * np.sum(normals * rays, axis=1) * seen.noise_mm))
    if not (sigma < VAGUE * radius and seen.half_mm > LEAST_SEEN * radius) or seen.bends(ball.deviations(seen.xyz_mm)):
        off = fixed(float(np.sqrt(np.mean(ball.deviations(seen.xyz_mm) ** 2))), 3)
        best = f"{2 * seen.half_mm:.3g} mm of surface fit a radius of {radius:.3g} ± {sigma:.2g} mm to {off} mm"
        raise InputError("--length", f"no ball is seen {seen.name}: {best}", remedy)
    return ball.centre_mm, influence[:3].T[:, :, None] * normals[:, None, :]


def _balls(one: Surface, two: Surface) -> tuple[float, Array, Array]:
    """Of the centres of two balls."""
    (centre, influence), (other_centre, other_influence) = _ball(one), _ball(two)
    away = other_centre - centre
    length = float(np.linalg.norm(away))
    own, other = (np.einsum("nij,i->nj", part, away / length) for part in (influence, other_influence))
    return length, -own, other


def _planes(one: Surface, two: Surface) -> tuple[float, Array, Array]:
    """Of two parallel planes, such as the faces of a step."""
    X, Y = one.xyz_mm, two.xyz_mm
    middles = X.mean(axis=0), Y.mean(axis=0)
    centred = np.concatenate([X - middles[0], Y - middles[1]])
    axes = np.linalg.eigh(centred.T @ centred)[1]
    normal = axes[:, 0] * np.sign(axes[:, 0] @ (middles[1] - middles[0]))
    J = np.zeros((len(centred), 4))
    J[:, :2] = np.concatenate([X, Y]) @ axes[:, 1:]
    J[: len(X), 2], J[len(X) :, 3] = 1.0, 1.0
    if one.bends(centred[: len(X)] @ axes[:, 0]) or two.bends(centred[len(X) :] @ axes[:, 0]):
        seen = f"the surfaces {one.name} and {two.name} are no parallel planes"
        raise InputError("--length", seen, "choose places and radii with one plane each, or measure between points")
    fitted = np.linalg.pinv(J)
    by = (fitted[3] - fitted[2])[:, None] * normal
    return float(normal @ (middles[1] - middles[0])), by[: len(X)], by[len(X) :]


LENGTHS: dict[str, Distance] = {"points": _points, "balls": _balls, "planes": _planes}


def measured_length(known: KnownLength, phase: PhaseMap, pair: Pair) -> tuple[float, float, Array]:
    """Give a length as a pair of devices measures it, its sigma by noise, and its change with the parameters (k,).

    InputError if the features have too few pixels with both coordinates, or are none of their kind.
    """
    found: list[Surface] = []
    shown: list[Residuals] = []
    for u, v, radius in known.ends:
        sight = pixels_within(phase, u, v, radius)
        if len(sight.uv) < FEWEST:
            seen = f"{len(sight.uv)} pixels have both projector coordinates within {radius:g} px of {u:g},{v:g}"
            raise InputError("--length", seen, "choose a place of the object that is well lit, or a larger radius")
        shown.append(residuals := epipolar_residuals(sight, pair))
        noise = np.linalg.norm(residuals.xyz_mm, axis=1) * residuals.sigma_log
        found.append(Surface(f"within {radius:g} px of {u:g},{v:g}", sight.pixels - (u, v), residuals.xyz_mm, noise))
    length, *by_points = LENGTHS[known.kind](*found)
    slope, variance = np.zeros(shown[0].A.shape[1]), 0.0
    for by, seen_as in zip(by_points, shown, strict=True):
        slope += np.einsum("ni,nik->k", by, seen_as.by_xyz)
        variance += float(np.sum((np.einsum("ni,ni->n", by, seen_as.xyz_mm) * seen_as.sigma_log) ** 2))
    return length, float(np.sqrt(variance)), slope


def calibrated_length(known: KnownLength, phase: PhaseMap, pair: Pair) -> float:
    """Give a length as the calibration measures it; InputError if that is another one."""
    length, noise, _ = measured_length(known, phase, pair)
    most = MOST_OFF * known.length_mm
    if noise > most or abs(length - known.length_mm) > max(most, SURE * noise):
        ends = " to ".join(f"{u:g},{v:g}" for u, v, _ in known.ends)
        told = f"{known.length_mm:g} mm{unit_hint(known.length_mm / length)}"
        seen = f"{ends} is {fixed(length, 3)} ± {fixed(noise, 3)} mm as calibrated, but known as {told}"
        raise InputError("--length", seen, "check the length, and that its places hold these features alone")
    return length


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
