"""Solving and inverting the normal equations, by the elimination that suits the network."""

from __future__ import annotations

from core.calibrate import by_points, by_poses
from core.calibrate.equations import Equations
from core.calibrate.normals import Inverse, Normals, assemble
from core.calibrate.problem import Problem, State, Step


def solve(
    problem: Problem, state: State, equations: Equations, damping: float = 0.0, normals: Normals | None = None
) -> Step:
    """One step of the adjustment, under the inner constraints.

    Parameters
    ----------
    problem, state, equations
        The network, where its unknowns stand, and its linearised equations there.
    damping : float
        All diagonals are multiplied by 1 + damping (Levenberg, Marquardt).
    normals : Normals, optional
        The normal equations, where the caller has changed them.

    Raises
    ------
    SingularNormalsError
    """
    method = by_points if problem.by_points else by_poses
    return method.solve(problem, state, equations, normals or assemble(problem, equations), damping)


def invert(problem: Problem, state: State, equations: Equations) -> Inverse:
    """Cofactors of all unknowns in the free network of least trace.

    Raises
    ------
    SingularNormalsError
    """
    method = by_points if problem.by_points else by_poses
    return method.invert(problem, state, equations, assemble(problem, equations))
