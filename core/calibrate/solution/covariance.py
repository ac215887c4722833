"""What the inverse of the normal equations says: redundancy numbers and covariances."""

from __future__ import annotations

import numpy as np

from core.calibrate.solution.equations import GLOBALS, Equations
from core.calibrate.solution.normals import Inverse, Layout, layout_of
from core.calibrate.solution.problem import RELATIVE, Problem
from core.calibrate.solution.state import State
from core.compiling import njit
from core.model import Array, Ints
from core.parallel import run_in_bands


@njit(cache=True, nogil=True, error_model="numpy")
def _cofactor_band(  # pragma: no cover  compiled
    start: int,
    stop: int,
    first_block: int,
    device: Ints,
    layout: Layout,
    columns: Ints,
    n_globals: int,
    J: Array,
    Q: Array,
    CQ: Array,
    Q_eliminated: Array,
    out: Array,
) -> None:
    own_at, width, own_columns = layout.own_at, layout.own_width, columns.shape[1]
    local, place = np.empty(own_columns + 6, np.int64), np.empty(own_columns + 6, np.int64)
    for o in range(start, stop):
        e, k = layout.own[o] - first_block, 0
        for j in range(own_columns):
            if columns[device[o], j] >= 0:
                local[k], place[k] = GLOBALS + j, columns[device[o], j]
                k += 1
        for j in range(layout.kept_width):
            local[k], place[k] = layout.kept_at + j, n_globals + layout.kept_width * layout.kept[o] + j
            k += 1
        for a in range(2):
            row, total = J[o, a], 0.0
            for s in range(k):  # Q is symmetric: twice what stands before the diagonal
                part = 0.5 * Q[place[s], place[s]] * row[local[s]]
                for t in range(s):
                    part += Q[place[s], place[t]] * row[local[t]]
                for t in range(width):
                    part -= CQ[e, t, place[s]] * row[own_at + t]
                total += 2.0 * row[local[s]] * part
            for s in range(width):
                for t in range(width):
                    total += row[own_at + s] * Q_eliminated[e, s, t] * row[own_at + t]
            out[o, a] = total


def redundancy_numbers(problem: Problem, equations: Equations, inverse: Inverse) -> Array:
    """Share of every observation that is checked by the others, shape (m, 2), in the problem's order.

    ``r = 1 - a Q aᵀ / sigma²``; NaN where a coordinate was not observed. With that of a measured distance, their sum is
    the redundancy.
    """
    layout = layout_of(problem)
    out, (E, width, U) = np.empty_like(equations.w), inverse.C.shape

    def band(start: int, stop: int) -> None:
        C = inverse.C[start:stop]
        CQ = (C.reshape(-1, U) @ inverse.Q).reshape(-1, width, U)
        _cofactor_band(
            problem.first[start],
            problem.first[stop],
            start,
            problem.device,
            layout,
            problem.columns,
            problem.globals,
            equations.J,
            inverse.Q,
            CQ,
            inverse.Q_own[start:stop] + CQ @ C.transpose(0, 2, 1),
            out,
        )

    run_in_bands(band, E, least=max(1, 4096 * E // max(len(out), 1)))
    return np.where(problem.root_weight > 0, 1.0 - out, np.nan)


def point_cofactors(problem: Problem, inverse: Inverse) -> Array:
    """Cofactors of every point, shape (n, 3, 3), mm²."""
    if problem.by_points:
        return inverse.Q_own + inverse.C @ inverse.Q @ inverse.C.transpose(0, 2, 1)
    at = problem.globals + 3 * np.arange(problem.points)[:, None] + np.arange(3)
    return inverse.Q[at[:, :, None], at[:, None, :]]


def length_cofactors(problem: Problem, state: State, inverse: Inverse) -> Array:
    """Cofactors of the measured distances as they are adjusted, shape (distances,), mm²."""
    found = []
    for distance in problem.distances:
        ends = distance.start, distance.stop
        difference = state.xyz[ends[0]] - state.xyz[ends[1]]
        along = np.concatenate([difference, -difference]) / np.linalg.norm(difference)
        if problem.by_points:
            C = inverse.C[[*ends]].reshape(6, -1)
            Q = C @ inverse.Q @ C.T
            Q[:3, :3] += inverse.Q_own[ends[0]]
            Q[3:, 3:] += inverse.Q_own[ends[1]]
        else:
            at = np.concatenate([problem.globals + 3 * end + np.arange(3) for end in ends])
            Q = inverse.Q[np.ix_(at, at)]
        found.append(float(along @ Q @ along))
    return np.array(found)


def pose_cofactors(problem: Problem, inverse: Inverse) -> Array:
    """Joint cofactors of globals and poses, shape (globals + 6 P, globals + 6 P)."""
    if problem.by_points:
        return inverse.Q
    G, P = problem.globals, problem.poses
    L = np.zeros((G + 6 * P, len(inverse.Q)))
    L[:G, :G], L[G:] = np.eye(G), -inverse.C.reshape(6 * P, -1)
    Q = L @ inverse.Q @ L.T
    at = G + 6 * np.arange(P)[:, None] + np.arange(6)
    Q[at[:, :, None], at[:, None, :]] += inverse.Q_own
    return Q


def global_cofactors(problem: Problem, inverse: Inverse) -> Array:
    """Cofactors of all devices' interior parameters, then of the relative orientations; zero where one is held.

    Shape (k, k), 6 for every device held rigidly to another, in the order of `parameter_names`.
    """
    relative = [c[:RELATIVE] for c in problem.columns if c[0] >= 0]
    columns = np.concatenate([*problem.interior_columns, *relative])
    G = problem.globals
    Q = np.zeros((G + 1, G + 1))
    Q[:G, :G] = inverse.Q[:G, :G]
    return Q[np.ix_(columns, columns)]  # column -1, the last, is zero
