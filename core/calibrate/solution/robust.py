"""A robust solution: observations lose their weight with their misfit, so that those far off rule nothing.

Plain least squares may be lost without it: a few observations that are hundreds of pixels off bend lens and object
until nothing fits. It serves to name them, and as approximate values.
"""

from __future__ import annotations

import numpy as np

from core.calibrate.solution.datum import aligned
from core.calibrate.solution.equations import cost_of, misclosures
from core.calibrate.solution.iterate import MOST_DAMPING, next_damping, regular, shortened
from core.calibrate.solution.problem import Problem, reweighted
from core.calibrate.solution.state import State
from core.model import Array
from core.numerics import sigma_by_median

HALF_WEIGHT = 3.0  # usual misfits of its device at which an observation counts half
ITERATIONS = 60
SETTLED = 1e-6  # gain of a step, as a share of the weighted squares, that ends the iterations
ENOUGH = 5  # points of a pose: it fits three of fewer as well as can be, and none tells which of them is wrong
LEAST_UNIT = 1e-6  # sigmas: what observations without noise leave is rounding


def robust_state(problem: Problem, state: State) -> State:
    """Unknowns on which the bulk of the observations agrees, from approximate values.

    Cauchy's weights ``1 / (1 + (v / k s)²)``, with the scale s, a median, taken anew before every step: it is large
    while the approximate points are wrong and falls with their misfit (Holland, Welsch, *Robust regression using
    iteratively reweighted least-squares*, Communications in Statistics 6, 1977). SingularNormalsError if the
    observations do not determine the unknowns.
    """
    state, damping = aligned(problem, state), 0.0
    for _ in range(ITERATIONS):
        misfit = _together(problem, misfits(problem, state))
        soft = reweighted(problem, (1.0 + (misfit / HALF_WEIGHT) ** 2)[:, None] ** -0.5)
        cost = cost_of(soft, state)
        reduced, damping = regular(soft, state, damping)
        step = reduced.solve(soft)
        share, trial, _ = shortened(soft, state, cost, step)
        if share > 0:
            state = aligned(problem, trial)
        if (damping == 0 and step.gain < SETTLED * cost) or damping > MOST_DAMPING:
            break
        damping = next_damping(damping, share)
    return state


def _together(problem: Problem, misfit: Array) -> Array:
    """Give observations of poses with few points the root mean square of their pose's misfits."""
    count = np.bincount(problem.pose)
    rms = np.sqrt(np.bincount(problem.pose, misfit**2) / np.maximum(count, 1))
    return np.where(count[problem.pose] < ENOUGH, rms[problem.pose], misfit)


def misfits(problem: Problem, state: State) -> Array:
    """Larger misclosure of every observation, shape (m,), over the usual one of its device, a robust sigma."""
    w, seen = np.abs(misclosures(problem, state)), problem.root_weight > 0
    units = np.ones(len(problem.base))
    freedom = np.count_nonzero(seen) / max(problem.redundancy, 1)  # residuals are smaller than errors by its root
    for d in range(len(units)):
        own = w[problem.device == d][seen[problem.device == d]]
        own = own[np.isfinite(own)]
        if len(own):
            units[d] = max(np.sqrt(freedom) * sigma_by_median(own), LEAST_UNIT)
    return np.max(np.where(seen, w, 0.0), axis=1) / units[problem.device]
