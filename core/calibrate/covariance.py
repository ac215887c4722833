"""What the inverse of the normal equations says: redundancy numbers and covariances."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from core.calibrate.equations import Equations
from core.calibrate.normals import Inverse
from core.calibrate.problem import Problem
from core.parallel import run_in_bands

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def _cofactor_band(  # pragma: no cover  compiled
    start: int,
    stop: int,
    device: NDArray[np.int64],
    pose: NDArray[np.int64],
    point: NDArray[np.int64],
    columns: NDArray[np.int64],
    n_globals: int,
    J: Array,
    Q: Array,
    CQ: Array,
    Q_pose: Array,
    out: Array,
) -> None:
    local, place = np.empty(18, np.int64), np.empty(18, np.int64)
    for o in range(start, stop):
        p, k = pose[o], 0
        for j in range(15):
            if columns[device[o], j] >= 0:
                local[k], place[k] = j, columns[device[o], j]
                k += 1
        for j in range(3):
            local[k], place[k] = 21 + j, n_globals + 3 * point[o] + j
            k += 1
        for a in range(2):
            row, total = J[o, a], 0.0
            for s in range(k):
                part = 0.0
                for t in range(k):
                    part += Q[place[s], place[t]] * row[local[t]]
                for t in range(6):
                    part -= 2.0 * CQ[p, t, place[s]] * row[15 + t]
                total += row[local[s]] * part
            for s in range(6):
                for t in range(6):
                    total += row[15 + s] * Q_pose[p, s, t] * row[15 + t]
            out[o, a] = total


def redundancy_numbers(problem: Problem, equations: Equations, inverse: Inverse) -> Array:
    """Share of every observation that is checked by the others, shape (m, 2), in the problem's order.

    ``r = 1 - a Q aᵀ / sigma²``; NaN where a coordinate was not observed. With that of a measured distance, their sum is
    the redundancy.
    """
    P, U = problem.poses, len(inverse.Q)
    CQ = (inverse.C.reshape(6 * P, U) @ inverse.Q).reshape(P, 6, U)
    Q_pose = inverse.Q_own + CQ @ inverse.C.transpose(0, 2, 1)
    out = np.empty_like(equations.w)

    def band(start: int, stop: int) -> None:
        _cofactor_band(
            start,
            stop,
            problem.device,
            problem.pose,
            problem.point,
            problem.columns,
            problem.globals,
            equations.J,
            inverse.Q,
            CQ,
            Q_pose,
            out,
        )

    run_in_bands(band, len(out), least=4096)
    return np.where(problem.root_weight > 0, 1.0 - out, np.nan)


def point_cofactors(problem: Problem, inverse: Inverse) -> Array:
    """Cofactors of every point, shape (n, 3, 3), mm²."""
    at = problem.globals + 3 * np.arange(problem.points)[:, None] + np.arange(3)
    return inverse.Q[at[:, :, None], at[:, None, :]]


def global_cofactors(problem: Problem, inverse: Inverse) -> Array:
    """Cofactors of all devices' nine parameters, then of the relative orientations; zero where a parameter is held.

    Shape (k, k) with k = 9 per device and 6 per device held rigidly to another, in the order of `parameter_names`.
    """
    columns = np.concatenate([problem.columns[:, :9].ravel(), *(c[9:] for c in problem.columns if c[9] >= 0)])
    G = problem.globals
    Q = np.zeros((G + 1, G + 1))
    Q[:G, :G] = inverse.Q[:G, :G]
    return Q[np.ix_(columns, columns)]  # column -1, the last, is zero
