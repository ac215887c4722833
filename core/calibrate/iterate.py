"""Gauss-Newton iterations to the least-squares solution, damped only where an undamped step does not help."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.calibrate.equations import Equations, linearise
from core.calibrate.normals import SingularNormalsError, solve
from core.calibrate.problem import Problem, State, Step, moved
from core.errors import AdjustmentError
from core.progress import SILENT, Progress

ROUNDING_GAIN = 1e-18  # a decrease of vᵀPv below this is rounding, even for observations without noise


@dataclass(frozen=True)
class Solution:
    """Where the iterations ended: the state, its equations and vᵀPv at every iteration."""

    state: State
    equations: Equations
    convergence: tuple[float, ...]

    @property
    def iterations(self) -> int:
        """Number of iterations."""
        return len(self.convergence) - 1


def iterate(
    problem: Problem,
    state: State,
    *,
    max_iterations: int = 60,
    tolerance: float = 1e-5,
    progress: Progress = SILENT,
) -> Solution:
    """Iterate from approximate values to the least-squares solution.

    Every step keeps the inner constraints. The last one is undamped and shorter than `tolerance` sigmas.

    Raises
    ------
    AdjustmentError
        If it does not converge.
    SingularNormalsError
        If the observations do not determine the unknowns.
    """
    equations = linearise(problem, state)
    convergence = [equations.cost]
    damping = 0.0
    for iteration in range(max_iterations):
        progress(iteration / max_iterations, f"iteration {iteration + 1}")
        step, damping = _solvable_step(problem, state, equations, damping)
        trial = moved(problem, state, step)
        trial_equations = linearise(problem, trial)
        limit = tolerance**2 * equations.cost / max(problem.redundancy, 1)
        if damping == 0 and step.gain <= max(limit, ROUNDING_GAIN):
            if trial_equations.cost <= equations.cost * (1 + 1e-9) + ROUNDING_GAIN:
                state, equations = trial, trial_equations
            return Solution(state, equations, (*convergence, equations.cost))
        if trial_equations.cost < equations.cost and _plausible(trial):
            state, equations = trial, trial_equations
            damping = damping / 10 if damping > 1e-5 else 0.0
        else:
            damping = max(10 * damping, 1e-4)
        convergence.append(equations.cost)
        if damping > 1e12:
            break
    raise AdjustmentError(
        "the adjustment",
        f"does not converge: after {len(convergence) - 1} iterations the weighted sum of squares is "
        f"{convergence[-1]:.4g} (from {convergence[0]:.4g})",
        "check the nominal focal lengths, the approximate points and the identities of the observed points",
    )


def _solvable_step(problem: Problem, state: State, equations: Equations, damping: float) -> tuple[Step, float]:
    """Step, with damping raised until the normals can be factorised far from the solution."""
    for attempt in (damping, max(damping, 1e-3)):
        try:
            return solve(problem, state, equations, attempt), attempt
        except SingularNormalsError:
            if attempt > 0 and attempt == max(damping, 1e-3):
                raise
    raise AssertionError("the last attempt returns or raises")


def _plausible(state: State) -> bool:
    """Whether no focal length has run through zero."""
    return bool(np.all(state.interior[:, 0] > 0))
