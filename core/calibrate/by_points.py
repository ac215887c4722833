"""The points eliminated: what remains are the globals and the poses, for networks of very many points.

The inner constraints and the measured distance bind the points. They join the elimination as Lagrange multipliers::

    | N   B   F | | dx |   | b |        x: points (block diagonal N)     F = (D, e): constraints' columns, distance
    | Bᵀ  M   0 | | dz | = | g |        z: globals and poses             E = diag(0 ... 0, 1): the distance may be off
    | Fᵀ  0  -E | | l  |   | h |

and with ``T = BᵀN⁻¹F`` and ``V = FᵀN⁻¹F + E`` the system that remains for z is positive definite::

    (M - BᵀN⁻¹B + T V⁻¹ Tᵀ) dz = g - BᵀN⁻¹b + T V⁻¹ (FᵀN⁻¹b - h)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.calibrate.datum import datum_columns
from core.calibrate.dense import factorise, inverse_of_factor, solve_factor
from core.calibrate.equations import Equations
from core.calibrate.normals import Factor, Inverse, Normals, factors_of_blocks
from core.calibrate.problem import Problem, State, Step

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Reduced:
    """Factor and right-hand side for z; what gives x from z: factors L of N, ``L⁻¹B``, ``L⁻¹F``, ``L⁻¹b``; V, T."""

    factor: Factor
    right: Array
    lower: Array
    root: Array
    bound: Array
    half: Array
    V: Array
    T: Array
    misclosure: Array


def _constraints(problem: Problem, state: State, equations: Equations) -> tuple[Array, Array, Array]:
    """F, shape (n, 3, k), the diagonal of E, shape (k,), and h, shape (k,)."""
    D = datum_columns(state.xyz, problem.defect)
    slack, h = np.zeros(problem.defect), np.zeros(problem.defect)
    if problem.scale is not None:
        row = np.zeros((problem.points, 3))
        row[problem.scale.start], row[problem.scale.stop] = equations.J_scale, -equations.J_scale
        D = np.column_stack([D, row.ravel()])
        slack, h = np.append(slack, 1.0), np.append(h, equations.w_scale)
    return D.reshape(problem.points, 3, -1), slack, h


def _reduce(problem: Problem, state: State, equations: Equations, normals: Normals, damping: float) -> _Reduced:
    lower = factors_of_blocks(normals.N_own, damping)
    F, slack, h = _constraints(problem, state, equations)
    n, U = problem.points, len(normals.b)
    root, bound, half = (
        np.linalg.solve(lower, right).astype(np.float64, copy=False).reshape(3 * n, -1)
        for right in (normals.N_mixed, F, normals.b_own[..., None])
    )
    half = half[:, 0]
    V, T = bound.T @ bound + np.diag(slack), root.T @ bound
    misclosure = bound.T @ half - h
    M = normals.N - root.T @ root + T @ np.linalg.solve(V, T.T)
    M[np.diag_indices(U)] += damping * np.diagonal(normals.N)
    right = normals.b - root.T @ half + T @ np.linalg.solve(V, misclosure)
    return _Reduced(factorise(M), right, lower, root, bound, half, V, T, misclosure)


def solve(problem: Problem, state: State, equations: Equations, normals: Normals, damping: float) -> Step:
    """One step of the adjustment, under the inner constraints.

    Raises
    ------
    SingularNormalsError
    """
    r = _reduce(problem, state, equations, normals, damping)
    dz = solve_factor(r.factor, r.right)
    multipliers = np.linalg.solve(r.V, r.misclosure - r.T.T @ dz)
    whitened = (r.half - r.root @ dz - r.bound @ multipliers).reshape(-1, 3, 1)
    dx = np.asarray(np.linalg.solve(r.lower.transpose(0, 2, 1), whitened)[..., 0], dtype=np.float64)
    gain = float(normals.b @ dz + np.sum(normals.b_own * dx))
    if problem.scale is not None:
        gain += equations.w_scale * float(equations.J_scale @ (dx[problem.scale.start] - dx[problem.scale.stop]))
    G = problem.globals
    return Step(dz[:G], dz[G:].reshape(-1, 6), dx, gain)


def invert(problem: Problem, state: State, equations: Equations, normals: Normals) -> Inverse:
    """Cofactors of all unknowns in the free network of least trace.

    Raises
    ------
    SingularNormalsError
    """
    r = _reduce(problem, state, equations, normals, 0.0)
    Q, G, n = inverse_of_factor(r.factor), problem.globals, problem.points
    back = np.linalg.inv(r.lower).transpose(0, 2, 1)
    C = back @ (r.root - r.bound @ np.linalg.solve(r.V, r.T.T)).reshape(n, 3, -1)
    bound = back @ r.bound.reshape(n, 3, -1)
    Q_own = back @ back.transpose(0, 2, 1) - bound @ np.linalg.solve(r.V, bound.transpose(0, 2, 1))
    strength = 1.0 / (np.diagonal(Q)[:G] * np.diagonal(normals.N)[:G])
    return Inverse(Q, C, Q_own, strength)
