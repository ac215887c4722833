"""Solving and inverting the normal equations, by the elimination that suits the network.

Where the covariances are wanted, the poses are eliminated: what remains are the globals and the points, however many
stations there are. The reduced system holds the covariances of all that matters, and the inner constraints join it
directly.

To find the solution, and in networks of very many points, these are eliminated, for they have more unknowns: what
remains are the globals and the poses. The inner constraints and the measured distance bind the points. They join the
elimination as Lagrange multipliers::

    | N   B   F | | dx |   | b |        x: points (block diagonal N)     F = (D, e): constraints' columns, distance
    | Bᵀ  M   0 | | dz | = | g |        z: globals and poses             E = diag(0 ... 0, 1): the distance may be off
    | Fᵀ  0  -E | | l  |   | h |

and with ``T = BᵀN⁻¹F`` and ``V = FᵀN⁻¹F + E`` the system that remains for z is positive definite::

    (M - BᵀN⁻¹B + T V⁻¹ Tᵀ) dz = g - BᵀN⁻¹b + T V⁻¹ (FᵀN⁻¹b - h)
"""

from __future__ import annotations

import numpy as np

from core.calibrate.solution.datum import datum_columns, null_space
from core.calibrate.solution.equations import distance_equation
from core.calibrate.solution.normals import (
    Factor,
    Inverse,
    Normals,
    assemble,
    factorise,
    inverse_of_factor,
    solve_factor,
)
from core.calibrate.solution.problem import Problem
from core.calibrate.solution.state import State, Step
from core.lazy import dataclass
from core.model import Array


@dataclass(frozen=True)
class WithoutPoses:
    """The reduced system made regular by the datum, whose constraints D, shape (U, defect), weigh kappa each."""

    state: State
    normals: Normals
    factor: Factor
    right: Array
    b: Array
    D: Array
    kappa: float

    def solve(self, problem: Problem) -> Step:
        """One step of the adjustment, under the inner constraints."""
        normals, G = self.normals, problem.globals
        dz = solve_factor(self.factor, self.right)
        dp, gain = _eliminated(normals, normals.half - normals.root @ dz)
        return Step(dz[:G], dp, dz[G:].reshape(-1, 3), float(self.b @ dz) + gain)

    def invert(self, problem: Problem) -> Inverse:
        """Cofactors of all unknowns in the free network of least trace.

        With D the constraints' columns (points only) and H the null space of the reduced normals N (in a rigid rig
        without measured distance its scale column reaches the relative orientations too)::

            Q = (N + κDDᵀ)⁻¹ - κ⁻¹ H (DᵀH)⁻¹ (HᵀD)⁻¹ Hᵀ

        which is the usual ``(N + κDDᵀ)⁻¹ - κ⁻¹ D (DᵀD)⁻² Dᵀ`` where H = D.
        """
        normals, G = self.normals, problem.globals
        Q = inverse_of_factor(self.factor)
        if problem.defect:
            H = null_space(problem, self.state)
            K = np.linalg.solve((self.D.T @ H[G:]).T, H.T)
            Q -= (K.T @ K) / self.kappa
        back = np.linalg.inv(normals.lower).transpose(0, 2, 1)
        return Inverse(Q, back @ normals.root, back @ back.transpose(0, 2, 1), _strength(Q, normals, G))


@dataclass(frozen=True)
class WithoutPoints:
    """Factor and right-hand side for z, and what gives x from z: the normals at a state, ``L⁻¹F``, V, T."""

    state: State
    normals: Normals
    factor: Factor
    right: Array
    bound: Array
    V: Array
    T: Array
    misclosure: Array

    def solve(self, problem: Problem) -> Step:
        """One step of the adjustment, under the inner constraints."""
        normals, G = self.normals, problem.globals
        dz = solve_factor(self.factor, self.right)
        multipliers = np.linalg.solve(self.V, self.misclosure - self.T.T @ dz)
        whitened = normals.half - normals.root @ dz - (self.bound @ multipliers).reshape(-1, 3)
        dx, own = _eliminated(normals, whitened)
        gain = float(normals.b @ dz) + own
        for distance in problem.distances:
            w, J = distance_equation(distance, self.state)
            gain += w * float(J @ (dx[distance.start] - dx[distance.stop]))
        return Step(dz[:G], dz[G:].reshape(-1, 6), dx, gain)

    def invert(self, problem: Problem) -> Inverse:
        """Cofactors of all unknowns in the free network of least trace."""
        normals, V, n = self.normals, self.V, problem.points
        Q, G = inverse_of_factor(self.factor), problem.globals
        back = np.linalg.inv(normals.lower).transpose(0, 2, 1)
        C = back @ (normals.root - (self.bound @ np.linalg.solve(V, self.T.T)).reshape(n, 3, -1))
        bound = back @ self.bound.reshape(n, 3, -1)
        Q_own = back @ back.transpose(0, 2, 1) - bound @ np.linalg.solve(V, bound.transpose(0, 2, 1))
        return Inverse(Q, C, Q_own, _strength(Q, normals, G))


def _eliminated(normals: Normals, whitened: Array) -> tuple[Array, float]:
    """Unknowns that were eliminated, from L⁻¹ times what is left for them, and their part of a step's gain."""
    dx = np.asarray(np.linalg.solve(normals.lower.transpose(0, 2, 1), whitened[..., None])[..., 0], np.float64)
    # their right-hand side is L half
    return dx, float(np.einsum("est,et,es->", normals.lower, normals.half, dx))


def _strength(Q: Array, normals: Normals, count: int) -> Array:
    """How well each of the globals is known, as a part of how well it would be if all else were."""
    return np.asarray(1.0 / (np.diagonal(Q)[:count] * normals.diagonal[:count]))


Reduced = WithoutPoses | WithoutPoints


def reduce(problem: Problem, state: State, damping: float = 0.0, normals: Normals | None = None) -> Reduced:
    """Normal equations at a state, reduced, given their datum and factorised.

    All diagonals are multiplied by 1 + damping (Levenberg, Marquardt). `normals` are what `assemble` gives with that
    damping, where the caller has changed it; they are overwritten. Only an undamped system may be inverted.
    """
    method = _without_points if problem.by_points else _without_poses
    return method(problem, state, normals or assemble(problem, state, damping), damping)


def _without_poses(problem: Problem, state: State, normals: Normals, damping: float) -> WithoutPoses:
    """Add measured distance, damping and datum to the reduced normals, which are overwritten, and factorise them."""
    M, right, b, diagonal = normals.M, normals.right.copy(), normals.b.copy(), normals.diagonal.copy()
    G, n = problem.globals, problem.points
    for distance in problem.distances if n else ():
        w, J = distance_equation(distance, state)
        at = np.concatenate([G + 3 * end + np.arange(3) for end in (distance.start, distance.stop)])
        row = np.concatenate([J, -J])
        M[np.ix_(at, at)] += np.outer(row, row)
        diagonal[at] += row**2
        right[at] += row * w
        b[at] += row * w
    M[np.diag_indices(len(b))] += damping * diagonal
    # the mean weight of a point's coordinate
    kappa = float(np.median(normals.diagonal[G:])) if n else 0.0
    D = datum_columns(state.xyz, problem.free_movements) if n else np.zeros((0, 0))
    M[G:, G:] += (kappa * D) @ D.T
    return WithoutPoses(state, normals, factorise(M), right, b, D, kappa)


def _without_points(problem: Problem, state: State, normals: Normals, damping: float) -> WithoutPoints:
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
    return WithoutPoints(state, normals, factorise(M), right, bound, V, T, misclosure)


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
