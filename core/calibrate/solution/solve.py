"""One least-squares solution of a network, its variance components, and what is known of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.calibrate.diagnosis.weakness import (
    ORIENTATION,
    UndeterminedError,
    check_estimable,
    contradicted_error,
    singular_error,
    unsolved_error,
)
from core.calibrate.selection import Warnings
from core.calibrate.solution.covariance import (
    global_cofactors,
    length_cofactors,
    point_cofactors,
    redundancy_numbers,
)
from core.calibrate.solution.equations import Equations, linearise, misclosures
from core.calibrate.solution.iterate import NotConvergedError, Solution, iterate
from core.calibrate.solution.normals import Inverse, SingularNormalsError
from core.calibrate.solution.problem import Problem, weighted_problem
from core.calibrate.solution.state import State, interior_of, station_orientations
from core.errors import AdjustmentError
from core.geometry import LENSES, Pose
from core.lazy import dataclass
from core.model import AdjustedDevice, Adjustment, Array, Concern, Network
from core.progress import Progress

FACTOR_TOLERANCE = 1e-4  # relative change at which variance components have settled
FACTOR_ROUNDS = 20
FITTING = 10.0  # σ0 at most of a network that explains its images
DOUBTED = 3.0  # σ0 of a solution beyond which another one is looked for
LEAST_FACTOR = 1e-8  # of a variance: simulated observations without noise count as ten thousand times better, no more


@dataclass(frozen=True)
class AdjustOptions:
    """What can be chosen about an adjustment."""

    max_iterations: int = 60  #: iterations of one solution before it counts as not converging
    #: what the last step leaves is shorter than this, all unknowns together, in units of their sigma, or lost in the
    #: rounding of vᵀPv
    tolerance: float = 1e-5
    #: estimate one variance factor per device. Off, sigma0 is that of the given weights.
    variance_components: bool = False
    #: leave out observations whose normalised residual exceeds this, and say how many; None keeps them all and only
    #: reports the gross ones
    reject_beyond: float | None = None


DEFAULT = AdjustOptions()


@dataclass(frozen=True)
class Solved:
    """A solution with its inverse, in the problem's own order."""

    network: Network
    problem: Problem
    state: State
    equations: Equations
    inverse: Inverse
    redundancy_numbers: Array
    convergence: tuple[float, ...]
    factors: dict[str, float]
    weaknesses: tuple[str, ...] = ()

    @property
    def variance(self) -> float:
        """A posteriori variance of unit weight, sigma0²."""
        return self.equations.cost / self.problem.redundancy


class SettledError(AdjustmentError):
    """No station is turned over, no image mirrored, and nothing else need be tried.

    Single observations alone keep a network from being solved, or it explains its images and determines too little.
    """


def refuse_unredundant(problem: Problem) -> None:
    """Refuse what has no more observations than unknowns, or no longer."""
    if problem.redundancy < 1:
        raise AdjustmentError(
            "the network",
            f"has redundancy {problem.redundancy}: no more observations than unknowns",
            "add image points or stations, or hold parameters",
        )


def solve(network: Network, problem: Problem, state: State, options: AdjustOptions, progress: Progress) -> Solved:
    """Least-squares solution with all that is known of it; variance components iterated where asked."""
    refuse_unredundant(problem)
    factors = dict.fromkeys(problem.device_names, 1.0)
    convergence: tuple[float, ...] = ()
    for round_ in range(FACTOR_ROUNDS if options.variance_components else 1):
        weighted, used = weighted_problem(network, factors) if round_ else problem, dict(factors)
        try:
            solution = iterate(
                weighted, state, max_iterations=options.max_iterations, tolerance=options.tolerance, progress=progress
            )
        except SingularNormalsError as error:
            raise singular_error(network, weighted, state, error) from None
        except NotConvergedError as error:
            why = unsolved_error(network, weighted, error)
            raise settled(why, error.convergence[-1] / weighted.redundancy) from None
        state, convergence = solution.state, convergence or solution.convergence
        if not options.variance_components:
            break
        quickest = solution.quickest(weighted)  # as good for sums of redundancy numbers
        equations, _, numbers = _known(quickest, solution)
        steady = True
        for d, name in enumerate(problem.device_names):
            own = quickest.device == d
            if not own.any():
                continue
            before = factors[name]
            factors[name] = max(before * float(np.sum(equations.w[own] ** 2) / np.nansum(numbers[own])), LEAST_FACTOR)
            steady &= abs(factors[name] / before - 1) < FACTOR_TOLERANCE
        if steady:
            break
        progress(min(round_ / 5, 1.0), "variance components")
    try:
        solved = Solved(network, weighted, state, *_known(weighted, solution), convergence, used)
    except SingularNormalsError as error:
        raise singular_error(network, weighted, state, error) from None
    try:
        weaknesses = check_estimable(network, solved.problem, solved.state, solved.equations, solved.inverse)
    except UndeterminedError as error:
        raise settled(error, max(factors.values()) * solved.variance) from None
    return replace(solved, weaknesses=tuple(weaknesses))


def _known(problem: Problem, solution: Solution) -> tuple[Equations, Inverse, Array]:
    """Equations, inverse and redundancy numbers of a solution, in the problem's own order."""
    inverse = solution.invert(problem)
    # derivatives where the inverse has them, before the last, tiny step
    J = linearise(problem, solution.reduced.state).J
    equations = Equations(misclosures(problem, solution.state), J, solution.cost)
    return equations, inverse, redundancy_numbers(problem, equations, inverse)


def settled(error: AdjustmentError, variance: float) -> AdjustmentError:
    """Turn what other starts need not be tried for into a `SettledError`, and tell misfit from weakness.

    `variance` is what is left by the sigmas given.
    """
    if isinstance(error, UndeterminedError) and variance < DOUBTED**2:
        return SettledError(error.where, error.seen, error.remedy)
    if isinstance(error, UndeterminedError) and variance > FITTING**2:
        return contradicted_error(error, variance**0.5)
    return error


def result_of(solved: Solved, warnings: Warnings) -> Adjustment:
    """Put a solution into the order and units of its network."""
    problem, network = solved.problem, solved.network
    back = np.argsort(problem.order)
    with np.errstate(divide="ignore", invalid="ignore"):
        residuals = np.where(problem.root_weight > 0, solved.equations.w / problem.root_weight, np.nan)
    cov = solved.variance * global_cofactors(problem, solved.inverse)
    sigmas = np.sqrt(np.diagonal(cov))
    devices: dict[str, AdjustedDevice] = {}
    names: list[str] = []
    for d, name in enumerate(problem.device_names):
        spec = network.devices[name].spec
        own = residuals[problem.device == d] * spec.pitch_mm * 1e3
        rms = [float(np.sqrt(np.mean(c[np.isfinite(c)] ** 2))) if np.isfinite(c).any() else 0.0 for c in own.T]
        devices[name] = AdjustedDevice(
            spec=spec,
            interior=interior_of(problem, solved.state, d),
            sigma=sigmas[len(names) : len(names) + len(LENSES[spec.model].names)],
            residual_rms_um=(rms[0], rms[1]),
            image_points=len(own),
        )
        names += [f"{name}.{p}" for p in LENSES[spec.model].names]
    point_cov = solved.variance * point_cofactors(problem, solved.inverse)
    lengths = solved.variance * length_cofactors(problem, solved.state, solved.inverse)
    known = network.point_sigma_mm
    held = np.zeros(network.point_xyz_mm.shape, bool) if known is None else known == 0
    relative = {}
    for d, name in enumerate(problem.device_names):
        if problem.base[d] != d:
            relative[name] = Pose(solved.state.relative_rotation[d], solved.state.relative_shift[d])
            names += [f"{name}.{p}" for p in ORIENTATION]
    return Adjustment(
        network=network,
        devices=devices,
        station_from_object=station_orientations(problem, solved.state),
        relative=relative,
        points_mm=np.where(held, network.point_xyz_mm, solved.state.xyz + problem.origin_mm),
        point_cov_mm2=np.where(held[:, :, None] | held[:, None, :], 0.0, point_cov),
        residuals=residuals[back],
        redundancy_numbers=solved.redundancy_numbers[back],
        sigma0=float(np.sqrt(solved.variance)),
        redundancy=problem.redundancy,
        iterations=len(solved.convergence) - 1,
        convergence=solved.convergence,
        variance_factors=solved.factors,
        parameter_names=tuple(names),
        parameter_cov=cov,
        length_sigma_mm=tuple(np.sqrt(lengths).tolist()),
        warnings=tuple(w.text if isinstance(w, Concern) else w for w in warnings),
        doubts=tuple(w for w in warnings if isinstance(w, Concern)),
    )
