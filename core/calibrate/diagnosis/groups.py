"""Whole images and captures that do not fit the others: groups of observations tested before single ones.

A camera that was knocked in one capture, or frames of another one, make every point of an image wrong. Taken out point
by point, the largest residual first, that would need an adjustment for each, and good observations would go with them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from core.calibrate.selection import Warnings, adjustable, selected
from core.calibrate.solution.iterate import NotConvergedError, iterate
from core.calibrate.solution.normals import SingularNormalsError
from core.calibrate.solution.problem import Problem, problem_of, weighted_problem
from core.calibrate.solution.robust import misfits, robust_state
from core.calibrate.solution.state import State
from core.errors import AdjustmentError
from core.lazy import dataclass
from core.model import Array, Ints, Network
from core.numerics import fisher_limit

OFF = 3.0  # median size of an image's normalised residuals over that of all: half of its points are that far off
LEAST_POINTS = 8  # of an image; among fewer, single errors are half of them
TRIED = 3  # captures, the worst, of which one is taken out
MOST = 0.25  # share of the captures that may be off: more, and the rig or what is said of it is at fault
MEDIAN_OF_LARGER = 1.0518  # of the larger size of two normal deviates
LEVEL = 0.001  # chance that a group of good observations is found significant


@dataclass(frozen=True)
class Group:
    """Observations of one capture that do not fit as a whole, numbered as in the problem; F and its critical value."""

    rows: Ints
    stations: tuple[str, ...]
    statistic: float
    critical: float

    def __str__(self) -> str:
        """Say which."""
        names = " and ".join(self.stations)
        return (
            f"{names} left out as a whole: {len(self.rows)} observations do not fit those of the other captures "
            f"(F = {self.statistic:.3g}, critical value {self.critical:.3g})"
        )


def wrong_group(
    network: Network, problem: Problem, state: State, size: Array, factors: Mapping[str, float]
) -> Group | None:
    """Find the image, or all images of a capture, without which the rest agrees best; None where none is off.

    The variances of `problem` are multiplied by the devices' factors, `state` is its solution, `size` (m,) the
    normalised residuals there. By how much vᵀPv falls when a group is taken out, per observation that it had to spare,
    over the variance of unit weight of the rest, is F distributed if the group is good. Source: Teunissen, *Testing
    theory*, 2000, section 4. The smallest group is taken that explains the misfit alone: one of a capture's images, if
    without it, and not without another one, the rest of the capture fits. A camera and a projector cannot be told apart
    by that.
    """
    station = network.observation_station[problem.order]
    suspects = _suspects(problem, station, size)
    if not suspects:
        return None
    try:
        # single errors far off make the good points of their image look bad: not beside a robust solution
        start = robust_state(problem, state)
        size = misfits(_of_usual_weights(problem), start)
        suspects = _suspects(problem, station, size)
        if not suspects or len(suspects) > max(MOST * problem.poses, 1):
            return None
        device = problem.device
        units = [float(np.median(size[device == d])) if (device == d).any() else 1.0 for d in range(len(problem.base))]
        names = problem.device_names
        variances = {n: factors[n] * (u / MEDIAN_OF_LARGER) ** 2 for n, u in zip(names, units, strict=True)}
        cost = iterate(weighted_problem(network, variances), state).cost
    except (SingularNormalsError, NotConvergedError):
        return None

    def rest(rows: Ints) -> tuple[float, int] | None:
        """Give vᵀPv and redundancy without some observations."""
        try:
            smaller, _, carried, _ = without(network, problem, start, rows)
            left = weighted_problem(smaller, variances)
            return (iterate(left, carried).cost, left.redundancy) if left.redundancy > 0 else None
        except (AdjustmentError, SingularNormalsError, NotConvergedError):
            return None

    found: dict[float, Group] = {}
    for pose in suspects[:TRIED]:
        whole = np.flatnonzero(problem.pose == pose)
        if (left := rest(whole)) is None:
            continue
        rows = whole
        if (part := _part(station, whole, left, rest)) is not None:
            rows, left = part
        variance, spare = left[0] / left[1], max(problem.redundancy - left[1], 1)
        statistic, critical = (cost - left[0]) / spare / variance, fisher_limit(spare, left[1], LEVEL)
        if statistic > critical:
            stations = tuple(network.station_names[s] for s in np.unique(station[rows]))
            found[variance] = Group(rows, stations, statistic, critical)
    return found[min(found)] if found else None


def _of_usual_weights(problem: Problem) -> Problem:
    """Let no observation weigh more than half of its device's do.

    Sigmas of a whole image that are too small make it no wrong one: that lies apart in pixels, too.
    """
    weight = problem.root_weight.copy()
    for d in np.unique(problem.device):
        own = problem.device == d
        weight[own] = np.minimum(weight[own], np.median(weight[own], axis=0))
    return replace(problem, root_weight=weight)


def _suspects(problem: Problem, station: Ints, size: Array) -> list[int]:
    """Poses of which an image is off by its median, the worst first."""
    usual = {d: max(float(np.median(size[problem.device == d])), 1e-9) for d in np.unique(problem.device).tolist()}
    worst: dict[int, float] = {}
    for s in np.unique(station).tolist():
        own = np.flatnonzero(station == s)
        pose, ratio = int(problem.pose[own[0]]), float(np.median(size[own])) / usual[int(problem.device[own[0]])]
        if len(own) >= LEAST_POINTS and ratio > OFF:
            worst[pose] = max(worst.get(pose, 0.0), ratio)
    return sorted(worst, key=lambda pose: -worst[pose])


def _part(
    station: Ints, whole: Ints, left: tuple[float, int], rest: Callable[[Ints], tuple[float, int] | None]
) -> tuple[Ints, tuple[float, int]] | None:
    """Give the images of a capture that alone explain what its removal does, and what is left without them."""
    images = np.unique(station[whole]).tolist()
    limit = OFF**2 * max(left[0] / left[1], 1.0)
    for count in range(1, len(images)):
        tried = [whole[np.isin(station[whole], part)] for part in combinations(images, count)]
        results = [(rows, r) for rows in tried if (r := rest(rows)) is not None]
        explaining = [(rows, r) for rows, r in results if r[0] - left[0] <= limit * max(r[1] - left[1], 1)]
        if explaining:
            return explaining[0] if len(explaining) == 1 else None
    return None


def without(network: Network, problem: Problem, state: State, bad: Ints) -> tuple[Network, Problem, State, Warnings]:
    """Leave out observations, numbered as in the problem, and what cannot be adjusted without them."""
    keep = np.ones(len(problem.point), bool)
    keep[problem.order[bad]] = False
    smaller, warnings = adjustable(selected(network, keep))
    rest = problem_of(smaller)
    number = {name: k for k, name in enumerate(network.point_names)}
    points = [number[name] for name in smaller.point_names]
    poses = [network.station_pose.index(p) for p in smaller.station_pose]
    pose_index = np.empty(rest.poses, np.int64)
    pose_index[rest.station_pose] = problem.station_pose[poses]
    shift, R = rest.origin_mm - problem.origin_mm, state.pose_rotation[pose_index]
    carried = replace(
        state, pose_rotation=R, pose_shift=state.pose_shift[pose_index] + R @ shift, xyz=state.xyz[points] - shift
    )
    return smaller, rest, carried, warnings
