"""The lens of an adjusted device: would parameters that were not estimated explain its residuals?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.checks.network import AGREEING, DOUBTFUL_RATIO, LEVEL
from core.geometry import estimated, project_with_derivatives
from core.geometry.lens import MAIN, lens_of
from core.model import Adjustment, Array, Concern, Ints
from core.numerics import chi_square_limit, distinct

EXPLAINED = 0.1  # share of the squared residuals from which a parameter that is not estimated matters
ROUNDS = 20  # by which its derivatives are cleared of what is estimated


def lens_concerns(adjustment: Adjustment) -> list[Concern]:
    """Name lens parameters that were left at zero, though the residuals ask for them."""
    return [concern for name in adjustment.devices for concern in _left_at_zero(adjustment, name)]


def _left_at_zero(adjustment: Adjustment, name: str) -> list[Concern]:
    """H0: the usual parameters that are not estimated explain nothing of the residuals; a score test."""
    network, device = adjustment.network, adjustment.network.devices[name]
    lens = lens_of(device.spec)
    wanted = estimated(device)
    left = [k for k, p in enumerate(lens.names) if p in lens.usual and p not in wanted and k >= len(MAIN)]
    own = np.flatnonzero(np.array(network.station_device)[network.observation_station] == name)
    if not left or device.spec.interior is not None or not len(own):
        return []
    weight = np.where(np.isfinite(adjustment.residuals[own]), 1 / network.observation_sigma[own], 0.0)
    w = np.nan_to_num(adjustment.residuals[own]) * weight
    gain = _explained(adjustment, own, weight, w, left, [k for k, p in enumerate(lens.names) if p in wanted])
    share = gain / max(float(np.sum(w**2)), 1e-300)
    if share < EXPLAINED or gain < DOUBTFUL_RATIO**2 * chi_square_limit(len(left), LEVEL):
        return []
    names = ", ".join(lens.names[k] for k in left)
    text = (
        f"{name}: estimating {names} would explain {share:.0%} of the squared residuals (score test): do so, or give "
        "the interior orientation if it is known"
    )
    return [Concern("failed" if share > AGREEING else "doubtful", text)]


def _explained(
    adjustment: Adjustment, own: Ints, weight: Array, w: Array, left: Sequence[int], free: Sequence[int]
) -> float:
    """By how much the sum of squares of a device's weighted residuals w (m, 2) would fall with more of its parameters.

    Their derivatives are cleared in turn of what stations, points and the parameters estimated do. What a few rounds
    leave in them makes the answer smaller.
    """
    network, station = adjustment.network, adjustment.network.observation_station[own]
    device = adjustment.devices[network.station_device[station[0]]]
    by_pose, by_point, inner = (np.zeros((*w.shape, size)) for size in (6, 3, len(device.interior.vector)))
    point = network.observation_point[own]
    for s in distinct(station):
        here = station == s
        xyz, pose = adjustment.points_mm[point[here]], adjustment.station_from_object[s]
        found = project_with_derivatives(device.spec, device.interior, xyz, pose)
        by_pose[here], by_point[here], inner[here] = found.by_pose, found.by_point, found.by_interior
    by_pose, by_point, inner = (np.nan_to_num(each) * weight[..., None] for each in (by_pose, by_point, inner))
    inner /= np.maximum(np.sqrt(np.sum(inner**2, axis=(0, 1))), 1e-300)
    rest = inner[..., left]
    for _ in range(ROUNDS):
        for block, group in ((by_pose, station), (by_point, point), (inner[..., free], np.zeros_like(point))):
            rest = _cleared(rest, block, group)
    rest = rest.reshape(-1, len(left))
    return float(np.sum((rest @ np.linalg.lstsq(rest, w.ravel(), rcond=1e-6)[0]) ** 2))


def _cleared(columns: Array, block: Array, group: Ints) -> Array:
    """Take out of columns (m, 2, k) what a block (m, 2, c) of unknowns explains that each group has of its own."""
    normal = np.zeros((group.max() + 1, block.shape[2], block.shape[2]))
    right = np.zeros((len(normal), block.shape[2], columns.shape[2]))
    turned = np.swapaxes(block, 1, 2)
    np.add.at(normal, group, turned @ block)
    np.add.at(right, group, turned @ columns)
    return np.asarray(columns - block @ (np.linalg.pinv(normal, hermitian=True) @ right)[group])
