"""The datum of a free network: inner constraints on all points, onto their approximate coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.calibrate.problem import Problem, State

Array = NDArray[np.float64]


def datum_columns(xyz: Array, defect: int) -> Array:
    """Shifts, turns and (for a defect of 7) the change of scale of points, shape (3n, defect), orthonormal columns.

    Parameters
    ----------
    xyz : array, shape (n, 3)
        Points, mm.
    defect : int
        7, or 6 where a measured distance gives the scale.

    Examples
    --------
    >>> D = datum_columns(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), 7)
    >>> np.allclose(D.T @ D, np.eye(7))
    True
    """
    return np.linalg.qr(_movements(xyz - xyz.mean(axis=0)))[0][:, :defect]


def _movements(xyz: Array) -> Array:
    """Three shifts, three turns, one change of scale about the origin, as columns, shape (3n, 7)."""
    H = np.zeros((len(xyz), 3, 7))
    H[:, :, :3] = np.eye(3)
    x, y, z = xyz.T
    H[:, 1, 3], H[:, 2, 3] = -z, y
    H[:, 0, 4], H[:, 2, 4] = z, -x
    H[:, 0, 5], H[:, 1, 5] = -y, x
    H[:, :, 6] = xyz
    return H.reshape(-1, 7)


def null_space(problem: Problem, state: State) -> Array:
    """Changes of globals and points that no observation sees, shape (globals + 3n, defect).

    A change of scale stretches a rigid rig's base with the points; shifts and turns are absorbed by the poses.
    """
    G = problem.globals
    H = np.zeros((G + 3 * problem.points, problem.defect))
    H[G:] = _movements(state.xyz - state.xyz.mean(axis=0))[:, : problem.defect]
    if problem.defect == 7:
        for d, columns in enumerate(problem.columns):
            for column, length in zip(columns[12:15], state.relative_shift[d], strict=True):
                if column >= 0:
                    H[column, 6] = length
    return H


def aligned(problem: Problem, state: State) -> State:
    """Lay a state onto the approximate points: the similarity (with measured distance: movement) of least squares.

    Source: Umeyama, *Least-squares estimation of transformation parameters*, IEEE PAMI 13 (1991).
    """
    target_mean, mean = problem.approximate.mean(axis=0), state.xyz.mean(axis=0)
    target, xyz = problem.approximate - target_mean, state.xyz - mean
    U, S, Vt = np.linalg.svd(target.T @ xyz)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U * signs) @ Vt
    scale = float(np.sum(S * signs) / np.sum(xyz * xyz)) if problem.defect == 7 else 1.0
    # X_new = scale R (X - mean) + target_mean; the poses see the same rays as before
    pose_rotation = state.pose_rotation @ R.T
    shift = scale * np.einsum("pij,j->pi", state.pose_rotation, mean)
    pose_shift = scale * state.pose_shift + shift - np.einsum("pij,j->pi", pose_rotation, target_mean)
    return State(
        state.interior,
        state.relative_rotation,
        scale * state.relative_shift,
        pose_rotation,
        pose_shift,
        scale * xyz @ R.T + target_mean,
    )
