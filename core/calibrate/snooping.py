"""Gross errors found by the residuals they leave (data snooping)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from core.calibrate.equations import Equations
from core.calibrate.problem import Problem
from core.model import Network

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_REDUNDANCY = 0.05  # an observation checked less than this cannot be judged by its residual
SURE = 0.3  # of the worst normalised residual: errors that are smaller may be its shadow
ERROR_LEVEL = 0.01  # chance that one report appears among observations that are all good


def normalised_residuals(problem: Problem, equations: Equations, numbers: Array) -> Array:
    """Residuals over their own standard deviations, shape (m, 2), NaN where unobserved or unchecked.

    The standard deviation of unit weight is the lesser of the adjustment's and a robust one, the median, which gross
    errors do not raise. Source: Baarda, *A testing procedure for use in geodetic networks*, 1968.
    """
    checked = numbers > LEAST_REDUNDANCY
    with np.errstate(invalid="ignore"):
        residuals = np.where(checked, equations.w / np.sqrt(np.where(checked, numbers, 1.0)), np.nan)
    if not checked.any():
        return residuals
    robust = float(np.nanmedian(np.abs(residuals))) / 0.6745
    sigma0 = float(np.sqrt(equations.cost / problem.redundancy))
    unit = min(robust, sigma0) if np.count_nonzero(checked) > 50 else sigma0
    return residuals / unit if unit > 1e-6 else np.where(checked, 0.0, np.nan)


def critical_value(observations: int) -> float:
    """Normalised residual that good observations exceed once in `1 / ERROR_LEVEL` adjustments of this size."""
    return float(-ndtri(ERROR_LEVEL / (2 * max(observations, 1))))


def gross_errors(problem: Problem, equations: Equations, numbers: Array, limit: float) -> Ints:
    """Observations beyond a limit that are sure to be wrong: gross errors make good observations look bad.

    Those are the worst of each pose and of each point, not much smaller than the worst of all. Ask again without them.
    """
    size = np.max(np.abs(_both(normalised_residuals(problem, equations, numbers))), axis=1)
    bad = np.flatnonzero(size > max(limit, SURE * float(size.max(initial=0.0))))
    taken: list[int] = []
    poses, points = set(), set()
    for o in bad[np.argsort(-size[bad])]:
        if problem.pose[o] not in poses and problem.point[o] not in points:
            taken.append(int(o))
            poses.add(problem.pose[o])
            points.add(problem.point[o])
    return np.array(taken, dtype=np.int64)


def _both(values: Array) -> Array:
    return np.where(np.isnan(values), 0.0, values)


def outlier_warning(network: Network, problem: Problem, normalised: Array, most: int = 5) -> list[str]:
    """Name the observations whose normalised residuals exceed the critical value, the worst first."""
    size = np.max(np.abs(_both(normalised)), axis=1)
    limit = critical_value(int(np.count_nonzero(problem.root_weight)))
    bad = np.flatnonzero(size > limit)
    if not len(bad):
        return []
    worst = bad[np.argsort(-size[bad])][:most]
    station, point = network.observation_station[problem.order], network.observation_point[problem.order]
    listed = "; ".join(
        f"station {network.station_names[station[o]]} point {network.point_names[point[o]]} ({size[o]:.1f})"
        for o in worst
    )
    return [f"{len(bad)} observations look like gross errors (normalised residual above {limit:.1f}): {listed}"]
