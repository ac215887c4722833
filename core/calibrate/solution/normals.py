"""Normal equations by blocks: the globals, the eliminated unknowns and the kept ones.

Either the poses are eliminated (6 unknowns each) and the points kept (3 each), or the other way round; an eliminated
block meets no other, which is what makes it cheap to eliminate. One pass over the observations computes their
equations, adds them up and eliminates, so that no Jacobian is ever stored. The dense system that remains is factorised
by Cholesky's method, its diagonal scaled to 1.
"""

from __future__ import annotations

from threading import Lock
from typing import NamedTuple

import numpy as np

from core.calibrate.solution.equations import GLOBALS, POINT, POSE, equations_band, room_for_block
from core.calibrate.solution.problem import HELD_MM, RELATIVE, Observed, Problem
from core.calibrate.solution.state import State, Unknowns, unknowns_of
from core.compiling import inner, njit
from core.lazy import dataclass
from core.model import Array, Ints
from core.numerics import factor_of, inverse_by, solution_by
from core.parallel import run_in_bands


class SingularNormalsError(Exception):
    """The normal equations cannot be solved.

    `block` is the eliminated pose or point that is to blame, or `direction` the combination of kept unknowns.
    """

    def __init__(self, block: int | None = None, direction: Array | None = None) -> None:
        super().__init__(block, direction)
        self.block, self.direction = block, direction


class Layout(NamedTuple):
    """Where the Jacobian's columns of eliminated and kept unknowns begin, how many there are, and whose they are.

    `own` and `kept`, shape (m,), number each observation's eliminated and kept pose or point; `kept_count` of them are
    kept.
    """

    own_at: int
    own_width: int
    kept_at: int
    kept_width: int
    own: Ints
    kept: Ints
    kept_count: int


def layout_of(problem: Problem) -> Layout:
    """Give the layout for the elimination that the problem asks for."""
    if problem.by_points:
        return Layout(POINT, 3, POSE, 6, problem.point, problem.pose, problem.poses)
    return Layout(POSE, 6, POINT, 3, problem.pose, problem.point, problem.points)


def reduced_equations(problem: Problem, J: Array, C: Array, rows: Ints) -> Array:
    """Equations of some observations, shape (k, 2, U), by the kept unknowns, the eliminated ones following them."""
    layout, J = layout_of(problem), J[rows]
    A = -J[:, :, layout.own_at : layout.own_at + layout.own_width] @ C[layout.own[rows]]
    each, columns = np.arange(len(rows)), problem.columns[problem.device[rows]]
    for j in range(columns.shape[1]):
        use = columns[:, j] >= 0
        A[each[use], :, columns[use, j]] += J[use, :, GLOBALS + j]
    if layout.kept_count:
        for j in range(layout.kept_width):
            place = problem.globals + layout.kept_width * layout.kept[rows] + j
            A[each, :, place] += J[:, :, layout.kept_at + j]
    return np.asarray(A)


@dataclass(frozen=True)
class Normals:
    """Normal equations of the image observations, reduced to U kept unknowns, the globals first; E blocks eliminated.

    With N the kept unknowns' normals, ``L Lᵀ`` those of the eliminated ones and B what both share.
    """

    M: Array  #: ``N - Bᵀ(L Lᵀ)⁻¹B``
    right: Array  #: the reduced right-hand side
    #: diagonal, b: of N, and the right-hand side, before the elimination
    diagonal: Array
    b: Array
    lower: Array  #: L, its diagonal blocks
    root: Array  #: ``L⁻¹B``
    half: Array  #: L⁻¹ times the eliminated unknowns' right-hand side


@inner(error_model="numpy")
def _eliminate(L: Array, half: Array, root: Array, damping: float) -> bool:  # pragma: no cover  compiled
    """Turn one block's N, b and B into L, L⁻¹b and L⁻¹B in place; False where N is not positive definite."""
    width, U = root.shape
    for s in range(width):
        L[s, s] *= 1.0 + damping
    for s in range(width):
        for t in range(s):
            for r in range(t):
                L[s, t] -= L[s, r] * L[t, r]
            L[s, t] /= L[t, t]
            L[s, s] -= L[s, t] * L[s, t]
            L[t, s] = 0.0
        if not L[s, s] > 0.0:
            return False
        L[s, s] = np.sqrt(L[s, s])
    for s in range(width):
        for t in range(s):
            half[s] -= L[s, t] * half[t]
            for u in range(U):
                root[s, u] -= L[s, t] * root[t, u]
        half[s] /= L[s, s]
        for u in range(U):
            root[s, u] /= L[s, s]
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _normals_band(  # pragma: no cover  compiled
    start: int,
    stop: int,
    first: Ints,
    layout: Layout,
    columns: Ints,
    observed: Observed,
    unknowns: Unknowns,
    damping: float,
    lower: Array,
    root: Array,
    half: Array,
    w: Array,
    J: Array,
    N_global: Array,
    N_cross: Array,
    N_kept: Array,
    b: Array,
) -> int:
    """Normals of eliminated blocks start to stop - 1; returns the block that could not be eliminated, or -1.

    `w` and `J` have room for the equations of one block. Observations of one device and one block follow each other:
    what they share is added up in a small matrix S.
    """
    G, width, device = len(N_global), lower.shape[1], observed.device
    with_kept, kept, kept_at, kept_width = layout.kept_count > 0, layout.kept, layout.kept_at, layout.kept_width
    own_columns = columns.shape[1]
    most = own_columns + width
    local, place = np.empty(most, np.int64), np.empty(own_columns, np.int64)
    A, S, t = np.empty((2, most)), np.empty((most, most)), np.empty(most)
    for e in range(start, stop):
        equations_band(first[e], first[e + 1], observed, unknowns, w, J)
        o = first[e]
        while o < first[e + 1]:
            d, g = device[o], 0
            for j in range(own_columns):
                if columns[d, j] >= 0:
                    local[g], place[g] = GLOBALS + j, columns[d, j]
                    g += 1
            k = g + width
            for s in range(width):
                local[g + s] = layout.own_at + s
            for s in range(k):
                t[s] = 0.0
                for r in range(k):
                    S[s, r] = 0.0
            while o < first[e + 1] and device[o] == d:
                row = o - first[e]
                w0, w1 = w[row, 0], w[row, 1]
                if w0 < np.inf:
                    for s in range(k):
                        A[0, s], A[1, s] = J[row, 0, local[s]], J[row, 1, local[s]]
                    for s in range(k):
                        x, y = A[0, s], A[1, s]
                        t[s] += x * w0 + y * w1
                        for r in range(k):
                            S[s, r] += x * A[0, r] + y * A[1, r]
                    if with_kept:
                        i = kept[o]
                        at = G + kept_width * i
                        for s in range(kept_width):
                            x, y = J[row, 0, kept_at + s], J[row, 1, kept_at + s]
                            b[at + s] += x * w0 + y * w1
                            for r in range(kept_width):
                                N_kept[i, s, r] += x * J[row, 0, kept_at + r] + y * J[row, 1, kept_at + r]
                            for r in range(g):
                                N_cross[i, s, place[r]] += x * A[0, r] + y * A[1, r]
                            for r in range(width):
                                root[e, r, at + s] += x * A[0, g + r] + y * A[1, g + r]
                o += 1
            for s in range(g):
                b[place[s]] += t[s]
                for r in range(g):
                    N_global[place[s], place[r]] += S[s, r]
            for s in range(width):
                half[e, s] += t[g + s]
                for r in range(width):
                    lower[e, s, r] += S[g + s, g + r]
                for r in range(g):
                    root[e, s, place[r]] += S[g + s, r]
        if not _eliminate(lower[e], half[e], root[e], damping):
            return e
    return -1


def assemble(problem: Problem, state: State, damping: float = 0.0) -> Normals:
    """Add up the normal equations at a state and eliminate, bands of blocks on threads.

    The diagonals of the eliminated blocks are multiplied by 1 + damping. A SingularNormalsError names the block.
    """
    layout = layout_of(problem)
    E, G, n = len(problem.first) - 1, problem.globals, layout.kept_count
    width, kept_width = layout.own_width, layout.kept_width
    U = G + kept_width * n
    lower, root, half = np.zeros((E, width, width)), np.zeros((E, width, U)), np.zeros((E, width))
    M, right, b = np.zeros((U, U)), np.zeros(U), np.zeros(U)
    N_global, N_cross, N_kept = np.zeros((G, G)), np.zeros((n, kept_width, G)), np.zeros((n, kept_width, kept_width))
    observed, unknowns = problem.observed, unknowns_of(problem, state)
    if problem.points_free:
        _add_known_points(problem, state, lower, half, N_kept, b[G:])
    poses, at = N_kept if problem.by_points else lower, problem.held_places
    poses[at >= 0, at[at >= 0], at[at >= 0]] += HELD_MM**-2.0
    _add_known_interior(problem, state, N_global, b)
    lock = Lock()
    failed: list[int] = []

    def band(start: int, stop: int) -> None:
        parts = np.zeros_like(N_global), np.zeros_like(N_cross), np.zeros_like(N_kept), np.zeros_like(b)
        block = _normals_band(
            start,
            stop,
            problem.first,
            layout,
            problem.columns,
            observed,
            unknowns,
            damping,
            lower,
            root,
            half,
            *room_for_block(problem),
            *parts,
        )
        rows = root[start:stop].reshape(-1, U)
        own, own_right = rows.T @ rows, rows.T @ half[start:stop].reshape(-1)
        with lock:
            if block >= 0:
                failed.append(block)
            for whole, part in zip((N_global, N_cross, N_kept, b, M, right), (*parts, own, own_right), strict=True):
                whole += part

    # threads pay from some 8000 image points
    run_in_bands(band, E, least=max(1, 4096 * E // max(len(problem.point), 1)))
    if failed:
        raise SingularNormalsError(block=min(failed))
    diagonal = np.concatenate([np.diagonal(N_global), np.diagonal(N_kept, axis1=1, axis2=2).ravel()])
    np.negative(M, out=M)
    M[:G, :G] += N_global
    cross = N_cross.reshape(kept_width * n, G)
    M[G:, :G] += cross
    M[:G, G:] += cross.T
    at = G + kept_width * np.arange(n)[:, None] + np.arange(kept_width)
    M[at[:, :, None], at[:, None, :]] += N_kept
    return Normals(M, b - right, diagonal, b, lower, root, half)


def _add_known_points(problem: Problem, state: State, lower: Array, half: Array, kept: Array, b: Array) -> None:
    """Begin the points' normals with what is known of them."""
    if problem.point_weight.any():
        weight, axis = problem.point_weight, np.arange(3)
        right = weight * (problem.approximate - state.xyz)
        blocks = lower if problem.by_points else kept
        blocks[:, axis, axis] += weight
        if problem.by_points:
            half += right
        else:
            b += right.ravel()


def _add_known_interior(problem: Problem, state: State, N_global: Array, b: Array) -> None:
    """Begin the globals' normals with what is known of interior orientations."""
    places = problem.columns[:, RELATIVE:]
    use = (problem.interior_weight > 0) & (places >= 0)
    at, weight = places[use], problem.interior_weight[use]
    N_global[at, at] += weight
    b[at] += weight * (problem.interior_known - state.interior)[use]


@dataclass(frozen=True)
class Factor:
    """Cholesky factor (lower) of a symmetric matrix scaled to a diagonal of 1 by `scale`."""

    lower: Array
    scale: Array


@dataclass(frozen=True)
class Inverse:
    """Cofactors after the last step (unscaled: multiply by sigma0²)."""

    Q: Array  #: of the kept unknowns, the globals first
    C: Array  #: a change dz of the kept unknowns moves the eliminated ones by ``-C dz``
    Q_own: Array  #: cofactors of the eliminated blocks were the kept unknowns known
    #: ``1 / (Q_ii N_ii)``: 1 where a parameter is independent of all others, near 0 where it cannot be told from them
    strength: Array


def factorise(M: Array) -> Factor:
    """Factorise a symmetric positive definite matrix, (U, U), which is overwritten.

    A SingularNormalsError has the direction the matrix does not determine.
    """
    diagonal = np.diagonal(M).copy()
    if not np.all(diagonal > 0):
        raise SingularNormalsError(direction=(~(diagonal > 0)).astype(float))
    scale = 1.0 / np.sqrt(diagonal)
    M *= scale
    M *= scale[:, None]
    lower = factor_of(M)
    if lower is None:
        raise SingularNormalsError(direction=np.linalg.eigh(M)[1][:, 0] * scale)
    return Factor(lower, scale)


def solve_factor(factor: Factor, b: Array) -> Array:
    """Solve the factorised system for b, shape (U,)."""
    return factor.scale * solution_by(factor.lower, factor.scale * b)


def inverse_of_factor(factor: Factor) -> Array:
    """Inverse of the factorised matrix, shape (U, U)."""
    Q = inverse_by(factor.lower)
    Q *= factor.scale
    Q *= factor.scale[:, None]
    return Q
