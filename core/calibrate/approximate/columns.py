"""A device of which one image coordinate was never observed: a projector whose columns only were coded.

It knows planes instead of rays. They all contain the projection centre and the image's y axis, so that the place of the
centre along that axis is not observable, nor are y0 (the same), A3 (the same as c), A4 (the same as a roll) and A5 (the
same as a tilt about x, but for its square).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.calibrate.selection import Warnings
from core.calibrate.solution.problem import RELATIVE, Problem, never_observed
from core.geometry import Pose, estimated, lens_of
from core.model import Array, Network

LEAST_POINTS = 12
PLAUSIBLE = 1.5  # ratio to the nominal focal length up to which that of the resection is used
# with the affine parameters, where a coordinate was never observed: a principal point, and which decentring parameter
UNOBSERVABLE = {"v": ("y0", 0), "u": ("x0", 1)}


def without_unobservable(network: Network) -> tuple[Network, Warnings]:
    """Hold what a device with one observed coordinate cannot tell, and say so."""
    devices = dict(network.devices)
    warnings: Warnings = []
    for name, coordinate in never_observed(network).items():
        device = devices[name]
        free = estimated(device)
        (centre, which), lens = UNOBSERVABLE[coordinate], lens_of(device.spec)
        lost = (centre, *lens.of_kind("affine"), lens.of_kind("decentring")[which])
        held = [p for p in lost if p in free]
        devices[name] = replace(device, estimate=tuple(p for p in free if p not in held))
        axis = "x" if coordinate == "u" else "y"
        warnings.append(
            f"{name}: {coordinate} was never observed: {', '.join([*held, f'and its place along its {axis} axis'])} "
            "held at 0"
        )
    return replace(network, devices=devices), warnings


def resect_columns(
    problem: Problem, device: int, interior: Array, rotation: Array, shift: Array
) -> tuple[Pose, Array] | None:
    """Orientation relative to the base device, and interior orientation, from one coordinate at all known poses.

    c and principal point of the nominal `interior` are replaced where they come out plausible; `rotation` (P, 3, 3) and
    `shift` (P, 3), NaN where unknown, are ``base_from_object``. None where the points are too few or in one plane. ``x
    = p1 . P / p3 . P`` with P homogeneous in the base device's frame is linear in the two rows p1 and p3 (direct linear
    transformation of a line camera).
    """
    own = np.flatnonzero((problem.device == device) & np.isfinite(shift[problem.pose, 0]))
    axis = int(not np.any(problem.root_weight[own, 0] > 0))
    if len(own) < LEAST_POINTS:
        return None
    points = np.einsum("oij,oj->oi", rotation[problem.pose[own]], problem.approximate[problem.point[own]])
    points += shift[problem.pose[own]]
    offset = problem.uv[own, axis] - problem.raster[device, 2 + axis]
    image = offset * problem.raster[device, axis] * (1 if axis == 0 else -1)
    centre, size, radius = points.mean(axis=0), points.std(), np.abs(image).max()
    local = np.column_stack([(points - centre) / size, np.ones(len(points))])
    A = np.column_stack([local, -local * (image / radius)[:, None]])
    values, rows = np.linalg.svd(A, full_matrices=False)[1:]
    if values[-2] < 1e-4 * values[0]:
        return None
    # back to millimetres and to the base device's origin
    p = rows[-1].reshape(2, 4) * [[radius], [1.0]] / [size, size, size, 1.0]
    p[:, 3] -= p[:, :3] @ centre
    scale = np.linalg.norm(p[1, :3]) * (-1 if np.sum(p[1, :3] * centre) + p[1, 3] > 0 else 1)
    p /= scale
    view, principal = p[1, :3], float(p[0, :3] @ p[1, :3])
    along = principal * view - p[0, :3]
    c = float(np.linalg.norm(along))
    along, place = along / c, (principal * p[1, 3] - p[0, 3]) / c
    across = np.cross(view, along) if axis == 0 else np.cross(along, view)
    R = np.array([along, across, view] if axis == 0 else [across, along, view])
    t = np.array([place, 0.0, p[1, 3]] if axis == 0 else [0.0, place, p[1, 3]])
    found = interior.copy()
    if 1 / PLAUSIBLE < c / interior[0] < PLAUSIBLE and problem.columns[device, RELATIVE] >= 0:
        found[0] = c
        found[1 + axis] = principal if problem.columns[device, RELATIVE + 1 + axis] >= 0 else 0.0
    return Pose(R, t), found
