"""A network solved from several starts: what is tried where the first approximate values lead astray or nowhere."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import cached_property

import numpy as np

from core.calibrate.approximate.columns import placed, told_places, unplaced
from core.calibrate.approximate.initial import initial_state, oriented_anew
from core.calibrate.approximate.stations import NoPoseError
from core.calibrate.diagnosis.groups import without
from core.calibrate.diagnosis.snooping import far_off, far_off_error
from core.calibrate.diagnosis.weakness import PointsError, usual_variance
from core.calibrate.selection import Warnings, adjustable, selected
from core.calibrate.solution.equations import cost_of
from core.calibrate.solution.normals import SingularNormalsError
from core.calibrate.solution.problem import Problem, problem_of
from core.calibrate.solution.robust import robust_state
from core.calibrate.solution.solve import (
    DOUBTED,
    FITTING,
    AdjustOptions,
    SettledError,
    Solved,
    refuse_unredundant,
    solve,
)
from core.calibrate.solution.state import State
from core.errors import AdjustmentError
from core.lazy import dataclass
from core.model import Concern, Network
from core.progress import Progress

UNEVEN = 2.0  # variance of a solution over that of the bulk of its observations, likewise
POSELESS = 8  # stations, of which one at most may fit no pose
ORIENTED = 3  # times
SAME = 1e-6  # share by which the variances of one and the same solution differ
SAME_START = 1e-3  # and vᵀPv of approximate values that lead nowhere else


@dataclass(frozen=True)
class Start:
    """A network with approximate values of its unknowns."""

    network: Network
    problem: Problem
    state: State

    @cached_property
    def cost(self) -> float:
        """vᵀPv there."""
        return cost_of(self.problem, self.state)

    @cached_property
    def robust(self) -> State:
        """What the bulk of the observations agrees on, from there."""
        return robust_state(self.problem, self.state)


def begun_at(network: Network, problem: Problem, spare: int) -> tuple[Network, Problem, State, Warnings]:
    """Approximate values; up to `spare` stations whose points fit no pose are left out and named."""
    try:
        return network, problem, initial_state(network, problem), []
    except NoPoseError as failure:
        if not spare:
            raise
        station = network.station_names.index(failure.where.removeprefix("station "))
        try:
            network, warnings = adjustable(selected(network, network.observation_station != station))
            problem = problem_of(network)
            refuse_unredundant(problem)
            network, problem, state, more = begun_at(network, problem, spare - 1)
        except AdjustmentError:  # the first one tells most
            raise failure from None
        told = Concern("doubtful", f"left out, {failure.seen}: {failure.where}")
        return network, problem, state, [told, *warnings, *more]


def solve_with_places(start: Start, options: AdjustOptions, progress: Progress) -> tuple[Solved, int, Warnings]:
    """As `solve_somehow`; places along the axis of a coordinate never observed are adjusted, too, where they are told.

    Distortion tells them, which is not known before: they are held first.
    """
    held = solved, lost, warnings = solve_somehow(start, options, progress)
    told = places_told(solved)
    if told.keys() == {name for name, device in solved.network.devices.items() if device.along}:
        return held
    network = placed(solved.network, told)
    begun = Start(network, problem_of(network), unplaced(network, solved.problem, solved.state))
    try:
        found, more_lost, more = solve_despite(begun, options, progress)
    except (AdjustmentError, SingularNormalsError):
        return held
    return (found, lost + more_lost, [*warnings, *more]) if told.keys() <= places_told(found).keys() else held


def places_told(solved: Solved) -> dict[str, float]:
    """Sigmas, mm, of the places that distortion tells, by device: see `told_places`."""
    variance = usual_variance(solved.problem, solved.equations)
    return told_places(solved.network, solved.problem, solved.state, variance)


def solve_somehow(start: Start, options: AdjustOptions, progress: Progress) -> tuple[Solved, int, Warnings]:
    """As `solve_despite`; where that does not fit, from stations oriented anew on what the bulk of them agrees on.

    Of a flat field seen with little perspective, rough approximate points choose the second solution of some stations.
    So do nominal lenses of stations that see few points: at last those of the solution are taken, too.
    """
    best: tuple[Solved, int, Warnings] | None = None
    failure: AdjustmentError | None = None
    try:
        best = solve_despite(start, options, progress)
    except SettledError:
        raise
    except AdjustmentError as error:
        failure = error
    steady = False
    for lenses in (False,) * ORIENTED + (True,):
        if best is not None and not doubted(best[0]):
            break
        if (steady and not lenses) or (lenses and best is None):
            continue
        with suppress(AdjustmentError, SingularNormalsError):
            there = oriented_anew(start.network, start.problem, start.robust, lenses)
            before, start = start, replace(start, state=there)
            steady = abs(start.cost - before.cost) < SAME_START * before.cost
            if steady:
                continue
            found = solve_despite(start, options, progress)
            steady = best is not None and abs(found[0].variance / best[0].variance - 1) < SAME
            if found[0].variance < (FITTING**2 if best is None else best[0].variance / UNEVEN):
                best = found
    if best is None:
        assert failure is not None
        raise failure
    return best


def doubted(solved: Solved) -> bool:
    """Whether a solution leaves so much, in all or in some observations, that it may be a false minimum."""
    return solved.variance > min(DOUBTED**2, UNEVEN * usual_variance(solved.problem, solved.equations))


def solve_despite(
    start: Start, options: AdjustOptions, progress: Progress, passes: int = 3
) -> tuple[Solved, int, Warnings]:
    """Solve, where gross errors lead least squares astray from a robust solution or, if rejecting, without them.

    Points that would have to lie behind a device, or are seen from one place only, are left out first, in so many
    passes. Also gives how many observations were left out, and names the points and stations left out with them.
    """
    network, problem = start.network, start.problem
    try:
        return solve(network, problem, start.state, options, progress), 0, []
    except SettledError:
        raise
    except AdjustmentError as failure:
        if isinstance(failure, PointsError) and passes:
            bad = np.flatnonzero(np.isin(problem.point, failure.points))
            smaller, rest, state, warnings = without(network, problem, failure.state, bad)
            solved, lost, more = solve_despite(Start(smaller, rest, state), options, progress, passes - 1)
            told = Concern("doubtful", f"left out, {failure.seen}: {failure.where}")
            return solved, lost, [told, *warnings, *more]
        try:
            bad, misfit = far_off(problem, start.robust)
            if not len(bad):
                raise failure
            if options.reject_beyond is None:
                with suppress(AdjustmentError):
                    return solve(network, problem, start.robust, options, progress), 0, []
            smaller, rest, state, warnings = without(network, problem, start.robust, bad)
            solved = solve(smaller, rest, state, options, progress)
        except (SingularNormalsError, AdjustmentError):
            raise failure from None
        if options.reject_beyond is None:
            error = far_off_error(network, problem, bad, misfit)
            of = network.observation_station
            single = np.all(2 * np.bincount(of[bad], minlength=of.max() + 1) < np.bincount(of).clip(1))
            if single and not doubted(solved):
                raise SettledError(error.where, error.seen, error.remedy) from None
            raise error from None
        return solved, len(bad), warnings
