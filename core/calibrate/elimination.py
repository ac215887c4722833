"""Solving and inverting the normal equations, by the elimination that suits the network."""

from __future__ import annotations

from core.calibrate import by_points, by_poses
from core.calibrate.normals import Inverse, Normals, assemble
from core.calibrate.problem import Problem
from core.calibrate.state import State, Step

Reduced = by_points.Reduced | by_poses.Reduced


def reduce(problem: Problem, state: State, damping: float = 0.0, normals: Normals | None = None) -> Reduced:
    """Normal equations at a state, reduced, given their datum and factorised.

    All diagonals are multiplied by 1 + damping (Levenberg, Marquardt). `normals` are what `assemble` gives with that
    damping, where the caller has changed it; they are overwritten.
    """
    method = by_points if problem.by_points else by_poses
    return method.reduce(problem, state, normals or assemble(problem, state, damping), damping)


def solve(problem: Problem, reduced: Reduced) -> Step:
    """One step of the adjustment, under the inner constraints."""
    if isinstance(reduced, by_points.Reduced):
        return by_points.solve(problem, reduced)
    return by_poses.solve(problem, reduced)


def invert(problem: Problem, reduced: Reduced) -> Inverse:
    """Cofactors of all unknowns in the free network of least trace; the reduced system is undamped."""
    if isinstance(reduced, by_points.Reduced):
        return by_points.invert(problem, reduced)
    return by_poses.invert(problem, reduced)
