"""The bundle adjustment from a network to everything known about it."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from dataclasses import replace
from functools import cached_property

import numpy as np

from core.algebra import on_own_threads
from core.calibrate.approximate.columns import without_unobservable
from core.calibrate.approximate.from_images import dimensions, located_by_images
from core.calibrate.approximate.initial import initial_state, misplaced, oriented_anew
from core.calibrate.approximate.stations import NoPoseError
from core.calibrate.diagnosis.groups import without, wrong_group
from core.calibrate.diagnosis.held import held_concerns
from core.calibrate.diagnosis.rigid import rigidity_warnings
from core.calibrate.diagnosis.snooping import (
    far_off,
    far_off_error,
    gross_errors,
    masked,
    normalised_residuals,
    outlier_warning,
    sizes,
    within_images,
)
from core.calibrate.diagnosis.weakness import (
    MirroredError,
    PointsError,
    behind_warning,
    geometry_warnings,
    usual_variance,
)
from core.calibrate.selection import LostEndError, Warnings, adjustable, check_network, selected
from core.calibrate.solution.datum import check_known
from core.calibrate.solution.equations import cost_of
from core.calibrate.solution.normals import SingularNormalsError
from core.calibrate.solution.problem import Problem, problem_of
from core.calibrate.solution.robust import misfits, robust_state
from core.calibrate.solution.solve import (
    DEFAULT,
    DOUBTED,
    FITTING,
    AdjustOptions,
    SettledError,
    Solved,
    refuse_unredundant,
    result_of,
    solve,
)
from core.calibrate.solution.state import State
from core.errors import AdjustmentError
from core.geometry import similarity_residual
from core.lazy import dataclass
from core.model import Adjustment, Array, Concern, Network
from core.progress import SILENT, Progress

UNEVEN = 2.0  # variance of a solution over that of the bulk of its observations, likewise
POSELESS = 8  # stations, of which one at most may fit no pose
ORIENTED = 3  # times
SAME = 1e-6  # share by which the variances of one and the same solution differ
SAME_START = 1e-3  # and vᵀPv of approximate values that lead nowhere else


@dataclass(frozen=True)
class _Start:
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


@on_own_threads()
def adjust(network: Network, *, options: AdjustOptions = DEFAULT, progress: Progress = SILENT) -> Adjustment:
    """Adjust a network as a free bundle.

    The datum is given by inner constraints on all points, onto their approximate coordinates; a measured distance
    gives the scale. Points and stations that cannot be determined are left out and named in the warnings; the network
    of the result is the one adjusted.

    Raises
    ------
    InputError
        If the network holds numbers that mean nothing.
    AdjustmentError
        If it is disconnected, has no redundancy, does not converge or does not determine a parameter.
    """
    solved, warnings = solve_network(network, options, progress.part(0.0, 0.8))
    poses = solved.network.station_pose
    if len(poses) - len(set(poses)) > 1:
        remedy = 'leave "rigid_with" out, and mount the devices firmly'
        warnings = [*warnings, *rigidity_warnings(solved, poses, remedy, progress.part(0.8, 1.0))]
    return result_of(solved, warnings)


@on_own_threads()
def solve_network(
    network: Network, options: AdjustOptions, progress: Progress = SILENT, near: Solved | None = None
) -> tuple[Solved, Warnings]:
    """Adjust a network, reject gross errors where the options say so, and collect what weakens it.

    `near` is the solution of nearly the same network, which gives initial values; what iterations made of vᵀPv begins
    with its own. Where that fails and would not with mirrored images, or free stations, the error says so. Of a network
    of others, whose approximate coordinates may be none, the images alone are tried then.
    """
    check_network(network)
    try:
        return _solved(network, options, progress, near=near)
    except SettledError:
        raise
    except AdjustmentError:
        if otherwise := _otherwise(network, options, progress):
            return otherwise
        raise


def _otherwise(network: Network, options: AdjustOptions, progress: Progress) -> tuple[Solved, Warnings] | None:
    """Try what else a network may be that cannot be adjusted as it is; what its files have wrong is an error.

    Where approximate coordinates are rough beyond use, the images alone give others, unless these are their mirror
    image.
    """
    check_known(network)
    alone = None if network.point_ids else _by_images_alone(network, options, progress)
    if alone is not None and _handed_as_given(alone[0], network):
        return alone
    extent = dimensions(network.point_xyz_mm)
    every = tuple(network.devices) if extent > 1 else ()
    # mirrored images of a flat board are those of its back
    told = extent > 2 or any(device.spec.interior is not None for device in network.devices.values())
    if every and told and _fits(_mirrored(network, every), options):
        raise MirroredError(", ".join(every)) from None
    single = every if len(every) > 1 else ()
    if mirrored := [name for name in single if _fits(_mirrored(network, (name,)), options)]:
        raise MirroredError(" or ".join(mirrored)) from None
    free = replace(network, station_pose=tuple(range(len(network.station_pose))))
    if not network.point_ids and free.station_pose != network.station_pose and _fits(free, options):
        seen = "images fit where every station stands for itself, not where devices are rigid to each other"
        remedy = 'see which stations share a "pose", or are listed in one order, or leave "rigid_with" out'
        raise AdjustmentError("the rig", seen, remedy) from None
    return alone


def _by_images_alone(network: Network, options: AdjustOptions, progress: Progress) -> tuple[Solved, Warnings] | None:
    if located := located_by_images(network):
        with suppress(AdjustmentError):
            solved, warnings = _solved(located[0], options, progress)
            if solved.variance < FITTING**2:
                return solved, [*located[1], *warnings]
    return None


def _handed_as_given(solved: Solved, network: Network) -> bool:
    """Whether points come out as they are given, rather than as their mirror image."""
    given = dict(zip(network.point_names, network.point_xyz_mm, strict=True))
    places = np.array([given[name] for name in solved.network.point_names])
    off, mirrored = (similarity_residual(solved.state.xyz * (1, 1, hand), places) for hand in (1, -1))
    return off <= mirrored


def _fits(network: Network, options: AdjustOptions) -> bool:
    with suppress(AdjustmentError):
        return _solved(network, options, SILENT)[0].variance < FITTING**2
    return False


def explained(network: Network, options: AdjustOptions) -> bool:
    """Whether most of a network's observations fit by the sigmas given, even if they determine too little."""
    try:
        solved, _ = _solved(network, replace(options, variance_components=False, reject_beyond=None), SILENT)
    except AdjustmentError as error:
        return isinstance(error, SettledError)
    return usual_variance(solved.problem, solved.equations) < DOUBTED**2


def _mirrored(network: Network, devices: Collection[str]) -> Network:
    """Count v of those devices upwards."""
    of = [network.station_device[s] for s in network.observation_station]
    last = np.array([network.devices[name].spec.height - 1 if name in devices else np.nan for name in of])
    uv = network.observation_uv.copy()
    uv[:, 1] = np.where(np.isnan(last), uv[:, 1], last - uv[:, 1])
    return replace(network, observation_uv=uv)


def _solved(
    network: Network, options: AdjustOptions, progress: Progress, spare_ends: bool = False, near: Solved | None = None
) -> tuple[Solved, Warnings]:
    """Solve and reject; with `spare_ends` no images of the ends of measured distances, which these may contradict."""
    whole = network
    network, warnings = adjustable(network)
    network, more = without_unobservable(network)
    warnings += more
    problem = problem_of(network)
    refuse_unredundant(problem)
    progress(0.0, "initial values")
    earlier: tuple[float, ...] = ()
    if near is not None and _same_unknowns(near.network, network):
        state, earlier = near.state, near.convergence
    else:
        spare = 0 if options.reject_beyond is None else len(network.station_names) // POSELESS
        network, problem, state, more = _begun(network, problem, spare)
        warnings += more
        network, problem, state, more = misplaced(network, problem, state)
        warnings += more
    rejected = 0
    solved, lost, more = _solve_somehow(_Start(network, problem, state), options, progress.part(0.1, 0.9))
    while True:
        rejected += lost
        warnings += more
        if options.reject_beyond is None:
            break
        normalised = normalised_residuals(solved.problem, solved.equations, solved.redundancy_numbers)
        if group := wrong_group(solved.network, solved.problem, solved.state, sizes(normalised), solved.factors):
            bad = group.rows
            warnings.append(str(group))
        else:
            size = sizes(within_images(solved.problem, normalised))
            ends = [end for d in solved.problem.distances for end in (d.start, d.stop)] if spare_ends else []
            spared = np.where(np.isin(solved.problem.point, ends), 0.0, size)
            bad = gross_errors(solved.problem, spared, options.reject_beyond)
        if not len(bad):
            break
        rejected += len(bad)
        try:
            network, problem, state, more = without(solved.network, solved.problem, solved.state, bad)
        except LostEndError:  # one image after the other: the distance is wrong, not they
            if spare_ends:
                raise
            return _solved(whole, options, progress, spare_ends=True)
        warnings += more
        solved, lost, more = _solve_despite(_Start(network, problem, state), options, progress.part(0.1, 0.9))
    if rejected:
        warnings.append(
            f"{rejected} of {rejected + len(solved.problem.point)} observations rejected as gross errors "
            f"(normalised residual above {options.reject_beyond:g})"
        )
    warnings += held_concerns(solved.network, solved.problem, solved.state, solved.equations.cost)
    warnings += solved.weaknesses
    warnings += geometry_warnings(solved.problem, solved.state)
    warnings += behind_warning(solved.network, solved.state)
    warnings += outlier_warning(solved.network, solved.problem, _sizes_of_errors(solved))
    progress(1.0, "adjusted")
    return replace(solved, convergence=(*earlier, *solved.convergence[bool(earlier) :])), warnings


def _begun(network: Network, problem: Problem, spare: int) -> tuple[Network, Problem, State, Warnings]:
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
            network, problem, state, more = _begun(network, problem, spare - 1)
        except AdjustmentError:  # the first one tells most
            raise failure from None
        told = Concern("doubtful", f"left out, {failure.seen}: {failure.where}")
        return network, problem, state, [told, *warnings, *more]


def _same_unknowns(one: Network, other: Network) -> bool:
    """Whether networks have the same stations, poses and approximate points."""
    names = [(n.station_names, n.station_pose, n.point_names) for n in (one, other)]
    return names[0] == names[1] and np.array_equal(one.point_xyz_mm, other.point_xyz_mm)


def _solve_somehow(start: _Start, options: AdjustOptions, progress: Progress) -> tuple[Solved, int, Warnings]:
    """As `_solve_despite`; where that does not fit, from stations oriented anew on what the bulk of them agrees on.

    Of a flat field seen with little perspective, rough approximate points choose the second solution of some stations.
    So do nominal lenses of stations that see few points: at last those of the solution are taken, too.
    """
    best: tuple[Solved, int, Warnings] | None = None
    failure: AdjustmentError | None = None
    try:
        best = _solve_despite(start, options, progress)
    except SettledError:
        raise
    except AdjustmentError as error:
        failure = error
    steady = False
    for lenses in (False,) * ORIENTED + (True,):
        if best is not None and not _doubted(best[0]):
            break
        if (steady and not lenses) or (lenses and best is None):
            continue
        with suppress(AdjustmentError, SingularNormalsError):
            there = oriented_anew(start.network, start.problem, start.robust, lenses)
            before, start = start, replace(start, state=there)
            steady = abs(start.cost - before.cost) < SAME_START * before.cost
            if steady:
                continue
            found = _solve_despite(start, options, progress)
            steady = best is not None and abs(found[0].variance / best[0].variance - 1) < SAME
            if found[0].variance < (FITTING**2 if best is None else best[0].variance / UNEVEN):
                best = found
    if best is None:
        assert failure is not None
        raise failure
    return best


def _doubted(solved: Solved) -> bool:
    """Whether a solution leaves so much, in all or in some observations, that it may be a false minimum."""
    return solved.variance > min(DOUBTED**2, UNEVEN * usual_variance(solved.problem, solved.equations))


def _solve_despite(
    start: _Start, options: AdjustOptions, progress: Progress, passes: int = 3
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
            solved, lost, more = _solve_despite(_Start(smaller, rest, state), options, progress, passes - 1)
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
            if single and not _doubted(solved):
                raise SettledError(error.where, error.seen, error.remedy) from None
            raise error from None
        return solved, len(bad), warnings


def _sizes_of_errors(solved: Solved) -> Array:
    """Normalised residuals of the observations, shape (m,); of a robust solution where large ones raise others."""
    normalised = normalised_residuals(solved.problem, solved.equations, solved.redundancy_numbers)
    size = sizes(within_images(solved.problem, normalised))
    if masked(solved.problem, size):
        with suppress(SingularNormalsError):
            return misfits(solved.problem, robust_state(solved.problem, solved.state))
    return size
