"""The points eliminated: what remains are the globals and the poses, for networks of very many points.

The inner constraints and the measured distance bind the points. They join the elimination as Lagrange multipliers::

    | N   B   F | | dx |   | b |        x: points (block diagonal N)     F = (D, e): constraints' columns, distance
    | Bᵀ  M   0 | | dz | = | g |        z: globals and poses             E = diag(0 ... 0, 1): the distance may be off
    | Fᵀ  0  -E | | l  |   | h |

and with ``T = BᵀN⁻¹F`` and ``V = FᵀN⁻¹F + E`` the system that remains for z is positive definite::

    (M - BᵀN⁻¹B + T V⁻¹ Tᵀ) dz = g - BᵀN⁻¹b + T V⁻¹ (FᵀN⁻¹b - h)
"""

from __future__ import annotations

import numpy as np

from core.calibrate.datum import datum_columns
from core.calibrate.equations import distance_equation
from core.calibrate.normals import Factor, Inverse, Normals, factorise, inverse_of_factor, solve_factor
from core.calibrate.problem import Problem
from core.calibrate.state import State, Step
from core.lazy import dataclass
from core.model import Array


@dataclass(frozen=True)
class Reduced:
    """Factor and right-hand side for z, and what gives x from z: the normals at a state, ``L⁻¹F``, V, T."""

    state: State
    normals: Normals
    factor: Factor
    right: Array
    bound: Array
    V: Array
    T: Array
    misclosure: Array


def reduce(problem: Problem, state: State, normals: Normals, damping: float) -> Reduced:
    """Add constraints and damping to the reduced normals, which are overwritten, and factorise them."""
    F, slack, h = _constraints(problem, state)
    U = len(normals.b)
    root, half = normals.root.reshape(-1, U), normals.half.ravel()
    bound = np.asarray(np.linalg.solve(normals.lower, F), dtype=np.float64).reshape(len(root), -1)
    V, T = bound.T @ bound + np.diag(slack), root.T @ bound
    misclosure = bound.T @ half - h
    M, right = normals.M, normals.right + T @ np.linalg.solve(V, misclosure)
    M += T @ np.linalg.solve(V, T.T)
    M[np.diag_indices(U)] += damping * normals.diagonal
    return Reduced(state, normals, factorise(M), right, bound, V, T, misclosure)


def _constraints(problem: Problem, state: State) -> tuple[Array, Array, Array]:
    """F, shape (n, 3, k), the diagonal of E, shape (k,), and h, shape (k,)."""
    D = datum_columns(state.xyz, problem.free_movements)
    slack, h = np.zeros(problem.defect), np.zeros(problem.defect)
    for distance in problem.distances:
        w, J = distance_equation(distance, state)
        row = np.zeros((problem.points, 3))
        row[distance.start], row[distance.stop] = J, -J
        D = np.column_stack([D, row.ravel()])
        slack, h = np.append(slack, 1.0), np.append(h, w)
    return D.reshape(problem.points, 3, -1), slack, h


def solve(problem: Problem, reduced: Reduced) -> Step:
    """One step of the adjustment, under the inner constraints."""
    r, normals = reduced, reduced.normals
    dz = solve_factor(r.factor, r.right)
    multipliers = np.linalg.solve(r.V, r.misclosure - r.T.T @ dz)
    whitened = normals.half - normals.root @ dz - (r.bound @ multipliers).reshape(-1, 3)
    dx = np.asarray(np.linalg.solve(normals.lower.transpose(0, 2, 1), whitened[..., None])[..., 0], dtype=np.float64)
    gain = float(normals.b @ dz) + float(np.einsum("est,et,es->", normals.lower, normals.half, dx))
    for distance in problem.distances:
        w, J = distance_equation(distance, r.state)
        gain += w * float(J @ (dx[distance.start] - dx[distance.stop]))
    G = problem.globals
    return Step(dz[:G], dz[G:].reshape(-1, 6), dx, gain)


def invert(problem: Problem, reduced: Reduced) -> Inverse:
    """Cofactors of all unknowns in the free network of least trace."""
    r, normals = reduced, reduced.normals
    Q, G, n = inverse_of_factor(r.factor), problem.globals, problem.points
    back = np.linalg.inv(normals.lower).transpose(0, 2, 1)
    C = back @ (normals.root - (r.bound @ np.linalg.solve(r.V, r.T.T)).reshape(n, 3, -1))
    bound = back @ r.bound.reshape(n, 3, -1)
    Q_own = back @ back.transpose(0, 2, 1) - bound @ np.linalg.solve(r.V, bound.transpose(0, 2, 1))
    strength = 1.0 / (np.diagonal(Q)[:G] * normals.diagonal[:G])
    return Inverse(Q, C, Q_own, strength)
