"""The poses eliminated: what remains are the globals and the points, however many stations there are.

The reduced system holds the covariances of all that matters, and the inner constraints join it directly.
"""

from __future__ import annotations

import numpy as np

from core.calibrate.datum import datum_columns, null_space
from core.calibrate.equations import distance_equation
from core.calibrate.normals import Factor, Inverse, Normals, factorise, inverse_of_factor, solve_factor
from core.calibrate.problem import Problem
from core.calibrate.state import State, Step
from core.lazy import dataclass
from core.model import Array


@dataclass(frozen=True)
class Reduced:
    """The reduced system made regular by the datum, whose constraints D, shape (U, defect), weigh kappa each."""

    state: State
    normals: Normals
    factor: Factor
    right: Array
    b: Array
    D: Array
    kappa: float


def reduce(problem: Problem, state: State, normals: Normals, damping: float) -> Reduced:
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
    return Reduced(state, normals, factorise(M), right, b, D, kappa)


def solve(problem: Problem, reduced: Reduced) -> Step:
    """One step of the adjustment, under the inner constraints."""
    normals, G = reduced.normals, problem.globals
    dz = solve_factor(reduced.factor, reduced.right)
    whitened = normals.half - normals.root @ dz
    dp = np.linalg.solve(normals.lower.transpose(0, 2, 1), whitened[..., None])[..., 0]
    # whose right-hand side is L half
    gain = float(reduced.b @ dz) + float(np.einsum("est,et,es->", normals.lower, normals.half, dp))
    return Step(dz[:G], np.asarray(dp, dtype=np.float64), dz[G:].reshape(-1, 3), gain)


def invert(problem: Problem, reduced: Reduced) -> Inverse:
    """Cofactors of all unknowns in the free network of least trace.

    With D the constraints' columns (points only) and H the null space of the reduced normals N (in a rigid rig without
    measured distance its scale column reaches the relative orientations too)::

        Q = (N + κDDᵀ)⁻¹ - κ⁻¹ H (DᵀH)⁻¹ (HᵀD)⁻¹ Hᵀ

    which is the usual ``(N + κDDᵀ)⁻¹ - κ⁻¹ D (DᵀD)⁻² Dᵀ`` where H = D.
    """
    normals, G = reduced.normals, problem.globals
    Q = inverse_of_factor(reduced.factor)
    if problem.defect:
        H = null_space(problem, reduced.state)
        K = np.linalg.solve((reduced.D.T @ H[G:]).T, H.T)
        Q -= (K.T @ K) / reduced.kappa
    back = np.linalg.inv(normals.lower).transpose(0, 2, 1)
    strength = 1.0 / (np.diagonal(Q)[:G] * normals.diagonal[:G])
    return Inverse(Q, back @ normals.root, back @ back.transpose(0, 2, 1), strength)
