"""The datum of a free network: inner constraints on all points, onto their approximate coordinates."""

from __future__ import annotations

import numpy as np

from core.calibrate.solution.problem import Problem, movements
from core.calibrate.solution.state import State
from core.errors import InputError
from core.geometry import similarity
from core.model import Array, Network

OPEN = 0.1  # of the field, by which coordinates known before leave its rim to move


def datum_columns(xyz: Array, free: Array) -> Array:
    """Movements of points (n, 3) that nothing else determines, shape (3n, defect), orthonormal columns.

    `free`, (7, defect), combines shifts, turns and change of scale, see `Problem.free_movements`.

    Examples
    --------
    >>> D = datum_columns(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.eye(7))
    >>> np.allclose(D.T @ D, np.eye(7))
    True
    """
    return np.linalg.qr(movements(xyz - xyz.mean(axis=0)) @ free)[0]


def null_space(problem: Problem, state: State) -> Array:
    """Changes of globals and points that no observation sees, shape (globals + 3n, defect).

    A change of scale stretches a rigid rig's base with the points; shifts and turns are absorbed by the poses.
    """
    G = problem.globals
    H = np.zeros((G + 3 * problem.points, problem.defect))
    free = problem.free_movements
    H[G:] = movements(state.xyz - state.xyz.mean(axis=0)) @ free
    for d, columns in enumerate(problem.columns):
        for column, length in zip(columns[3:6], state.relative_shift[d], strict=True):
            if column >= 0:
                H[column] = length * free[6]
    return H


def check_known(network: Network) -> None:
    """Refuse coordinates known before that leave a turn or the scale of the field open, though not wholly.

    What they do not touch at all is the datum's; what they hardly touch lets every point move by more than images say.
    """
    sigma = network.point_sigma_mm
    if sigma is None or not np.any(known := np.isfinite(sigma) & (sigma > 0)) or np.any(sigma == 0):
        return
    local = network.point_xyz_mm - network.point_xyz_mm.mean(axis=0)
    size = max(float(np.abs(local).max()), 1e-12)
    rows = movements(local / size)[known.ravel()] / sigma[known][:, None]
    if network.scale or network.lengths:
        rows = rows[:, :6]
    weights = np.linalg.svd(np.vstack([rows, np.zeros((7, rows.shape[1]))]), full_matrices=False)[1]
    open_mm = 1 / min(w for w in weights if w > 1e-9 * weights[0])
    if open_mm > OPEN * size:
        axes = " and ".join(f"{name}_mm" for k, name in enumerate("xyz") if np.any(known[:, k]))
        raise InputError(
            "points.csv",
            f"sigmas of {axes} of {np.count_nonzero(known.any(axis=1))} points leave a turn or the scale of the field "
            f"open to {open_mm:.2g} mm",
            "give sigmas of x, y and z of three points that lie far apart, or of none",
        )


def aligned(problem: Problem, state: State) -> State:
    """Lay a state onto the approximate points: the similarity (with measured distance: movement) of least squares.

    Where points are known before, it stays where they put it.
    """
    if problem.point_weight.any():
        return state
    scale, R, shift = similarity(state.xyz, problem.approximate, scaled=problem.defect == 7)
    # the poses see the same rays as before
    pose_rotation = state.pose_rotation @ R.T
    pose_shift = scale * state.pose_shift - np.einsum("pij,j->pi", pose_rotation, shift)
    return State(
        state.interior,
        state.relative_rotation,
        scale * state.relative_shift,
        pose_rotation,
        pose_shift,
        scale * state.xyz @ R.T + shift,
    )
