"""The observation equations: collinearity through the device's lens, and their analytic derivatives.

Per observation the Jacobian has 15 + K columns: pose 6, point 3, relative orientation 6, and the K parameters of the
largest lens. An orientation's six are a rotation vector that turns from the left, ``R <- exp(w) R``, and a shift in mm.
The lens A1..A6 is written out here; the images through others come with the unknowns.
"""

from __future__ import annotations

import numpy as np

from core.calibrate.solution.problem import Observed, Problem
from core.calibrate.solution.state import State, Unknowns, unknowns_of
from core.compiling import njit
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

    A point behind its device has infinite misclosures and no derivatives. An empty J asks for none.
    """
    device, pose, point, uv, root_weight, raster, r0, other = observed
    interior, relative_rotation, relative_shift, pose_rotation, pose_shift, xyz, image, by_xy, by_parameter = unknowns
    d2 = np.empty((2, 3))  # derivative of the image with respect to the point in the device frame
    e2 = np.empty((2, 3))  # the same with respect to the point in the frame of the pose
    turned, placed, moved = np.empty(3), np.empty(3), np.empty(3)
    derive = len(J) > 0
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
        if other[d]:
            u = image[o, 0] / raster[d, 0] + raster[d, 2]
            v = raster[d, 3] - image[o, 1] / raster[d, 1]
        else:
            x0, y0, a1, a2 = interior[d, 1], interior[d, 2], interior[d, 3], interior[d, 4]
            a3, a4, a5, a6 = interior[d, 5], interior[d, 6], interior[d, 7], interior[d, 8]
            r2, q2 = x * x + y * y, r0[d] * r0[d]
            dr = a1 * (r2 - q2) + a2 * (r2 * r2 - q2 * q2)
            x1 = x + x * dr + 2 * a5 * x * y + a6 * (r2 + 2 * x * x) + x0
            y1 = y + y * dr + 2 * a6 * x * y + a5 * (r2 + 2 * y * y) + y0
            u = (x1 + a3 * x1 + a4 * y1) / raster[d, 0] + raster[d, 2]
            v = raster[d, 3] - (y1 + a4 * x1 - a3 * y1) / raster[d, 1]
        w[k, 0] = (uv[o, 0] - u) * root_weight[o, 0]
        w[k, 1] = (uv[o, 1] - v) * root_weight[o, 1]
        if not derive:
            continue
        su, sv = root_weight[o, 0] / raster[d, 0], -root_weight[o, 1] / raster[d, 1]
        if other[d]:
            for j in range(by_parameter.shape[2]):
                J[k, 0, INTERIOR + j] = su * by_parameter[o, 0, j]
                J[k, 1, INTERIOR + j] = sv * by_parameter[o, 1, j]
            m00, m01 = su * by_xy[o, 0, 0], su * by_xy[o, 0, 1]
            m10, m11 = sv * by_xy[o, 1, 0], sv * by_xy[o, 1, 1]
        else:
            # affine part times the scale to whitened pixels
            t00, t01, t10, t11 = su * (1 + a3), su * a4, sv * a4, sv * (1 - a3)
            g = 2 * (a1 + 2 * a2 * r2)
            jxx = 1 + dr + x * x * g + 2 * a5 * y + 6 * a6 * x
            jxy = x * y * g + 2 * a5 * x + 2 * a6 * y
            jyy = 1 + dr + y * y * g + 2 * a6 * x + 6 * a5 * y
            m00, m01 = t00 * jxx + t01 * jxy, t00 * jxy + t01 * jyy
            m10, m11 = t10 * jxx + t11 * jxy, t10 * jxy + t11 * jyy
            row0, row1 = J[k, 0], J[k, 1]
            row0[INTERIOR], row1[INTERIOR] = (m00 * X + m01 * Y) * k1, (m10 * X + m11 * Y) * k1
            row0[INTERIOR + 1], row1[INTERIOR + 1] = t00, t10
            row0[INTERIOR + 2], row1[INTERIOR + 2] = t01, t11
            radial1, radial2 = r2 - q2, r2 * r2 - q2 * q2
            row0[INTERIOR + 3], row1[INTERIOR + 3] = (t00 * x + t01 * y) * radial1, (t10 * x + t11 * y) * radial1
            row0[INTERIOR + 4], row1[INTERIOR + 4] = (t00 * x + t01 * y) * radial2, (t10 * x + t11 * y) * radial2
            row0[INTERIOR + 5], row1[INTERIOR + 5] = su * x1, -sv * y1
            row0[INTERIOR + 6], row1[INTERIOR + 6] = su * y1, sv * x1
            fx, fy, f2 = r2 + 2 * x * x, r2 + 2 * y * y, 2 * x * y
            row0[INTERIOR + 7], row1[INTERIOR + 7] = t00 * f2 + t01 * fy, t10 * f2 + t11 * fy
            row0[INTERIOR + 8], row1[INTERIOR + 8] = t00 * fx + t01 * f2, t10 * fx + t11 * f2
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


def _room(problem: Problem, rows: int) -> Array:
    """Room for rows of the Jacobian: zeros where not all devices have the same number of parameters."""
    shape = (rows, 2, GLOBALS + problem.columns.shape[1])
    return np.zeros(shape) if problem.other.any() else np.empty(shape)


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
