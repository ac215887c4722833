"""Normal equations by blocks with the poses eliminated: what remains are the global unknowns and the points.

The reduced system stays at the size of the globals and three times the points, however many stations there are.
Its inverse holds the covariances of all that matters, and the inner constraints join it directly.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock

import numpy as np
import scipy.linalg as sla
from numba import njit
from numpy.typing import NDArray

from core.calibrate.datum import datum_columns, null_space
from core.calibrate.equations import Equations
from core.calibrate.problem import Problem, State, Step
from core.parallel import run_in_bands

Array = NDArray[np.float64]


class SingularNormalsError(Exception):
    """The normal equations cannot be solved; `pose` is the culprit, or `direction` in the reduced unknowns."""

    def __init__(self, pose: int | None = None, direction: Array | None = None) -> None:
        super().__init__(pose, direction)
        self.pose, self.direction = pose, direction


@dataclass(frozen=True)
class Normals:
    """Blocks of the normal equations; the reduced unknowns are the globals, then the points' coordinates.

    Attributes
    ----------
    N : array, shape (U, U)
        Globals and points before the poses are eliminated, the measured distance included.
    b : array, shape (U,)
    N_pose, N_mixed : arrays, shape (P, 6, 6) and (P, 6, U)
    b_pose : array, shape (P, 6)
    """

    N: Array
    b: Array
    N_pose: Array
    N_mixed: Array
    b_pose: Array


@njit(cache=True, nogil=True)
def _accumulate_band(  # pragma: no cover  compiled
    start: int,
    stop: int,
    first: NDArray[np.int64],
    device: NDArray[np.int64],
    point: NDArray[np.int64],
    columns: NDArray[np.int64],
    points_free: bool,
    w: Array,
    J: Array,
    N_pose: Array,
    N_mixed: Array,
    b_pose: Array,
    N_global: Array,
    N_point: Array,
    b: Array,
) -> None:
    G = N_global.shape[0]
    local, place = np.empty(15, np.int64), np.empty(15, np.int64)
    for p in range(start, stop):
        for o in range(first[p], first[p + 1]):
            i, k = point[o], 0
            for j in range(15):
                if columns[device[o], j] >= 0:
                    local[k], place[k] = j, columns[device[o], j]
                    k += 1
            for a in range(2):
                row, misclosure = J[o, a], w[o, a]
                for s in range(k):
                    value = row[local[s]]
                    b[place[s]] += value * misclosure
                    for t in range(k):
                        N_global[place[s], place[t]] += value * row[local[t]]
                for s in range(6):
                    value = row[15 + s]
                    b_pose[p, s] += value * misclosure
                    for t in range(6):
                        N_pose[p, s, t] += value * row[15 + t]
                    for t in range(k):
                        N_mixed[p, s, place[t]] += value * row[local[t]]
                if points_free:
                    at = G + 3 * i
                    for s in range(3):
                        value = row[21 + s]
                        b[at + s] += value * misclosure
                        for t in range(3):
                            N_point[i, s, t] += value * row[21 + t]
                        for t in range(k):
                            N_global[place[t], at + s] += value * row[local[t]]
                        for t in range(6):
                            N_mixed[p, t, at + s] += value * row[15 + t]


def assemble(problem: Problem, equations: Equations) -> Normals:
    """Add up the normal equations, bands of poses on threads."""
    P, G, n = problem.poses, problem.globals, problem.points
    U = G + 3 * n
    N_pose, N_mixed, b_pose = np.zeros((P, 6, 6)), np.zeros((P, 6, U)), np.zeros((P, 6))
    N_global, N_point, b = np.zeros((G, U)), np.zeros((n, 3, 3)), np.zeros(U)
    lock = Lock()

    def band(start: int, stop: int) -> None:
        parts = np.zeros((G, U)), np.zeros((n, 3, 3)), np.zeros(U)
        _accumulate_band(
            start,
            stop,
            problem.first,
            problem.device,
            problem.point,
            problem.columns,
            problem.points_free,
            equations.w,
            equations.J,
            N_pose,
            N_mixed,
            b_pose,
            *parts,
        )
        with lock:
            for whole, part in zip((N_global, N_point, b), parts, strict=True):
                whole += part

    run_in_bands(band, P, least=max(1, 4096 * P // max(len(problem.point), 1)))  # threads pay from some 8000 points
    N = np.zeros((U, U))
    N[:G], N[G:, :G] = N_global, N_global[:, G:].T
    at = G + 3 * np.arange(n)
    for s in range(3):
        for t in range(3):
            N[at + s, at + t] = N_point[:, s, t]
    if problem.scale is not None and n:
        row = np.zeros(U)
        row[G + 3 * problem.scale.start :][:3] = equations.J_scale
        row[G + 3 * problem.scale.stop :][:3] = -equations.J_scale
        used = np.flatnonzero(row)
        N[np.ix_(used, used)] += np.outer(row[used], row[used])
        b[used] += row[used] * equations.w_scale
    return Normals(N, b, N_pose, N_mixed, b_pose)


@dataclass(frozen=True)
class Reduced:
    """The reduced system made regular by the datum, factorised.

    Attributes
    ----------
    factor : array, shape (U, U)
        Lower Cholesky factor of ``D (N - N_mixedᵀ N_pose⁻¹ N_mixed + κGGᵀ) D``.
    scale : array, shape (U,)
        The diagonal of D, which makes the system's diagonal 1.
    lower : array, shape (P, 6, 6)
        Cholesky factors of the poses' blocks.
    b : array, shape (U,)
        Reduced right-hand side.
    """

    factor: Array
    scale: Array
    lower: Array
    b: Array


def reduce(problem: Problem, state: State, normals: Normals, damping: float = 0.0) -> Reduced:
    """Eliminate the poses, add the datum and factorise.

    `damping` multiplies all diagonals by 1 + damping (Levenberg-Marquardt).

    Raises
    ------
    SingularNormalsError
        Naming the pose, or the direction of the reduced unknowns, that the observations do not determine.
    """
    N_pose = normals.N_pose + damping * np.einsum("pij,ij->pij", normals.N_pose, np.eye(6))
    try:
        lower = np.linalg.cholesky(N_pose)
    except np.linalg.LinAlgError:
        worst = [np.linalg.cond(block) for block in N_pose]
        raise SingularNormalsError(pose=int(np.argmax(worst))) from None
    U, P = len(normals.b), len(lower)
    root = np.linalg.solve(lower, normals.N_mixed).reshape(6 * P, U)
    M = normals.N - root.T @ root
    b = normals.b - root.T @ np.linalg.solve(lower, normals.b_pose[..., None]).reshape(6 * P)
    M[np.diag_indices(U)] += damping * np.diagonal(normals.N)
    if problem.points_free and U:
        G, n = problem.globals, problem.points
        D = datum_columns(state.xyz, problem.defect)
        M[G:, G:] += np.trace(normals.N[G:, G:]) / (3 * n) * (D @ D.T)
    diagonal = np.diagonal(M)
    if not np.all(diagonal > 0):
        raise SingularNormalsError(direction=(diagonal <= 0).astype(float))
    scale = 1.0 / np.sqrt(diagonal)
    M *= scale
    M *= scale[:, None]
    try:
        factor = sla.cholesky(M, lower=True, check_finite=False)
    except np.linalg.LinAlgError:
        raise SingularNormalsError(direction=np.linalg.eigh(M)[1][:, 0] * scale) from None
    return Reduced(factor, scale, lower, b)


def solve(problem: Problem, state: State, equations: Equations, damping: float = 0.0) -> Step:
    """One step of the adjustment, under the inner constraints.

    Raises
    ------
    SingularNormalsError
    """
    return solve_normals(problem, state, assemble(problem, equations), damping)


def solve_normals(problem: Problem, state: State, normals: Normals, damping: float = 0.0) -> Step:
    """Solve assembled normal equations.

    Raises
    ------
    SingularNormalsError
    """
    reduced = reduce(problem, state, normals, damping)
    dz = reduced.scale * sla.cho_solve((reduced.factor, True), reduced.scale * reduced.b, check_finite=False)
    right = normals.b_pose - np.einsum("piu,u->pi", normals.N_mixed, dz)
    half = np.linalg.solve(reduced.lower, right[..., None])
    dp = np.linalg.solve(reduced.lower.transpose(0, 2, 1), half)[..., 0]
    gain = float(normals.b @ dz + np.sum(normals.b_pose * dp))
    G = problem.globals
    return Step(dz[:G], np.asarray(dp, dtype=np.float64), dz[G:].reshape(-1, 3), gain)


@dataclass(frozen=True)
class Inverse:
    """Cofactors after the last step (unscaled: multiply by sigma0²).

    Attributes
    ----------
    Q : array, shape (U, U)
        Of the globals and points under the inner constraints.
    C : array, shape (P, 6, U)
        ``N_pose⁻¹ N_mixed``: a change dz of the reduced unknowns moves the poses by ``-C dz``.
    Q_own : array, shape (P, 6, 6)
        ``N_pose⁻¹``: the poses' cofactors were the reduced unknowns known.
    strength : array, shape (globals,)
        ``1 / (Q_ii N_ii)``: 1 where a parameter is independent of all others, near 0 where it cannot be told from them.
    """

    Q: Array
    C: Array
    Q_own: Array
    strength: Array


def invert(problem: Problem, state: State, equations: Equations) -> Inverse:
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
    normals = assemble(problem, equations)
    reduced = reduce(problem, state, normals)
    Q, info = sla.lapack.dpotri(reduced.factor, lower=1, overwrite_c=1)
    assert info == 0, "the factor has no zero on its diagonal"
    Q = np.tril(Q) + np.tril(Q, -1).T
    Q *= reduced.scale
    Q *= reduced.scale[:, None]
    G, n = problem.globals, problem.points
    if problem.defect:
        D, H = datum_columns(state.xyz, problem.defect), null_space(problem, state)
        K = np.linalg.solve((D.T @ H[G:]).T, H.T)
        Q -= 3 * n / np.trace(normals.N[G:, G:]) * (K.T @ K)
    half = np.linalg.inv(reduced.lower)
    Q_own = half.transpose(0, 2, 1) @ half
    strength = 1.0 / (np.diagonal(Q)[:G] * np.diagonal(normals.N)[:G])
    return Inverse(Q, Q_own @ normals.N_mixed, Q_own, strength)
