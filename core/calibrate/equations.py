"""The observation equations: collinearity through the device's lens, and their analytic derivatives.

Per observation the Jacobian has 15 + K columns: pose 6, point 3, relative orientation 6, and the K parameters of the
largest lens. An orientation's six are a rotation vector that turns from the left, ``R <- exp(w) R``, and a shift in mm.
The images through the lenses come with the unknowns, so that the kernels know of no lens.
"""

from __future__ import annotations

import numpy as np

from core.calibrate.problem import Observed, Problem
from core.calibrate.state import State, Unknowns, interior_of, pinholes
from core.compiling import njit
from core.geometry import LENSES
from core.lazy import dataclass
from core.model import Array, NetworkScale
from core.parallel import run_in_bands

POSE, POINT, GLOBALS, INTERIOR = 0, 6, 9, 15  # where the columns begin; GLOBALS: relative, then interior


@dataclass(frozen=True)
class Equations:
    """The linearised, whitened observation equations ``J dx = w``; not observed coordinates have zero rows."""

    w: Array  #: (m, 2): observed minus computed, in units of the observation's sigma
    J: Array  #: (m, 2, 15 + K): derivatives in the same unit
    #: weighted sum of squares vᵀPv, a measured distance included; infinite where a point lies behind its device
    cost: float


@njit(cache=True, nogil=True, error_model="numpy")
def equations_band(  # pragma: no cover  compiled
    start: int, stop: int, observed: Observed, unknowns: Unknowns, w: Array, J: Array
) -> None:
    """Misclosures of observations start to stop - 1 into w, shape (stop - start, 2), and their rows into J.

    A point behind its device has infinite misclosures and no derivatives. An empty J asks for none. Unknowns without
    images through lenses are those of pinholes in the middle of the raster.
    """
    device, pose, point, uv, root_weight, raster = observed
    interior, relative_rotation, relative_shift, pose_rotation, pose_shift, xyz, image, by_xy, by_parameter = unknowns
    d2 = np.empty((2, 3))  # derivative of the image with respect to the point in the device frame
    e2 = np.empty((2, 3))  # the same with respect to the point in the frame of the pose
    turned, placed, moved = np.empty(3), np.empty(3), np.empty(3)
    derive, bent = len(J) > 0, len(image) > 0
    for o in range(start, stop):
        k, d, p, i = o - start, device[o], pose[o], point[o]
        R, S = pose_rotation[p], relative_rotation[d]
        for j in range(3):
            turned[j] = R[j, 0] * xyz[i, 0] + R[j, 1] * xyz[i, 1] + R[j, 2] * xyz[i, 2]
            placed[j] = turned[j] + pose_shift[p, j]
        for j in range(3):
            moved[j] = S[j, 0] * placed[0] + S[j, 1] * placed[1] + S[j, 2] * placed[2]
        X, Y, Z = moved[0] + relative_shift[d, 0], moved[1] + relative_shift[d, 1], moved[2] + relative_shift[d, 2]
        if Z >= 0.0:  # behind the device
            w[k, 0] = w[k, 1] = np.inf
            for j in range(J.shape[2] if derive else 0):
                J[k, 0, j] = J[k, 1, j] = 0.0
            continue
        c, k1 = interior[d, 0], -1.0 / Z
        x, y = c * X * k1, c * Y * k1
        x1, y1 = (image[o, 0], image[o, 1]) if bent else (x, y)
        u, v = x1 / raster[d, 0] + raster[d, 2], raster[d, 3] - y1 / raster[d, 1]
        w[k, 0] = (uv[o, 0] - u) * root_weight[o, 0]
        w[k, 1] = (uv[o, 1] - v) * root_weight[o, 1]
        if not derive:
            continue
        su, sv = root_weight[o, 0] / raster[d, 0], -root_weight[o, 1] / raster[d, 1]
        for j in range(by_parameter.shape[2]):
            J[k, 0, INTERIOR + j] = su * by_parameter[o, 0, j]
            J[k, 1, INTERIOR + j] = sv * by_parameter[o, 1, j]
        m00, m01, m10, m11 = su, 0.0, 0.0, sv
        if bent:
            m00, m01 = su * by_xy[o, 0, 0], su * by_xy[o, 0, 1]
            m10, m11 = sv * by_xy[o, 1, 0], sv * by_xy[o, 1, 1]
        d2[0, 0], d2[0, 1], d2[0, 2] = m00 * c * k1, m01 * c * k1, (m00 * x + m01 * y) * k1
        d2[1, 0], d2[1, 1], d2[1, 2] = m10 * c * k1, m11 * c * k1, (m10 * x + m11 * y) * k1
        for a in range(2):
            row = J[k, a]
            row[9] = moved[1] * d2[a, 2] - moved[2] * d2[a, 1]
            row[10] = moved[2] * d2[a, 0] - moved[0] * d2[a, 2]
            row[11] = moved[0] * d2[a, 1] - moved[1] * d2[a, 0]
            for j in range(3):
                row[12 + j] = d2[a, j]
                e2[a, j] = d2[a, 0] * S[0, j] + d2[a, 1] * S[1, j] + d2[a, 2] * S[2, j]
            row[0] = turned[1] * e2[a, 2] - turned[2] * e2[a, 1]
            row[1] = turned[2] * e2[a, 0] - turned[0] * e2[a, 2]
            row[2] = turned[0] * e2[a, 1] - turned[1] * e2[a, 0]
            for j in range(3):
                row[3 + j] = e2[a, j]
                row[6 + j] = e2[a, 0] * R[0, j] + e2[a, 1] * R[1, j] + e2[a, 2] * R[2, j]


def unknowns_of(problem: Problem, state: State, derive: bool = True) -> Unknowns:
    """Give a state as the kernels take it, with the observations through their lenses."""
    m, unknowns, no_J = len(problem.point), pinholes(state), _room(problem, 0)
    image, by_xy, by_parameter = np.zeros((m, 2)), np.zeros((m, 2, 2)), np.zeros((m, 2, state.interior.shape[1]))
    # misclosures of a zero in a raster of a millimetre
    raster = np.tile([1.0, 1.0, 0.0, 0.0], (len(problem.raster), 1))
    zero = problem.observed._replace(uv=np.zeros((m, 2)), root_weight=np.ones((m, 2)), raster=raster)

    def look(start: int, stop: int) -> None:
        xy = np.empty((stop - start, 2))
        equations_band(start, stop, zero, unknowns, xy, no_J)
        xy = np.where(np.isfinite(xy), xy * [-1, 1], 0.0)  # what is behind is told by the kernels
        for d, model in enumerate(problem.models):
            own = np.flatnonzero(problem.device[start:stop] == d)
            interior, lens, rows = interior_of(problem, state, d), LENSES[model], own + start
            with np.errstate(all="ignore"):
                image[rows] = lens.distort(interior, xy[own])
                if derive:
                    by_xy[rows], by_parameter[rows, :, : len(lens.names)] = lens.derivatives(interior, xy[own])

    run_in_bands(look, m, least=8192)
    return unknowns._replace(image=image, by_xy=by_xy, by_parameter=by_parameter)


def _room(problem: Problem, rows: int) -> Array:
    """Room for rows of the Jacobian."""
    return np.empty((rows, 2, GLOBALS + problem.columns.shape[1]))


def room_for_block(problem: Problem) -> tuple[Array, Array]:
    """Give w and J for the observations of one eliminated pose or point, whichever has most."""
    most = int(np.max(np.diff(problem.first)))
    return np.empty((most, 2)), _room(problem, most)


def misclosures(problem: Problem, state: State) -> Array:
    """Observed minus computed of a problem at a state in units of sigma, shape (m, 2); infinite behind a device."""
    w, unused = np.empty((len(problem.point), 2)), _room(problem, 0)
    given = problem.observed, unknowns_of(problem, state, derive=False)
    run_in_bands(lambda a, b: equations_band(a, b, *given, w[a:b], unused), len(w), least=8192)
    return w


def linearise(problem: Problem, state: State) -> Equations:
    """Observation equations of a problem at a state."""
    w = np.empty((len(problem.point), 2))
    J = _room(problem, len(w))
    given = problem.observed, unknowns_of(problem, state)
    run_in_bands(lambda a, b: equations_band(a, b, *given, w[a:b], J[a:b]), len(w), least=4096)
    return Equations(w, J, weighted_squares(problem, state, w))


def distance_equation(distance: NetworkScale, state: State) -> tuple[float, Array]:
    """Misclosure of a measured distance, and its derivative with respect to its first point, whitened.

    That with respect to the second point has the other sign.
    """
    difference = state.xyz[distance.start] - state.xyz[distance.stop]
    length, sigma = float(np.linalg.norm(difference)), distance.sigma_mm
    return (distance.length_mm - length) / sigma, difference / (length * sigma)


def weighted_squares(problem: Problem, state: State, w: Array) -> float:
    """vᵀPv of misclosures at a state, with measured distances and what is known; infinite for a point behind."""
    total = float(np.vdot(w, w))
    for distance in problem.distances:
        total += distance_equation(distance, state)[0] ** 2
    if problem.points_free:
        total += float(np.sum(problem.point_weight * (state.xyz - problem.approximate) ** 2))
    total += float(np.sum(problem.interior_weight * (state.interior - problem.interior_known) ** 2))
    return total if np.isfinite(total) else np.inf


def cost_of(problem: Problem, state: State) -> float:
    """vᵀPv of a problem at a state."""
    return weighted_squares(problem, state, misclosures(problem, state))


def largest_displacements(problem: Problem, equations: Equations) -> Array:
    """How far in its image each device's global parameters move a point at most, mm per unit, as `columns`."""
    largest = np.zeros(problem.columns.shape)
    for d, raster in enumerate(problem.raster):
        own = problem.device == d
        root = problem.root_weight[own]
        unit = np.where(root > 0, raster[:2], 0.0) / np.where(root > 0, root, 1.0)
        moved = np.abs(equations.J[own, :, GLOBALS:]) * unit[..., None]
        largest[d] = moved.max(axis=(0, 1), initial=0.0)
    return largest
