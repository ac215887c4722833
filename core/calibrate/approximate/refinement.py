"""Poses improved one by one with all else held, wrong points softened; compiled, since stations are many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.calibrate.solution.equations import POSE, equations_band, room_for_block
from core.calibrate.solution.problem import Observed, Problem
from core.calibrate.solution.robust import ENOUGH
from core.calibrate.solution.state import State, Unknowns, unknowns_of
from core.compiling import inner, njit
from core.model import Array, Ints
from core.numerics.small import solve_in_place
from core.parallel import run_in_bands

ITERATIONS = 8
SETTLED = 1e-3  # share of the weighted squares by which a step has to lower them to be followed by another
OUTLYING = 3.0  # median residuals of its pose beyond which an observation counts less


@inner(error_model="numpy")
def _soften(start: int, stop: int, w: Array, factor: Array, sizes: Array) -> float:  # pragma: no cover  compiled
    """Square roots of weights of one pose's misclosures start to stop - 1; the misclosure they set in at."""
    for k in range(start, stop):
        factor[k] = sizes[k - start] = np.sqrt(w[k, 0] ** 2 + w[k, 1] ** 2)
    limit = max(OUTLYING * np.median(sizes[: stop - start]), 1e-9) if stop - start >= ENOUGH else np.inf
    for k in range(start, stop):
        factor[k] = limit / factor[k] if factor[k] > limit else 1.0
    return limit


@inner(error_model="numpy")
def _sum(start: int, stop: int, w: Array, limit: float) -> float:  # pragma: no cover  compiled
    total = 0.0
    for k in range(start, stop):
        total += min(np.sqrt(w[k, 0] ** 2 + w[k, 1] ** 2), limit)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _soften_band(  # pragma: no cover  compiled
    start: int, stop: int, first: Ints, w: Array, factor: Array, sums: Array
) -> None:
    sizes = np.empty(len(w))
    for p in range(start, stop):
        sums[p] = _sum(first[p], first[p + 1], w, _soften(first[p], first[p + 1], w, factor, sizes))


def robust_factors(problem: Problem, w: Array) -> tuple[Array, Array]:
    """Square roots of weights, shape (m, 1), of misclosures, shape (m, 2), pose by pose.

    Observations beyond three median residuals of their pose add no more to the weighted squares than those at three:
    points may be wrong by any length. The second array, shape (poses,), are sums of residuals that count for three
    medians at most.
    """
    factor, sums = np.empty(len(w)), np.empty(problem.poses)
    run_in_bands(lambda a, b: _soften_band(a, b, problem.first, w, factor, sums), problem.poses, least=100)
    return factor[:, None], sums


@inner(error_model="numpy")
def _turn(R: Array, v: Array) -> None:  # pragma: no cover  compiled
    """``R <- exp(v) R`` in place, by Rodrigues' formula."""
    angle = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    a, b = 1.0, 0.5
    if angle > 1e-8:
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
    for k in range(3):
        x, y, z = R[0, k], R[1, k], R[2, k]
        cx, cy, cz = v[1] * z - v[2] * y, v[2] * x - v[0] * z, v[0] * y - v[1] * x
        R[0, k] += a * cx + b * (v[1] * cz - v[2] * cy)
        R[1, k] += a * cy + b * (v[2] * cx - v[0] * cz)
        R[2, k] += a * cz + b * (v[0] * cy - v[1] * cx)


@inner(error_model="numpy")
def _pose_normals(n: int, w: Array, J: Array, factor: Array, N: Array, b: Array) -> None:  # pragma: no cover  compiled
    """Weighted normal equations of one pose's n observations into N (its lower triangle) and b."""
    for s in range(6):
        b[s] = 0.0
        for r in range(6):
            N[s, r] = 0.0
    for k in range(n):
        weight = factor[k] ** 2
        if not w[k, 0] < np.inf:  # behind the device
            continue
        for a in range(2):
            for s in range(6):
                value = weight * J[k, a, POSE + s]
                b[s] += value * w[k, a]
                for r in range(s + 1):
                    N[s, r] += value * J[k, a, POSE + r]


@inner
def _squares(n: int, w: Array, factor: Array) -> float:  # pragma: no cover  compiled
    total = 0.0
    for k in range(n):
        if factor[k] > 0.0:  # 0 of what was behind the device before the step
            total += factor[k] ** 2 * (w[k, 0] ** 2 + w[k, 1] ** 2)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _refine_band(  # pragma: no cover  compiled
    start: int, stop: int, first: Ints, observed: Observed, unknowns: Unknowns, w: Array, J: Array, sums: Array
) -> None:
    """Poses start to stop - 1; w and J have room for the observations of one."""
    factor, sizes, no_J = np.empty(len(w)), np.empty(len(w)), J[:0]
    N, b, R_before, t_before = np.empty((6, 6)), np.empty(6), np.empty((3, 3)), np.empty(3)
    for p in range(start, stop):
        R, t, damping = unknowns.pose_rotation[p], unknowns.pose_shift[p], 1e-3
        o, end = first[p], first[p + 1]
        n = end - o
        for _ in range(ITERATIONS):
            equations_band(o, end, observed, unknowns, w, J)
            _soften(0, n, w, factor, sizes)
            cost = _squares(n, w, factor)
            _pose_normals(n, w, J, factor, N, b)
            for s in range(6):
                N[s, s] += damping * N[s, s] + 1e-12
            if not solve_in_place(N, b):
                break
            R_before[:], t_before[:] = R, t
            _turn(R, b)
            for s in range(3):
                t[s] += b[3 + s]
            equations_band(o, end, observed, unknowns, w, no_J)
            trial_cost = _squares(n, w, factor)
            if trial_cost < cost:
                damping /= 10
            else:
                R[:], t[:] = R_before, t_before
                damping *= 10
            if abs(cost - trial_cost) < SETTLED * cost:
                break
        equations_band(o, end, observed, unknowns, w, no_J)
        sums[p] = _sum(0, n, w, _soften(0, n, w, factor, sizes))


def refined(problem: Problem, state: State) -> tuple[State, Array]:
    """Improve the poses one by one with all else held, each with its own damping.

    Also gives the sums (poses,) of the residuals of every pose, as `robust_factors` gives them.
    """
    state = replace(state, pose_rotation=state.pose_rotation.copy(), pose_shift=state.pose_shift.copy())
    sums = np.empty(problem.poses)
    given = problem.first, problem.observed, unknowns_of(problem, state)
    run_in_bands(lambda a, b: _refine_band(a, b, *given, *room_for_block(problem), sums), problem.poses, least=8)
    return state, sums
