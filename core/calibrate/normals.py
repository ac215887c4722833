"""Normal equations by blocks: the globals, the eliminated unknowns and the kept ones.

Either the poses are eliminated (6 unknowns each) and the points kept (3 each), or the other way round; an eliminated
block meets no other, which is what makes it cheap to eliminate.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from core.calibrate.equations import POINT, POSE, Equations
from core.calibrate.problem import Problem
from core.compiling import njit
from core.parallel import run_in_bands

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class SingularNormalsError(Exception):
    """The normal equations cannot be solved.

    `block` is the eliminated pose or point that is to blame, or `direction` the combination of kept unknowns.
    """

    def __init__(self, block: int | None = None, direction: Array | None = None) -> None:
        super().__init__(block, direction)
        self.block, self.direction = block, direction


@dataclass(frozen=True)
class Layout:
    """Where the Jacobian's columns of eliminated and kept unknowns begin, how many there are, and whose they are.

    `kept` has shape (m,); it numbers the pose or point whose unknowns stay in the system, `kept_count` of them.
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


@dataclass(frozen=True)
class Normals:
    """Blocks of the image observations' normal equations: U kept unknowns, the globals first, and E eliminated blocks.

    Attributes
    ----------
    N : array, shape (U, U)
        Kept unknowns, before the elimination.
    b : array, shape (U,)
    N_own, N_mixed : arrays, shape (E, w, w) and (E, w, U)
    b_own : array, shape (E, w)
    """

    N: Array
    b: Array
    N_own: Array
    N_mixed: Array
    b_own: Array


@njit(cache=True, nogil=True)
def _accumulate_band(  # pragma: no cover  compiled
    start: int,
    stop: int,
    first: Ints,
    device: Ints,
    kept: Ints,
    columns: Ints,
    own_at: int,
    kept_at: int,
    w: Array,
    J: Array,
    N_own: Array,
    N_mixed: Array,
    b_own: Array,
    N_global: Array,
    N_kept: Array,
    b: Array,
) -> None:
    G, width, kept_width = N_global.shape[0], N_own.shape[1], N_kept.shape[1]
    with_kept = N_kept.shape[0] > 0
    local, place = np.empty(15, np.int64), np.empty(15, np.int64)
    for e in range(start, stop):
        for o in range(first[e], first[e + 1]):
            i, k = kept[o], 0
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
                for s in range(width):
                    value = row[own_at + s]
                    b_own[e, s] += value * misclosure
                    for t in range(width):
                        N_own[e, s, t] += value * row[own_at + t]
                    for t in range(k):
                        N_mixed[e, s, place[t]] += value * row[local[t]]
                if with_kept:
                    at = G + kept_width * i
                    for s in range(kept_width):
                        value = row[kept_at + s]
                        b[at + s] += value * misclosure
                        for t in range(kept_width):
                            N_kept[i, s, t] += value * row[kept_at + t]
                        for t in range(k):
                            N_global[place[t], at + s] += value * row[local[t]]
                        for t in range(width):
                            N_mixed[e, t, at + s] += value * row[own_at + t]


def assemble(problem: Problem, equations: Equations) -> Normals:
    """Add up the normal equations, bands of eliminated blocks on threads."""
    layout = layout_of(problem)
    E, G, n, width, kept_width = (
        len(problem.first) - 1,
        problem.globals,
        layout.kept_count,
        layout.own_width,
        layout.kept_width,
    )
    U = G + kept_width * n
    N_own, N_mixed, b_own = np.zeros((E, width, width)), np.zeros((E, width, U)), np.zeros((E, width))
    N_global, N_kept, b = np.zeros((G, U)), np.zeros((n, kept_width, kept_width)), np.zeros(U)
    lock = Lock()

    def band(start: int, stop: int) -> None:
        parts = np.zeros_like(N_global), np.zeros_like(N_kept), np.zeros_like(b)
        _accumulate_band(
            start,
            stop,
            problem.first,
            problem.device,
            layout.kept,
            problem.columns,
            layout.own_at,
            layout.kept_at,
            equations.w,
            equations.J,
            N_own,
            N_mixed,
            b_own,
            *parts,
        )
        with lock:
            for whole, part in zip((N_global, N_kept, b), parts, strict=True):
                whole += part

    # threads pay from some 8000 image points
    run_in_bands(band, E, least=max(1, 4096 * E // max(len(problem.point), 1)))
    N = np.zeros((U, U))
    N[:G], N[G:, :G] = N_global, N_global[:, G:].T
    at = G + kept_width * np.arange(n)
    for s in range(kept_width):
        for t in range(kept_width):
            N[at + s, at + t] = N_kept[:, s, t]
    return Normals(N, b, N_own, N_mixed, b_own)


def factors_of_blocks(N_own: Array, damping: float) -> Array:
    """Lower Cholesky factors of the eliminated blocks, their diagonals multiplied by 1 + damping.

    Raises
    ------
    SingularNormalsError
        Naming the block.
    """
    damped = N_own + damping * N_own * np.eye(N_own.shape[1])
    try:
        return np.asarray(np.linalg.cholesky(damped), dtype=np.float64)
    except np.linalg.LinAlgError:
        with np.errstate(all="ignore"):
            worst = [np.linalg.cond(block) for block in damped]
        raise SingularNormalsError(block=int(np.argmax(worst))) from None


@dataclass(frozen=True)
class Factor:
    """Cholesky factor (lower) of a symmetric matrix scaled to a diagonal of 1 by `scale`."""

    lower: Array
    scale: Array


@dataclass(frozen=True)
class Inverse:
    """Cofactors after the last step (unscaled: multiply by sigma0²).

    Attributes
    ----------
    Q : array, shape (U, U)
        Of the kept unknowns, the globals first.
    C : array, shape (E, w, U)
        A change dz of the kept unknowns moves the eliminated ones by ``-C dz``.
    Q_own : array, shape (E, w, w)
        Cofactors of the eliminated blocks were the kept unknowns known.
    strength : array, shape (globals,)
        ``1 / (Q_ii N_ii)``: 1 where a parameter is independent of all others, near 0 where it cannot be told from them.
    """

    Q: Array
    C: Array
    Q_own: Array
    strength: Array
