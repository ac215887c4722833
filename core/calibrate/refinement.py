"""Poses improved one by one with all else held, wrong points softened; compiled, since stations are many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.calibrate.equations import COLUMNS, POSE, equations_band
from core.calibrate.problem import Observed, Problem, State, Unknowns
from core.compiling import njit
from core.parallel import run_in_bands

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

ITERATIONS = 8
SETTLED = 1e-3  # share of the weighted squares by which a step has to lower them to be followed by another
HUBER = 3.0  # median residuals of its pose beyond which an observation counts less


@njit(cache=True, nogil=True)
def _soften(w: Array, factor: Array) -> None:  # pragma: no cover  compiled
    """Square roots of the Huber weights of one pose's misclosures."""
    size = np.sqrt(w[:, 0] ** 2 + w[:, 1] ** 2)
    limit = max(HUBER * np.median(size), 1e-9)
    for k in range(len(size)):
        factor[k] = np.sqrt(limit / size[k]) if size[k] > limit else 1.0


@njit(cache=True, nogil=True)
def _soften_band(start: int, stop: int, first: Ints, w: Array, factor: Array) -> None:  # pragma: no cover  compiled
    for p in range(start, stop):
        _soften(w[first[p] : first[p + 1]], factor[first[p] : first[p + 1]])


def huber_factors(problem: Problem, w: Array) -> Array:
    """Square roots of Huber weights, shape (m, 1), of misclosures, shape (m, 2), pose by pose.

    Observations beyond three median residuals of their pose count less.
    """
    factor = np.empty(len(w))
    run_in_bands(lambda a, b: _soften_band(a, b, problem.first, w, factor), problem.poses, least=100)
    return factor[:, None]


@njit(cache=True, nogil=True)
def _turn(R: Array, v: NDArray[np.floating]) -> None:  # pragma: no cover  compiled
    """``R <- exp(v) R`` in place, by Rodrigues' formula."""
    angle = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    a, b = (np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2) if angle > 1e-8 else (1.0, 0.5)
    for k in range(3):
        x, y, z = R[:, k]
        cx, cy, cz = v[1] * z - v[2] * y, v[2] * x - v[0] * z, v[0] * y - v[1] * x
        R[0, k] += a * cx + b * (v[1] * cz - v[2] * cy)
        R[1, k] += a * cy + b * (v[2] * cx - v[0] * cz)
        R[2, k] += a * cz + b * (v[0] * cy - v[1] * cx)


@njit(cache=True, nogil=True)
def _refine_band(  # pragma: no cover  compiled
    start: int, stop: int, first: Ints, observed: Observed, unknowns: Unknowns, sums: Array
) -> None:
    most = np.max(np.diff(first))
    w, J, factors, no_J = np.empty((most, 2)), np.empty((most, 2, COLUMNS)), np.empty(most), np.empty((0, 2, COLUMNS))
    for p in range(start, stop):
        R, t, damping = unknowns.pose_rotation[p], unknowns.pose_shift[p], 1e-3
        o, end = first[p], first[p + 1]
        n = end - o
        for _ in range(ITERATIONS):
            equations_band(o, end, observed, unknowns, True, w, J)
            _soften(w[:n], factors)
            N, b, cost, trial_cost = np.zeros((6, 6)), np.zeros(6), 0.0, 0.0
            for k in range(n):
                weight = factors[k] ** 2
                for a in range(2):
                    cost += weight * w[k, a] ** 2
                    for s in range(6):
                        value = weight * J[k, a, POSE + s]
                        b[s] += value * w[k, a]
                        for r in range(6):
                            N[s, r] += value * J[k, a, POSE + r]
            for s in range(6):
                N[s, s] += damping * N[s, s] + 1e-12
            step, R_before, t_before = np.linalg.solve(N, b), R.copy(), t.copy()
            _turn(R, step)
            t += step[3:]
            equations_band(o, end, observed, unknowns, False, w, no_J)
            for k in range(n):
                trial_cost += factors[k] ** 2 * (w[k, 0] ** 2 + w[k, 1] ** 2)
            if trial_cost < cost:
                damping /= 10
            else:
                R[:], t[:] = R_before, t_before
                damping *= 10
            if abs(cost - trial_cost) < SETTLED * cost:
                break
        equations_band(o, end, observed, unknowns, False, w, no_J)
        sums[p] = np.sum(np.abs(w[:n]))


def refined(problem: Problem, state: State) -> tuple[State, Array]:
    """Improve the poses one by one with all else held, each with its own damping.

    Returns
    -------
    state : State
    sums : array, shape (poses,)
        Sum of absolute whitened residuals of every pose: a measure that a few wrong points do not rule.
    """
    state = replace(state, pose_rotation=state.pose_rotation.copy(), pose_shift=state.pose_shift.copy())
    sums = np.empty(problem.poses)
    arguments = problem.first, problem.observed, state.unknowns, sums
    run_in_bands(lambda start, stop: _refine_band(start, stop, *arguments), problem.poses, least=8)
    return state, sums


def absolute_sums(problem: Problem, w: Array) -> Array:
    """Sum of absolute misclosures of every pose."""
    return np.add.reduceat(np.sum(np.abs(w), axis=1), problem.first[:-1])
