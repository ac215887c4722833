"""Errors that observations have in common, taken through the adjustment: without them its sigmas are too small.

The targets of one image share the shifts of the rows that they share, and a projector coordinate is read at the
camera's measured centre. The adjustment weighs all observations as if they were independent, which costs little; with
A its whitened equations and ``I + E`` their true covariance the cofactors of the unknowns are ``Q + Q AᵀEA Q``. The
unknowns follow what observations have in common: residuals are smaller for it than their redundancy says, by
``tr(Q AᵀEA)`` in all squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from core.calibrate.solution.equations import GLOBALS, POINT, POSE
from core.calibrate.solution.solve import Solved
from core.model import Array, Ints, Network, TargetSet


def with_shared_errors(solved: Solved, targets: Sequence[TargetSet]) -> Solved:
    """Give a solution whose cofactors of points and globals, and variance factors, hold what its targets share."""
    problem, inverse, U = solved.problem, solved.inverse, len(solved.inverse.Q)
    C = inverse.C.reshape(-1, U)
    # unknowns as they are kept, then those eliminated, and a last one for what is held
    pose_at, point_at = (problem.globals, U) if problem.by_points else (U, problem.globals)
    common = [*range(GLOBALS, GLOBALS + problem.columns.shape[1]), *range(POSE, POSE + 6)]
    found = np.zeros((U + len(C) + 1, U + len(C) + 1))
    n = problem.points
    of_points = np.zeros((3, 3, n, n))
    place = np.argsort(problem.order)
    for k, t in enumerate(targets):
        rows, known = _observations(solved.network, t, t.capture or str(k + 1))
        some = np.flatnonzero(known.any(axis=1))
        if not len(some):
            continue
        at, known = place[rows[some]], known[some]
        weight = np.where(known[..., None], problem.root_weight[at], 0.0).reshape(-1, 4)
        A = solved.equations.J[at].reshape(len(some), 4, -1) * (weight > 0)[..., None]
        # where residuals say that sigmas are smaller than given, what is shared is smaller, too
        weight = np.fmin(weight, 1 / solved.network.observation_sigma[rows[some]].reshape(-1, 4))
        cov = np.nan_to_num(t.cov[some]) * weight[:, :, None] * weight[:, None, :]
        cov[:, range(4), range(4)] = 0.0
        by_row = weight[..., None] * (t.by_row[some] @ _root(t.row_shifts))
        share = t.row_share[np.ix_(some, some)]
        np.fill_diagonal(share, 0.0)
        # by what all targets of an image have in common, camera and projector each, and by the target's own point
        c, one = len(common), at[np.argmax(known, axis=0), [0, 1]]
        own, by_point = np.zeros((len(some), 4, 2 * c)), A[:, :, POINT : POINT + 3]
        own[:, :2, :c], own[:, 2:, c:] = A[:, :2, common], A[:, 2:, common]
        poses = pose_at + 6 * problem.pose[one][:, None] + np.arange(6)
        all_of = np.concatenate([problem.columns[problem.device[one]], poses], axis=1).ravel()
        points = problem.point[np.where(known[:, 0], at[:, 0], at[:, 1])]
        each = (point_at + 3 * points[:, None] + np.arange(3)).ravel()
        moved, moved_points = (np.swapaxes(by_row, 1, 2) @ part for part in (own, by_point))  # (targets, shifts, ...)
        carried = np.tensordot(share, moved, 1)
        shared = cov @ own
        of_all = own.reshape(-1, 2 * c).T @ shared.reshape(-1, 2 * c) + np.tensordot(moved, carried, ((0, 1), (0, 1)))
        between = np.swapaxes(shared, 1, 2) @ by_point + np.swapaxes(carried, 1, 2) @ moved_points
        between = between.transpose(1, 0, 2).reshape(2 * c, -1)
        share_of, moved_of, of_each = np.zeros((n, n)), np.zeros((3, n, by_row.shape[2])), np.zeros((n, 3, 3))
        share_of[np.ix_(points, points)], moved_of[:, points] = share, moved_points.transpose(2, 0, 1)
        of_each[points] = np.swapaxes(by_point, 1, 2) @ cov @ by_point
        for i, j in combinations_with_replacement(range(3), 2):
            part = moved_of[i] @ moved_of[j].T
            part *= share_of
            part.flat[:: n + 1] += of_each[:, i, j]
            of_points[i, j] += part
        np.add.at(found, np.ix_(all_of, all_of), of_all)
        for half in (slice(c), slice(c, 2 * c)):  # of one device; none stands twice in it
            found[np.ix_(all_of[half], each)] += between[half]
            found[np.ix_(each, all_of[half])] += between[half].T
    for i, j in ((1, 0), (2, 0), (2, 1)):
        of_points[i, j] = of_points[j, i].T
    found[point_at : point_at + 3 * n, point_at : point_at + 3 * n] = of_points.transpose(2, 0, 3, 1).reshape(3 * n, -1)
    found = found[:-1, :-1]
    Q = np.concatenate([inverse.Q, -C @ inverse.Q])
    carried = found @ Q
    blocks = U + np.arange(len(C)).reshape(inverse.C.shape[:2])
    of_blocks = found[blocks[:, :, None], blocks[:, None, :]]
    followed = np.trace(carried[:U]) - np.sum(C * carried[U:]) + np.sum(inverse.Q_own * of_blocks)
    left = 1.0 - float(followed) / problem.redundancy
    factors = {name: f if f == 1 else f / left for name, f in solved.factors.items()}  # 1: none was estimated
    Q_own = inverse.Q_own
    if problem.by_points:  # apart from what the datum makes points share
        across = Q_own @ carried[U:].reshape(inverse.C.shape) @ np.swapaxes(inverse.C, 1, 2)
        Q_own = (Q_own + Q_own @ of_blocks @ Q_own - across - np.swapaxes(across, 1, 2)) / left
    return replace(solved, inverse=replace(inverse, Q=(inverse.Q + Q.T @ carried) / left, Q_own=Q_own), factors=factors)


def _root(cov: Array | None) -> Array:
    """Columns (3, r) whose products are a covariance (3, 3)."""
    if cov is None:
        return np.zeros((3, 0))
    size, along = np.linalg.eigh(cov)
    return np.asarray((along * np.sqrt(np.maximum(size, 0.0)))[:, size > 0])


def _observations(network: Network, targets: TargetSet, capture: str) -> tuple[Ints, NDArray[np.bool_]]:
    """Numbers of every target's observations by camera and projector, shape (n, 2), and whether they were adjusted."""
    known = np.zeros((len(targets.row), 2), bool)
    rows = np.zeros(known.shape, np.int64)
    target = {key: i for i, key in enumerate(targets.keys)}
    of_point = np.array([target.get((p.row, p.col), -1) for p in network.point_ids])
    pairs = (targets.camera, targets.projector), (targets.projector, targets.camera)
    for s, station in enumerate(network.station_ids):
        for side, (device, other) in enumerate(pairs):
            if (station.capture, station.device) == (capture, device) and station.by in ("", other):
                own = np.flatnonzero(network.observation_station == s)
                i = of_point[network.observation_point[own]]
                rows[i, side], known[i, side] = own, True
    return rows, known
