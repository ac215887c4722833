"""Gauss-Newton iterations to the least-squares solution, damped only where an undamped step does not help."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.calibrate.elimination import solve
from core.calibrate.equations import Equations, linearise
from core.calibrate.normals import SingularNormalsError
from core.calibrate.problem import Problem, State, Step, moved
from core.progress import SILENT, Progress

ROUNDING_GAIN = 1e-18  # a decrease of vᵀPv below this is rounding, even for observations without noise
SHORTEST = 1 / 100  # part of a step that is still tried
SHORTEST_WELCOME = 1 / 5  # a step that must be shortened more calls for damping
LEAST_DAMPING = 1e-8
ROUNDING_SHARE = 1e-13  # so is a decrease by this share of it, once it has been added up over all observations
ROUNDING_STALL = 1e-9  # and this, where no part of the step lowers it


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


class NotConvergedError(Exception):
    """The iterations ended without a solution; `solution` is where they stood."""

    def __init__(self, solution: Solution) -> None:
        super().__init__(solution)
        self.solution = solution


def iterate(
    problem: Problem,
    state: State,
    *,
    max_iterations: int = 60,
    tolerance: float = 1e-5,
    progress: Progress = SILENT,
) -> Solution:
    """Iterate from approximate values to the least-squares solution.

    Every step keeps the inner constraints. The last one is undamped and shorter than `tolerance` sigmas. The progress's
    course is told "sigma0" before every step and the step's length in sigmas, all unknowns together, as "correction".

    Raises
    ------
    NotConvergedError
    SingularNormalsError
        If the observations do not determine the unknowns.
    """
    equations = linearise(problem, state)
    convergence = [equations.cost]
    damping = 0.0
    for iteration in range(max_iterations):
        progress(iteration / max_iterations, f"iteration {iteration + 1}")
        step, damping = _solvable_step(problem, state, equations, damping)
        _tell(progress, iteration, problem, equations, step)
        limit = max(tolerance**2 / max(problem.redundancy, 1), ROUNDING_SHARE) * equations.cost
        last = damping == 0 and step.gain <= max(limit, ROUNDING_GAIN)
        share, trial, trial_equations = _shortened(problem, state, equations, step)
        # where vᵀPv no longer falls, all that is left to gain is the rounding of its own sum
        stalled = share == 0 and step.gain < ROUNDING_STALL * equations.cost
        last = last or (damping == 0 and stalled)
        if share > 0:
            state, equations = trial, trial_equations
        convergence.append(equations.cost)
        if last:
            return Solution(state, equations, tuple(convergence))
        if share == 1:
            damping = damping / 10 if damping > LEAST_DAMPING else 0.0
        elif stalled:
            damping = 0.0  # it had been called for by rounding: a step without any decides
        elif share < SHORTEST_WELCOME:
            damping = max(30 * damping, LEAST_DAMPING)
        if damping > 1e9:
            break
    raise NotConvergedError(Solution(state, equations, tuple(convergence)))


def _tell(progress: Progress, iteration: int, problem: Problem, equations: Equations, step: Step) -> None:
    variance = equations.cost / max(problem.redundancy, 1)
    progress.course("sigma0", iteration, variance**0.5)
    if variance > 0:
        progress.course("correction", iteration, (max(step.gain, 0.0) / variance) ** 0.5)


def _shortened(problem: Problem, state: State, equations: Equations, step: Step) -> tuple[float, State, Equations]:
    """Take a step, or the half, quarter ... of it that lowers vᵀPv; the share taken is 0 if none does."""
    share = 1.0
    while share > SHORTEST:
        part = Step(share * step.z, share * step.pose, share * step.xyz, step.gain)
        trial = moved(problem, state, part)
        if np.all(trial.interior[:, 0] > 0):  # no focal length runs through zero
            trial_equations = linearise(problem, trial)
            if trial_equations.cost < equations.cost:
                return share, trial, trial_equations
        share /= 2
    return 0.0, state, equations


def _solvable_step(problem: Problem, state: State, equations: Equations, damping: float) -> tuple[Step, float]:
    """Step, with damping raised until the normals can be factorised far from the solution."""
    try:
        return solve(problem, state, equations, damping), damping
    except SingularNormalsError:
        raised = max(100 * damping, 1e-4)
        return solve(problem, state, equations, raised), raised
