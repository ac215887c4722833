"""What makes a network weak, in words: parameters it does not determine, missing rolls, missing convergence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.calibrate.approximate.from_images import dimensions
from core.calibrate.solution.covariance import point_cofactors
from core.calibrate.solution.elimination import reduce
from core.calibrate.solution.equations import Equations, largest_displacements, linearise, misclosures
from core.calibrate.solution.iterate import NotConvergedError
from core.calibrate.solution.normals import Inverse, SingularNormalsError
from core.calibrate.solution.problem import Problem
from core.calibrate.solution.state import State, interior_of, moved, poses_in_devices
from core.errors import AdjustmentError, listed
from core.geometry import LENSES, Lens, regular
from core.model import Array, Ints, Network
from core.numerics import sigma_by_median

LEAST_STRENGTH = 1e-13  # share of a parameter's information that is its own, below which it is rounding
HOPELESS = 0.2  # sigma of a parameter, as displacement at the image's edge over the image's radius: not estimated
LOST = 0.1  # sigma of a point over the extent of all of them: not determined
POOR = 0.01  # the same as either, to be warned of
ROLL_CONCENTRATION = 0.9  # mean length of the doubled roll angles; 1 where all images have the same roll
LEAST_CONVERGENCE_DEG = 20.0  # between the viewing directions of the images that differ most
CONVERGENT_DEG = 10.0  # inclination to the mean direction at which an image counts as convergent
LEAST_CONVERGENT = 3
LEAST_IMAGES = 6  # fewer leave hardly any redundancy to tell a device's parameters from its stations
AT_CENTRE = 1e-4  # of the median distance from a device
FEW = 0.01  # of all points, which their images may confuse
ONE_PLACE, MANY = 1e-3, 0.3  # rad, between rays of a point from one place; of all points: more are not to blame
CORNER = 0.25  # share of width and of height that makes a corner of the image

ORIENTATION = ("rx", "ry", "rz", "tx", "ty", "tz")
REMEDIES = {
    "c": "add convergent images (inclined 30° and more) or depth in the field, or hold c",
    "x0": "add images rolled by 90° about the viewing axis and convergent ones, or hold x0",
    "y0": "add images rolled by 90° about the viewing axis and convergent ones, or hold y0",
    "radial": "fill the images to their edges with points, or hold {}",
    "affine": "add images rolled by 90° about the viewing axis, or hold {}",
    "decentring": "add convergent and rolled images, or hold {}",
    "relative": "add poses that both devices see, at different inclinations",
}


def effects(problem: Problem, equations: Equations) -> tuple[Array, list[str], list[str]]:
    """Largest displacement in the image, in its radii, by a unit of each global unknown; names and remedies."""
    shares = np.zeros(problem.globals)
    names, remedies = [""] * problem.globals, [""] * problem.globals
    largest = largest_displacements(problem, equations)
    for d, columns in enumerate(problem.columns):
        own = problem.device == d
        if not own.any():
            continue
        radius = float(np.max(np.hypot(*((problem.uv[own] - problem.raster[d, 2:]) * problem.raster[d, :2]).T)))
        lens = LENSES[problem.models[d]]
        for j, name in enumerate((*ORIENTATION, *lens.names)):
            if columns[j] >= 0:
                shares[columns[j]] = largest[d, j] / radius
                names[columns[j]] = f"{problem.device_names[d]}.{name}"
                kind = "relative" if j < len(ORIENTATION) else lens.kind_of(name)
                remedies[columns[j]] = REMEDIES[kind].format(name)
    return shares, names, remedies


def check_estimable(
    network: Network, problem: Problem, state: State, equations: Equations, inverse: Inverse
) -> list[str]:
    """Refuse what the network does not determine; return warnings of what it determines poorly.

    The AdjustmentError names the parameters or points, what their sigmas would be, and the remedy.
    """
    variance = usual_variance(problem, equations)
    return _poor_parameters(problem, equations, inverse, variance) + _poor_points(
        network, problem, state, inverse, variance
    )


def usual_variance(problem: Problem, equations: Equations) -> float:
    """Variance factor of the bulk of the observations: a gross error is no fault of the geometry."""
    seen = problem.root_weight > 0
    middle = sigma_by_median(equations.w[seen])
    robust = middle**2 * np.count_nonzero(seen) / problem.redundancy
    return max(min(equations.cost / problem.redundancy, robust), 1e-30)


def _poor_parameters(problem: Problem, equations: Equations, inverse: Inverse, variance: float) -> list[str]:
    shares, names, remedies = effects(problem, equations)
    sigma = np.sqrt(variance * np.abs(np.diagonal(inverse.Q)[: problem.globals]))
    effect = sigma * shares
    lost = (effect > HOPELESS) | ~(inverse.strength > LEAST_STRENGTH)
    if lost.any():
        worst = _largest(effect, lost)
        seen = f"sigma {sigma[worst[0]]:.3g} for {names[worst[0]]}"
        raise _not_estimable([names[k] for k in worst], remedies[worst[0]], seen)
    poor = _largest(effect, effect > POOR)
    return [f"weakly determined: {names[k]}, sigma {sigma[k]:.3g}; {remedies[k]}" for k in poor]


def _poor_points(network: Network, problem: Problem, state: State, inverse: Inverse, variance: float) -> list[str]:
    cofactors = np.diagonal(point_cofactors(problem, inverse), axis1=1, axis2=2)
    squares = variance * np.abs(cofactors).sum(axis=1)
    sigma, extent = np.sqrt(squares), float(np.linalg.norm(np.ptp(state.xyz, axis=0)))
    order = np.argsort(-sigma)
    lost = [network.point_names[i] for i in order if sigma[i] > LOST * extent]
    if lost:
        raise AdjustmentError(
            f"point {listed(lost)}",
            f"cannot be determined from these images (sigma {sigma[order[0]]:.3g} mm)",
            "add an image from another direction, or leave it out",
        )
    poor = [i for i in order if sigma[i] > POOR * extent and sigma[i] > 5 * np.median(sigma)]
    if not poor:
        return []
    names = listed([f"{network.point_names[i]} ({sigma[i]:.3g} mm)" for i in poor])
    return [f"weakly determined: point {names}; add images from other directions"]


def _largest(effect: Array, chosen: NDArray[np.bool_]) -> list[int]:
    """Chosen parameters, the greatest effect first, those within a tenth of it."""
    order = np.argsort(-effect)
    picked = [int(k) for k in order if chosen[k]]
    return [k for k in picked if effect[k] >= 0.1 * effect[picked[0]]]


LOOK = "look for wrong picks or identities, frames turned or mirrored, a moved device, or wrong patterns"


class UndeterminedError(AdjustmentError):
    """Parameters cannot be estimated from these images."""


def contradicted_error(error: UndeterminedError, ratio: float) -> AdjustmentError:
    """Say that images which do not fit each other, not their geometry, leave parameters open."""
    return AdjustmentError(
        error.where,
        f"its images contradict each other: residuals are {ratio:.3g} times what their sigmas allow, and {error.seen}",
        LOOK,
    )


def _not_estimable(names: list[str], remedy: str, seen: str) -> UndeterminedError:
    return UndeterminedError("the network", f"{listed(names)} cannot be estimated from these images ({seen})", remedy)


def singular_error(network: Network, problem: Problem, state: State, error: SingularNormalsError) -> AdjustmentError:
    """Name the station, the parameters or the points that singular normal equations leave undetermined."""
    if error.block is not None and problem.by_points:
        return _loose_points([network.point_names[error.block]])
    if error.block is not None:
        return _loose_stations(network, problem, [error.block])
    assert error.direction is not None
    G = problem.globals
    shares, names, remedies = effects(problem, linearise(problem, state))
    effect = np.abs(error.direction[:G]) * shares
    extent = float(np.linalg.norm(np.ptp(state.xyz, axis=0)))
    width = 6 if problem.by_points else 3
    shift = np.linalg.norm(error.direction[G:].reshape(-1, width)[:, -3:], axis=1) / extent
    if effect.max(initial=0.0) > 0.05 * shift.max(initial=0.0):
        worst = _largest(effect, effect > 0)
        return _not_estimable([names[k] for k in worst], remedies[worst[0]], "the normal equations are singular")
    lost = [int(i) for i in np.argsort(-shift) if shift[i] > 0.3 * shift.max()]
    if not lost:  # no number is left
        return AdjustmentError(
            "the network", "its images contradict each other: no adjustment has a finite solution", LOOK
        )
    if problem.by_points:
        return _loose_stations(network, problem, lost)
    return _loose_points([network.point_names[i] for i in lost])


class MirroredError(AdjustmentError):
    """Images of devices that would fit if they were mirrored."""

    def __init__(self, devices: str) -> None:
        super().__init__(
            devices,
            "images fit the points only when they are mirrored",
            "count v downwards and u to the right, exchange u and v if they were exchanged, or give the points in a "
            "right-handed system",
        )


def _loose_points(names: list[str]) -> AdjustmentError:
    return AdjustmentError(
        f"point {listed(names)}",
        "can be moved without any observation noticing",
        "add images that tie these points to the others, or leave them out",
    )


def _loose_stations(network: Network, problem: Problem, poses: list[int]) -> AdjustmentError:
    names = [network.station_names[s] for p in poses for s in np.flatnonzero(problem.station_pose == p)]
    return AdjustmentError(
        f"station {listed(names)}", "its orientation is not determined by its points", "add points to it"
    )


class PointsError(AdjustmentError):
    """Points keep a network from being solved: their numbers, and where its unknowns stood."""

    def __init__(self, network: Network, points: Ints, state: State, seen: str, remedy: str) -> None:
        super().__init__(f"point {listed([network.point_names[i] for i in points])}", seen, remedy)
        self.points, self.state = points, state


def points_behind(problem: Problem, state: State) -> Ints:
    """Few points, numbered as in the problem, that a step without damping would carry behind a device.

    Those that steps with damping have carried to a device's projection centre leave nothing to be solved.
    """
    try:
        trial = moved(problem, state, reduce(problem, state).solve(problem))
        beyond = np.isinf(misclosures(problem, trial)).any(axis=1)
    except SingularNormalsError:
        R, t = poses_in_devices(problem, state)
        depth = -(np.einsum("mj,mj->m", R[:, 2], state.xyz[problem.point]) + t[:, 2])
        beyond = depth < AT_CENTRE * np.median(depth)
    behind = np.unique(problem.point[beyond])
    return behind if len(behind) <= FEW * problem.points else behind[:0]


def points_from_one_place(problem: Problem, state: State) -> Ints:
    """Points, numbered as in the problem, whose rays all come from one place: nothing tells how far away they are.

    None where there are many: then these are not to blame.
    """
    R, t = poses_in_devices(problem, state)
    rays = np.einsum("mij,mj->mi", R, state.xyz[problem.point]) + t  # in devices
    away = np.linalg.norm(rays, axis=1, keepdims=True)
    rays = np.einsum("mji,mj->mi", R, rays / np.maximum(away, np.finfo(float).tiny))
    mean = np.zeros_like(state.xyz)
    np.add.at(mean, problem.point, rays)
    count = np.bincount(problem.point, minlength=len(mean)).clip(1)
    spread = 1 - np.sum(np.square(mean), axis=1) / count**2  # mean square of the angles to the middle ray, rad²
    close = np.flatnonzero(spread < ONE_PLACE**2)
    return close if len(close) <= MANY * problem.points else close[:0]


def unsolved_error(network: Network, problem: Problem, error: NotConvergedError) -> AdjustmentError:
    """Why the iterations did not converge: what is not determined where they ended, or else their course."""
    for find, seen, remedy in (
        (points_behind, "rays meet behind a device, not before it", "check identities, or leave it out"),
        (points_from_one_place, "seen from one place only", "add images from elsewhere, or leave it out"),
    ):
        if len(points := find(problem, error.state)):
            return PointsError(network, points, error.state, seen, remedy)
    try:
        inverse = reduce(problem, error.state).invert(problem)
        _poor_parameters(problem, linearise(problem, error.state), inverse, 1.0)
    except SingularNormalsError as singular:
        return singular_error(network, problem, error.state, singular)
    except AdjustmentError as undetermined:
        return undetermined
    course = error.convergence
    return AdjustmentError(
        "the adjustment",
        f"does not converge: weighted sum of squares {course[0]:.4g}, after {len(course) - 1} steps {course[-1]:.4g}",
        "check the nominal focal lengths, the approximate points and the identities of the observed points",
    )


def geometry_warnings(problem: Problem, state: State) -> list[str]:
    """Warn of what every device's images lack: number, rolls, convergence, corners; say what to photograph next."""
    warnings = []
    for d, name in enumerate(problem.device_names):
        own = problem.device == d
        poses = np.unique(problem.pose[own])
        lens = LENSES[problem.models[d]]
        estimated = [p for p, column in zip(lens.names, problem.interior_columns[d], strict=True) if column >= 0]
        if len(poses) == 0 or not estimated:
            continue
        R = state.relative_rotation[d] @ state.pose_rotation[poses]
        found = (_few_images(len(poses)), _no_rolls(R, estimated, lens), _no_convergence(R, estimated))
        empty = empty_corners(problem.uv[own], 2 * problem.raster[d, 2:] + 1)
        warnings += [
            f"{name}: {text}" for text in (*found, _no_points(empty, estimated), _folded(problem, state, d)) if text
        ]
    return warnings


def behind_warning(network: Network, state: State) -> list[str]:
    """Say so where a flat field of others is seen from its back: so it looks where every device counts v upwards."""
    seen = state.pose_rotation[:, 2, 2]
    if network.point_ids or dimensions(network.point_xyz_mm) != 2 or 2 * np.count_nonzero(seen < 0) <= len(seen):
        return []
    return [
        "the points are seen from behind, their z leads away from the devices: right where their y runs downwards; if "
        "v was counted upwards, the results are mirrored"
    ]


def _few_images(count: int) -> str:
    if count >= LEAST_IMAGES:
        return ""
    return f"only {count} images: photograph the field at least {LEAST_IMAGES} times, tilted to all sides and rolled"


def _folded(problem: Problem, state: State, device: int) -> str:
    """Say so where the distortion found cannot be inverted all over the image."""
    spec = problem.specs[device]
    if regular(spec, interior_of(problem, state, device)):
        return ""
    return "its distortion cannot be inverted everywhere in the image: hold the radial parameters of high order"


def _no_rolls(R: Array, estimated: list[str], lens: Lens) -> str:
    weak = [p for p in (*lens.of_kind("affine"), "x0", "y0") if p in estimated]
    if not weak or _roll_concentration(R) <= ROLL_CONCENTRATION:
        return ""
    return (
        f"no images rolled by 90° about the viewing axis: {', '.join(weak)} are weak; "
        "photograph the field again, turned by 90° in its own plane"
    )


def _no_convergence(R: Array, estimated: list[str]) -> str:
    directions = -R[:, 2, :]
    mean = directions.mean(axis=0)
    mean /= max(float(np.linalg.norm(mean)), 1e-12)
    tilt = np.degrees(np.arccos(np.clip(directions @ mean, -1, 1)))
    count = int(np.count_nonzero(tilt > CONVERGENT_DEG))
    if "c" not in estimated:
        return ""
    # two directions differ at least by as much as one of them from the mean
    widest = float(tilt.max())
    if widest < LEAST_CONVERGENCE_DEG or count < LEAST_CONVERGENT:
        closest = min(float((directions @ direction).min()) for direction in directions)
        widest = float(np.degrees(np.arccos(np.clip(closest, -1, 1))))
    if widest >= LEAST_CONVERGENCE_DEG and count >= LEAST_CONVERGENT:
        return ""
    normals = R @ mean  # of the field, in the device's frame: towards the device or away from it
    normals *= np.sign(normals[:, 2:])
    limit = np.sin(np.radians(CONVERGENT_DEG))
    shown = {"left": -normals[:, 0], "right": normals[:, 0], "up": normals[:, 1], "down": -normals[:, 1]}
    missing = [side for side, lean in shown.items() if not np.any(lean > limit)] or list(shown)
    return (
        f"{count} of {len(R)} images are inclined by more than {CONVERGENT_DEG:.0f}° to the mean viewing "
        f"direction (widest angle {widest:.0f}°): c, x0, y0 are weak; add convergent images: "
        f"tilt the field by 30° so that it faces {', '.join(missing)}"
    )


def empty_corners(uv: Array, size: Array) -> list[str]:
    """Name the corners of an image, a quarter of its width and height (px) each, that hold none of `uv` (n, 2).

    Examples
    --------
    >>> empty_corners(np.array([[1.0, 1.0], [99.0, 79.0], [50.0, 5.0]]), np.array([100, 80]))
    ['upper right', 'lower left']
    """
    low, high = uv + 0.5 < CORNER * size, uv + 0.5 > (1 - CORNER) * size
    sides = {"upper": low[:, 1], "lower": high[:, 1]}
    return [
        f"{vertical} {horizontal}"
        for vertical, rows in sides.items()
        for horizontal, columns in (("left", low[:, 0]), ("right", high[:, 0]))
        if not np.any(rows & columns)
    ]


def _no_points(empty: list[str], estimated: list[str]) -> str:
    weak = [p for p in estimated if p not in ("c", "x0", "y0")]
    if not empty or not weak:
        return ""
    corners = f"{' and '.join(empty)} corner{'s' if len(empty) > 1 else ''}"
    return (
        f"no image points in the {corners} of the image: {', '.join(weak)} are extrapolated there; "
        "photograph the field there"
    )


def _roll_concentration(R: Array) -> float:
    """Mean resultant length of twice the roll angles about the viewing axis; opposite rolls count as the same."""
    # the twist about Z of every rotation relative to the first: its quaternion's angle about that axis
    relative = R @ R[0].T
    roll = np.arctan2(relative[:, 1, 0] - relative[:, 0, 1], relative[:, 0, 0] + relative[:, 1, 1])
    return float(np.abs(np.mean(np.exp(2j * roll))))
