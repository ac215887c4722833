"""Gross errors found by the residuals they leave (data snooping)."""

from __future__ import annotations

import numpy as np

from core.calibrate.solution.equations import Equations
from core.calibrate.solution.problem import Problem
from core.calibrate.solution.robust import misfits
from core.calibrate.solution.state import State
from core.errors import AdjustmentError
from core.model import Array, Concern, Ints, Network
from core.numerics import normal_limit, sigma_by_median

LEAST_REDUNDANCY = 0.05  # an observation checked less than this cannot be judged by its residual
LEAST_OF_IMAGE, MOST_OF_IMAGE = 20, 2.0  # points; times the common standard deviation of unit weight
SURE = 0.3  # of the worst normalised residual: errors that are smaller may be its shadow
FAR = 2.0  # times the critical value: beyond chance, and so much that good observations look bad beside it
WHOLE = 0.5  # share of a station's observations above which the station is named, not every point
ERROR_LEVEL = 0.001  # chance that one report appears among observations that are all good: it casts doubt
OUTER = 1.96  # standard deviations, within which are 95 % of normal residuals


def normalised_residuals(problem: Problem, equations: Equations, numbers: Array) -> Array:
    """Residuals over their own standard deviations, shape (m, 2), NaN where unobserved or unchecked.

    The standard deviation of unit weight is the lesser of the adjustment's and a robust one, which gross errors do not
    raise: by the median, or by the 95th percentile where that is larger, as it is where sigmas are not all equally
    good. Source: Baarda, *A testing procedure for use in geodetic networks*, 1968.
    """
    checked = numbers > LEAST_REDUNDANCY
    with np.errstate(invalid="ignore"):
        residuals = np.where(checked, equations.w / np.sqrt(np.where(checked, numbers, 1.0)), np.nan)
    if not checked.any():
        return residuals
    robust = max(sigma_by_median(residuals), float(np.nanquantile(np.abs(residuals), 0.95)) / OUTER)
    sigma0 = float(np.sqrt(equations.cost / problem.redundancy))
    unit = min(robust, sigma0) if np.count_nonzero(checked) > 50 else sigma0
    return residuals / unit if unit > 1e-6 else np.where(checked, 0.0, np.nan)


def within_images(problem: Problem, normalised: Array) -> Array:
    """Normalised residuals, shape (m, 2), in the unit of their own image where that is larger, up to twice.

    The sigmas of one image may be too small or too large as a whole: that makes no gross errors of single points.
    """
    image = problem.pose * len(problem.device_names) + problem.device
    own, number, count = np.unique(image, return_inverse=True, return_counts=True)
    units = np.ones(len(own))
    for k in np.flatnonzero(count >= LEAST_OF_IMAGE):
        if np.isfinite(mine := normalised[number == k]).any():
            units[k] = np.clip(sigma_by_median(mine), 1.0, MOST_OF_IMAGE)
    return np.asarray(normalised / units[number][:, None])


def _limit(problem: Problem) -> float:
    """Normalised residual that good observations exceed once in `1 / ERROR_LEVEL` adjustments of this size."""
    return normal_limit(ERROR_LEVEL / (2 * max(int(np.count_nonzero(problem.root_weight)), 1)))


def gross_errors(problem: Problem, size: Array, limit: float) -> Ints:
    """Observations whose normalised residuals, shape (m,), are beyond a limit and that are sure to be wrong.

    Gross errors make good observations look bad. The sure ones are the worst of each pose and of each point, not much
    smaller than the worst of all. Ask again without them.
    """
    bad = np.flatnonzero(size > max(limit, SURE * float(size.max(initial=0.0))))
    taken: list[int] = []
    poses, points = set(), set()
    for o in bad[np.argsort(-size[bad])]:
        if problem.pose[o] not in poses and problem.point[o] not in points:
            taken.append(int(o))
            poses.add(problem.pose[o])
            points.add(problem.point[o])
    return np.array(taken, dtype=np.int64)


def sizes(normalised: Array) -> Array:
    """Larger of both coordinates' residuals, shape (m,), from shape (m, 2); 0 where neither can be judged."""
    return np.asarray(np.max(np.abs(np.nan_to_num(normalised)), axis=1))


def far_off(problem: Problem, state: State) -> tuple[Ints, Array]:
    """Observations that a robust solution leaves far beyond the critical value, and the misfits of all, shape (m,)."""
    misfit = misfits(problem, state)
    return np.flatnonzero(misfit > FAR * _limit(problem)), misfit


def far_off_error(network: Network, problem: Problem, bad: Ints, misfit: Array) -> AdjustmentError:
    """Name the observations without which a network can be solved, and with which it cannot."""
    count = f"{len(bad)} observations lie" if len(bad) > 1 else "one observation lies"
    return AdjustmentError(
        named(network, problem, bad, misfit),
        f"{count} so many sigmas off a solution of the others, and least squares does not find one with all",
        "check the identities and coordinates of these points, or leave them out of these stations",
    )


def masked(problem: Problem, size: Array) -> bool:
    """Whether normalised residuals, shape (m,), are so large that good observations may look bad in their shadow."""
    return bool(size.max(initial=0.0) > FAR * _limit(problem))


def outlier_warning(network: Network, problem: Problem, size: Array) -> list[Concern]:
    """Name the observations whose normalised residuals, shape (m,), exceed the critical value, the worst first."""
    limit = _limit(problem)
    bad = np.flatnonzero(size > limit)
    if not len(bad):
        return []
    listed = named(network, problem, bad, size)
    text = f"{len(bad)} observations look like gross errors (normalised residual above {limit:.1f}): {listed}"
    return [Concern("doubtful", text, about="blunders")]


def named(network: Network, problem: Problem, bad: Ints, size: Array, most: int = 5) -> str:
    """Name observations by station and point with their sizes, shape (m,), the worst first, whole stations as one."""
    station, point = network.observation_station[problem.order], network.observation_point[problem.order]
    count, all_of = np.bincount(station[bad], minlength=station.max() + 1), np.bincount(station)
    names: list[str] = []
    told: set[int] = set()
    for o in bad[np.argsort(-size[bad])]:
        s = int(station[o])
        if s in told:
            continue
        name = f"station {network.station_names[s]}"
        if count[s] > WHOLE * all_of[s]:
            told.add(s)
            names.append(f"{name}, {count[s]} of its {all_of[s]} points (up to {size[o]:.1f})")
        else:
            names.append(f"{name} point {network.point_names[point[o]]} ({size[o]:.1f})")
    return "; ".join(names[:most])
