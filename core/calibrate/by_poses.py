"""The poses eliminated: what remains are the globals and the points, however many stations there are.

The reduced system holds the covariances of all that matters, and the inner constraints join it directly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.calibrate.datum import datum_columns, null_space
from core.calibrate.dense import factorise, inverse_of_factor, solve_factor
from core.calibrate.equations import Equations
from core.calibrate.normals import Factor, Inverse, Normals, factors_of_blocks
from core.calibrate.problem import Problem, State, Step

Array = NDArray[np.float64]


def _with_distance(problem: Problem, equations: Equations, normals: Normals) -> tuple[Array, Array]:
    """Kept block and right-hand side with the measured distance added, as copies."""
    N, b = normals.N.copy(), normals.b.copy()
    if problem.scale is not None and problem.points:
        G = problem.globals
        at = np.concatenate([G + 3 * end + np.arange(3) for end in (problem.scale.start, problem.scale.stop)])
        row = np.concatenate([equations.J_scale, -equations.J_scale])
        N[np.ix_(at, at)] += np.outer(row, row)
        b[at] += row * equations.w_scale
    return N, b


def _kappa(problem: Problem, normals: Normals) -> float:
    """Weight of the inner constraints: the mean weight of a point's coordinate."""
    G = problem.globals
    return float(np.trace(normals.N[G:, G:])) / (3 * problem.points)


def _reduce(
    problem: Problem, state: State, equations: Equations, normals: Normals, damping: float
) -> tuple[Factor, Array, Array]:
    """Factor of the reduced system made regular by the datum, its right-hand side, and the poses' factors."""
    lower = factors_of_blocks(normals.N_own, damping)
    N, b = _with_distance(problem, equations, normals)
    U, P, G = len(b), len(lower), problem.globals
    root = np.linalg.solve(lower, normals.N_mixed).reshape(6 * P, U)
    M = N - root.T @ root
    b = b - root.T @ np.linalg.solve(lower, normals.b_own[..., None]).reshape(6 * P)
    M[np.diag_indices(U)] += damping * np.diagonal(N)
    if problem.points:
        D = datum_columns(state.xyz, problem.defect)
        M[G:, G:] += _kappa(problem, normals) * (D @ D.T)
    return factorise(M), b, lower


def solve(problem: Problem, state: State, equations: Equations, normals: Normals, damping: float) -> Step:
    """One step of the adjustment, under the inner constraints.

    Raises
    ------
    SingularNormalsError
    """
    factor, b, lower = _reduce(problem, state, equations, normals, damping)
    dz = solve_factor(factor, b)
    right = normals.b_own - normals.N_mixed @ dz
    half = np.linalg.solve(lower, right[..., None])
    dp = np.asarray(np.linalg.solve(lower.transpose(0, 2, 1), half)[..., 0], dtype=np.float64)
    gain = float(_with_distance(problem, equations, normals)[1] @ dz + np.sum(normals.b_own * dp))
    G = problem.globals
    return Step(dz[:G], dp, dz[G:].reshape(-1, 3), gain)


def invert(problem: Problem, state: State, equations: Equations, normals: Normals) -> Inverse:
    """Cofactors of all unknowns in the free network of least trace.

    Notes
    -----
    With D the constraints' columns (points only) and H the null space of the reduced normals N (in a rigid rig without
    measured distance its scale column reaches the relative orientations too)::

        Q = (N + κDDᵀ)⁻¹ - κ⁻¹ H (DᵀH)⁻¹ (HᵀD)⁻¹ Hᵀ

    which is the usual ``(N + κDDᵀ)⁻¹ - κ⁻¹ D (DᵀD)⁻² Dᵀ`` where H = D.

    Raises
    ------
    SingularNormalsError
    """
    factor, _, lower = _reduce(problem, state, equations, normals, 0.0)
    Q, G = inverse_of_factor(factor), problem.globals
    if problem.defect:
        D, H = datum_columns(state.xyz, problem.defect), null_space(problem, state)
        K = np.linalg.solve((D.T @ H[G:]).T, H.T)
        Q -= (K.T @ K) / _kappa(problem, normals)
    half = np.linalg.inv(lower)
    Q_own = half.transpose(0, 2, 1) @ half
    strength = 1.0 / (np.diagonal(Q)[:G] * np.diagonal(normals.N)[:G])
    return Inverse(Q, Q_own @ normals.N_mixed, Q_own, strength)
