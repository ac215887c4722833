"""A device of which one image coordinate was never observed: a projector whose columns only were coded.

It knows planes instead of rays. They all contain the projection centre and the image's y axis, so that the place of the
centre along that axis is not observable, nor are y0 (the same), A3 (the same as c), A4 (the same as a roll) and A5 (the
same as a tilt about x, but for its square). Distortion bends the planes: x is moved by r², in which y is, so that it
tells the place along y, and so much the better the stronger it is. y0 and A3 stay as they are; what distortion tells of
A4 and A5 is far less than is known of any lens.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from core.calibrate.selection import Warnings
from core.calibrate.solution.elimination import reduce
from core.calibrate.solution.normals import SingularNormalsError, solve_factor
from core.calibrate.solution.problem import ALONG, RELATIVE, Problem, never_observed, problem_of
from core.calibrate.solution.state import State, poses_in_devices
from core.geometry import Pose, estimated, lens_of
from core.geometry.lens import MAIN
from core.model import Array, Network

LEAST_POINTS = 12
PLAUSIBLE = 1.5  # ratio to the nominal focal length up to which that of the resection is used
# with the affine parameters, where a coordinate was never observed: a principal point, and which decentring parameter
UNOBSERVABLE = {"v": ("y0", 0), "u": ("x0", 1)}
TOLD = 0.05  # of its distance from the points: sigma of a place that is adjusted; rigs seldom stand farther from 0


def unobservable(network: Network) -> dict[str, tuple[str, ...]]:
    """Name what devices with one observed coordinate cannot tell of their interior orientation."""
    lost = {}
    for name, coordinate in never_observed(network).items():
        (centre, which), lens = UNOBSERVABLE[coordinate], lens_of(network.devices[name].spec)
        lost[name] = (centre, *lens.of_kind("affine"), lens.of_kind("decentring")[which])
    return lost


def without_unobservable(network: Network) -> Network:
    """Hold what a device with one observed coordinate cannot tell."""
    devices = dict(network.devices)
    for name, lost in unobservable(network).items():
        free = tuple(p for p in estimated(devices[name]) if p not in lost)
        devices[name] = replace(devices[name], estimate=free)
    return replace(network, devices=devices)


def unobserved_words(given: Network, network: Network, sigmas_mm: dict[str, float]) -> Warnings:
    """Say what is held in a network, and was not as it was given, and to which sigma distortion tells places."""
    words: Warnings = []
    for name, coordinate in never_observed(given).items():
        free = estimated(network.devices[name])
        held = [p for p in estimated(given.devices[name]) if p not in free]
        axis = "x" if coordinate == "u" else "y"
        told = sigmas_mm.get(name) if network.devices[name].along else None
        if told is None:
            held.append(f"and its place along its {axis} axis")
        if held:
            words.append(f"{name}: {coordinate} was never observed: {', '.join(held)} held at 0")
        if told is not None:
            words.append(f"{name}: its place along its {axis} axis is told by its distortion alone, to {told:.2g} mm")
    return words


def placed(network: Network, names: Collection[str]) -> Network:
    """Adjust the places of those devices along the axis of a coordinate never observed, too, and of no others."""
    devices = {name: replace(device, along=name in names) for name, device in network.devices.items()}
    return replace(network, devices=devices)


def alone(network: Network) -> Network:
    """Hold of devices with one observed coordinate what images that stand for themselves do not tell.

    One coordinate of a plane has five parameters, ``x = (a X + b Y + c) / (d X + e Y + 1)``, as many as a pose without
    its place along the other axis: c and principal point are told by what images have in common alone.
    """
    devices = dict(network.devices)
    for name in never_observed(network):
        free = tuple(p for p in estimated(devices[name]) if p not in MAIN)
        devices[name] = replace(devices[name], estimate=free, along=False)
    return replace(network, devices=devices)


def told_places(network: Network, problem: Problem, state: State, variance: float) -> dict[str, float]:
    """Sigmas, mm, of the places along the axis of a coordinate never observed, where distortion tells them.

    `variance` is that of unit weight. Where the sigma is larger than what one knows of any rig, nothing is won.
    """
    sigmas = {}
    for name, coordinate in never_observed(network).items():
        d = problem.device_names.index(name)
        whole = replace(problem, columns=problem_of(placed(network, [name])).columns)
        if (place := int(whole.columns[d, ALONG[coordinate]])) < 0:
            continue  # of a device that stands for itself, every station has a place of its own
        try:
            reduced = reduce(whole, state)
            unit = np.zeros(len(reduced.right))
            unit[place] = 1.0
            sigma = float(np.sqrt(variance * solve_factor(reduced.factor, unit)[place]))
        except SingularNormalsError:
            continue
        if sigma < TOLD * _distance(problem, state, d):
            sigmas[name] = sigma
    return sigmas


def unplaced(network: Network, problem: Problem, state: State) -> State:
    """Put devices back to 0 whose places along the axis of a coordinate never observed are not adjusted."""
    shift = state.relative_shift.copy()
    for name, coordinate in never_observed(network).items():
        d = problem.device_names.index(name)
        if problem.base[d] != d and not network.devices[name].along:
            shift[d, ALONG[coordinate] - ALONG["u"]] = 0.0
    return replace(state, relative_shift=shift)


def _distance(problem: Problem, state: State, device: int) -> float:
    """Median distance of a device from its points, along its viewing axis, mm."""
    R, t = poses_in_devices(problem, state)
    own = problem.device == device
    return float(np.median(-np.einsum("mj,mj->m", R[own, 2], state.xyz[problem.point[own]]) - t[own, 2]))


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
