"""The bundle adjustment from a network to everything known about it."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from dataclasses import replace

import numpy as np

from core.algebra import on_own_threads
from core.calibrate.approximate.columns import placed, unobserved_words, without_unobservable
from core.calibrate.approximate.from_images import dimensions, located_by_images
from core.calibrate.approximate.initial import misplaced
from core.calibrate.diagnosis.groups import without, wrong_group
from core.calibrate.diagnosis.held import held_concerns
from core.calibrate.diagnosis.rigid import rigidity_warnings
from core.calibrate.diagnosis.snooping import (
    gross_errors,
    masked,
    normalised_residuals,
    outlier_warning,
    sizes,
    within_images,
)
from core.calibrate.diagnosis.weakness import (
    MirroredError,
    behind_warning,
    geometry_warnings,
    usual_variance,
)
from core.calibrate.selection import LostEndError, Warnings, adjustable, check_network
from core.calibrate.solution.datum import check_known
from core.calibrate.solution.normals import SingularNormalsError
from core.calibrate.solution.problem import problem_of
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
)
from core.calibrate.starts import POSELESS, Start, begun_at, places_told, solve_despite, solve_with_places
from core.errors import AdjustmentError
from core.geometry import similarity_residual
from core.model import Adjustment, Array, Network
from core.progress import SILENT, Progress


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
    given, warnings = adjustable(network)
    network = without_unobservable(given)
    said = len(warnings)  # before what is said of a coordinate never observed
    problem = problem_of(network)
    refuse_unredundant(problem)
    progress(0.0, "initial values")
    earlier: tuple[float, ...] = ()
    if near is not None and _same_unknowns(near.network, network):
        state, earlier = near.state, near.convergence
        network = placed(network, [name for name, device in near.network.devices.items() if device.along])
        problem = problem_of(network)
    else:
        spare = 0 if options.reject_beyond is None else len(network.station_names) // POSELESS
        network, problem, state, more = begun_at(network, problem, spare)
        warnings += more
        network, problem, state, more = misplaced(network, problem, state)
        warnings += more
    rejected = 0
    solved, lost, more = solve_with_places(Start(network, problem, state), options, progress.part(0.1, 0.9))
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
        solved, lost, more = solve_despite(Start(network, problem, state), options, progress.part(0.1, 0.9))
    if rejected:
        warnings.append(
            f"{rejected} of {rejected + len(solved.problem.point)} observations rejected as gross errors "
            f"(normalised residual above {options.reject_beyond:g})"
        )
    warnings[said:said] = unobserved_words(given, solved.network, places_told(solved))
    warnings += held_concerns(solved.network, solved.problem, solved.state, solved.equations.cost)
    warnings += solved.weaknesses
    warnings += geometry_warnings(solved.problem, solved.state)
    warnings += behind_warning(solved.network, solved.state)
    warnings += outlier_warning(solved.network, solved.problem, _sizes_of_errors(solved))
    progress(1.0, "adjusted")
    return replace(solved, convergence=(*earlier, *solved.convergence[bool(earlier) :])), warnings


def _same_unknowns(one: Network, other: Network) -> bool:
    """Whether networks have the same stations, poses and approximate points."""
    names = [(n.station_names, n.station_pose, n.point_names) for n in (one, other)]
    return names[0] == names[1] and np.array_equal(one.point_xyz_mm, other.point_xyz_mm)


def _sizes_of_errors(solved: Solved) -> Array:
    """Normalised residuals of the observations, shape (m,); of a robust solution where large ones raise others."""
    normalised = normalised_residuals(solved.problem, solved.equations, solved.redundancy_numbers)
    size = sizes(within_images(solved.problem, normalised))
    if masked(solved.problem, size):
        with suppress(SingularNormalsError):
            return misfits(solved.problem, robust_state(solved.problem, solved.state))
    return size
