"""The unknowns of an adjustment: where they stand, as the kernels take them, and moved by a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from core.calibrate.solution.problem import RELATIVE, Problem
from core.geometry import LENSES, Pose, matrix_from_rotation_vector
from core.lazy import dataclass
from core.model import Array, Interior


@dataclass(frozen=True)
class State:
    """The unknowns: interior (D, K), relative orientations, poses and points less the problem's origin."""

    interior: Array
    relative_rotation: Array
    relative_shift: Array
    pose_rotation: Array
    pose_shift: Array
    xyz: Array


class Unknowns(NamedTuple):
    """Arrays of a `State` as the kernels take them.

    The last three are of the observations through lenses that the kernels do not know: the image (m, 2), and its
    derivatives by the collinearity image (m, 2, 2) and by the parameters (m, 2, K); empty where there are none.
    """

    interior: Array
    relative_rotation: Array
    relative_shift: Array
    pose_rotation: Array
    pose_shift: Array
    xyz: Array
    image: Array
    by_xy: Array
    by_parameter: Array


@dataclass(frozen=True)
class Step:
    """A change of the unknowns, and the decrease of vᵀPv the linear model promises for it."""

    z: Array  # (globals,)
    pose: Array  # (poses, 6)
    xyz: Array  # (points, 3)
    gain: float


def unknowns_of(problem: Problem, state: State, derive: bool = True) -> Unknowns:
    """Give a state as the kernels take it, with the images through lenses that they do not know."""
    arrays = {name: np.ascontiguousarray(array) for name, array in vars(state).items()}
    if not problem.other.any():
        return Unknowns(**arrays, image=np.empty((0, 2)), by_xy=np.empty((0, 2, 2)), by_parameter=np.empty((0, 2, 0)))
    m, K = len(problem.point), state.interior.shape[1]
    image, by_xy, by_parameter = np.zeros((m, 2)), np.zeros((m, 2, 2)), np.zeros((m, 2, K))
    for d in np.flatnonzero(problem.other):
        own = np.flatnonzero(problem.device == d)
        turned = np.einsum("oij,oj->oi", state.pose_rotation[problem.pose[own]], state.xyz[problem.point[own]])
        placed = (turned + state.pose_shift[problem.pose[own]]) @ state.relative_rotation[d].T
        X, Y, Z = (placed + state.relative_shift[d]).T
        interior, lens = interior_of(problem, state, int(d)), LENSES[problem.models[d]]
        Z = np.where(Z < 0, Z, -1.0)  # what is behind is told by the kernels
        xy = np.stack([X, Y], axis=-1) * (-interior.c_mm / Z)[:, None]
        with np.errstate(all="ignore"):
            image[own] = lens.distort(interior, xy)
            if derive:
                by_xy[own], by_parameter[own, :, : len(lens.names)] = lens.derivatives(interior, xy)
    return Unknowns(**arrays, image=image, by_xy=by_xy, by_parameter=by_parameter)


def poses_in_devices(problem: Problem, state: State) -> tuple[Array, Array]:
    """Rotations (m, 3, 3) and shifts (m, 3) that lead from the points into the device of every observation."""
    turn = state.relative_rotation[problem.device]
    shift = np.einsum("mij,mj->mi", turn, state.pose_shift[problem.pose]) + state.relative_shift[problem.device]
    return turn @ state.pose_rotation[problem.pose], shift


def interior_of(problem: Problem, state: State, device: int) -> Interior:
    """Interior orientation of a device at a state."""
    model = problem.models[device]
    values = state.interior[device, : len(LENSES[model].names)]
    return Interior.from_vector(values, float(problem.r0[device]), model)


def moved(problem: Problem, state: State, step: Step) -> State:
    """Apply a step to the unknowns."""
    interior, relative_rotation, relative_shift = (
        state.interior.copy(),
        state.relative_rotation.copy(),
        state.relative_shift.copy(),
    )
    for d, columns in enumerate(problem.columns):
        places = columns[RELATIVE:]
        free = places >= 0
        interior[d, free] += step.z[places[free]]
        if columns[0] >= 0:
            relative_rotation[d] = matrix_from_rotation_vector(step.z[columns[:3]]) @ relative_rotation[d]
            relative_shift[d] += np.where(columns[3:6] >= 0, step.z[columns[3:6]], 0.0)
    turns = matrix_from_rotation_vector(step.pose[:, :3])
    xyz = state.xyz + step.xyz if problem.points_free else state.xyz
    return State(
        interior,
        relative_rotation,
        relative_shift,
        turns @ state.pose_rotation,
        state.pose_shift + step.pose[:, 3:],
        xyz,
    )


def station_orientations(problem: Problem, state: State) -> tuple[Pose, ...]:
    """``station_from_object`` of every station, in the network's own coordinates."""
    result = []
    for device, pose in zip(problem.station_device, problem.station_pose, strict=True):
        R, t = state.pose_rotation[pose], state.pose_shift[pose]
        base_from_object = Pose(R, t - R @ problem.origin_mm)
        result.append(Pose(state.relative_rotation[device], state.relative_shift[device]) @ base_from_object)
    return tuple(result)
