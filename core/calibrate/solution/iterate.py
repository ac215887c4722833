"""Gauss-Newton iterations to the least-squares solution, damped only where an undamped step does not help."""

from __future__ import annotations

import numpy as np

from core.calibrate.solution.datum import aligned
from core.calibrate.solution.elimination import Reduced, WithoutPoints, reduce
from core.calibrate.solution.equations import cost_of
from core.calibrate.solution.normals import Inverse, SingularNormalsError
from core.calibrate.solution.problem import Problem, by_fewest
from core.calibrate.solution.state import State, Step, moved
from core.lazy import dataclass
from core.progress import SILENT, Progress

LEAST_CONTRACTION = 0.01  # ratio of two steps: what remains is not trusted to shrink faster than that
SLOW = 0.5  # ratio of two steps from which their length is looked for
ROUNDING = 1e-15  # of a coordinate: a decrease of vᵀPv by less than such errors make is none, even without noise
SHORTEST = 1 / 100  # part of a step that is still tried
SHORTEST_WELCOME = 1 / 5  # a step that must be shortened more calls for damping
LEAST_DAMPING = 1e-8
MOST_DAMPING = 1e9
ROUNDING_SHARE = 1e-13  # so is a decrease by this share of it, once it has been added up over all observations
REFUSED = 5  # steps that no part of lowers vᵀPv
STUCK = 1e-6  # share of it that as many iterations must win after that
ROUNDING_STALL = 1e-9  # and this, where no part of the step lowers it


@dataclass(frozen=True)
class Solution:
    """Where the iterations ended: the state, vᵀPv at every iteration, and the normals before the last, tiny step."""

    state: State
    convergence: tuple[float, ...]
    reduced: Reduced

    @property
    def cost(self) -> float:
        """vᵀPv."""
        return self.convergence[-1]

    def quickest(self, problem: Problem) -> Problem:
        """The same problem in the order of the elimination that the iterations took."""
        fewest = by_fewest(problem)
        return fewest if isinstance(self.reduced, WithoutPoints) == fewest.by_points else problem

    def invert(self, problem: Problem) -> Inverse:
        """Cofactors of all unknowns in the problem's own elimination, whichever the iterations took."""
        own = self.reduced if isinstance(self.reduced, WithoutPoints) == problem.by_points else None
        return (own or reduce(problem, self.reduced.state)).invert(problem)


class NotConvergedError(Exception):
    """The iterations ended without a solution: where they stood, and vᵀPv at every iteration."""

    def __init__(self, state: State, convergence: tuple[float, ...]) -> None:
        super().__init__(state, convergence)
        self.state, self.convergence = state, convergence


def iterate(
    problem: Problem, state: State, *, max_iterations: int = 60, tolerance: float = 1e-5, progress: Progress = SILENT
) -> Solution:
    """Iterate from approximate values to the least-squares solution.

    Every step keeps the inner constraints. The last one is undamped, and what remains after it is shorter than
    `tolerance` sigmas, judged by the ratio of the last two, or is lost in the rounding of vᵀPv. The progress's course
    is told "sigma0" before every step and the step's length in sigmas, all unknowns together, as "correction".
    NotConvergedError, or SingularNormalsError if the observations do not determine the unknowns.
    """
    state = aligned(problem, state)
    cost = cost_of(problem, state)
    quickest = by_fewest(problem)
    convergence = [cost]
    damping, before, refused = 0.0, 0.0, 0
    rounding = float(np.sum((ROUNDING * problem.uv * problem.root_weight) ** 2))
    for iteration in range(max_iterations):
        progress(iteration / max_iterations, f"iteration {iteration + 1}")
        try:
            reduced = reduce(quickest, state, damping)
        except SingularNormalsError:
            quickest = problem  # which of its unknowns are to blame
            reduced, damping = regular(problem, state, damping)
        step = reduced.solve(quickest)
        _tell(progress, iteration, problem, cost, step)
        ratio = min(step.gain / before, 1.0) if before > 0 else 1.0
        remaining = max(ratio, LEAST_CONTRACTION**2) * step.gain
        limit = max(tolerance**2 / max(problem.redundancy, 1), ROUNDING_SHARE) * cost
        last = damping == 0 and remaining <= max(limit, rounding)
        share, trial, trial_cost = shortened(problem, state, cost, step)
        # where vᵀPv no longer falls, all that is left to gain is the rounding of its own sum
        stalled = share == 0 and step.gain < ROUNDING_STALL * cost
        last = last or (damping == 0 and stalled)
        whole = share == 1 and damping == 0
        if whole and not last and SLOW**2 < ratio < 1:
            better = _relaxed(problem, state, cost, trial_cost, step)
            if better is not None:
                (trial, trial_cost), whole = better, False
        if share > 0:
            state, cost = aligned(problem, trial), trial_cost
        convergence.append(cost)
        if last:
            return Solution(state, tuple(convergence), reduced)
        before = step.gain if whole else 0.0
        # where rounding called for damping, a step without any decides
        damping = 0.0 if stalled else next_damping(damping, share)
        refused += share == 0
        if damping > MOST_DAMPING or (refused > REFUSED and convergence[-REFUSED] - cost < STUCK * cost):
            break
    raise NotConvergedError(state, tuple(convergence))


def _tell(progress: Progress, iteration: int, problem: Problem, cost: float, step: Step) -> None:
    variance = cost / max(problem.redundancy, 1)
    progress.course("sigma0", iteration, variance**0.5)
    if variance > 0:
        progress.course("correction", iteration, (max(step.gain, 0.0) / variance) ** 0.5)


def shortened(problem: Problem, state: State, cost: float, step: Step) -> tuple[float, State, float]:
    """Take a step, or the half, quarter ... of it that lowers vᵀPv; the share taken is 0 if none does."""
    share = 1.0
    while share > SHORTEST:
        part = Step(share * step.z, share * step.pose, share * step.xyz, step.gain)
        trial = moved(problem, state, part)
        if np.all(trial.interior[:, 0] > 0):  # no focal length runs through zero
            trial_cost = cost_of(problem, trial)
            if trial_cost < cost:
                return share, trial, trial_cost
        share /= 2
    return 0.0, state, cost


def _relaxed(problem: Problem, state: State, cost: float, whole: float, step: Step) -> tuple[State, float] | None:
    """Take a step as far as vᵀPv falls, by a parabola through what it is without and with the whole step.

    Large residuals that no parameter explains bend vᵀPv otherwise than the linear model: whole steps go too far, or not
    far enough, again and again.
    """
    bend = whole - cost + 2 * step.gain
    share = min(max(step.gain / bend, 0.3), 10.0) if bend > 0 else 10.0
    trial = moved(problem, state, Step(share * step.z, share * step.pose, share * step.xyz, step.gain))
    if not np.all(trial.interior[:, 0] > 0):
        return None
    trial_cost = cost_of(problem, trial)
    return (trial, trial_cost) if trial_cost < whole else None


def regular(problem: Problem, state: State, damping: float) -> tuple[Reduced, float]:
    """Reduced normals, with damping raised until they can be factorised far from the solution."""
    try:
        return reduce(problem, state, damping), damping
    except SingularNormalsError:
        raised = max(100 * damping, 1e-4)
        return reduce(problem, state, raised), raised


def next_damping(damping: float, share: float) -> float:
    """Give the damping of the next step by the share that was taken of the last."""
    if share == 1:
        return damping / 10 if damping > LEAST_DAMPING else 0.0
    return max(30 * damping, LEAST_DAMPING) if share < SHORTEST_WELCOME else damping
