"""Errors that observations have in common, taken through the adjustment: without them its sigmas are too small.

The targets of one image share the shifts of the rows that they share, and a projector coordinate is read at the
camera's measured centre. The adjustment weighs all observations as if they were independent, which costs little; with
A its whitened equations and ``I + E`` their true covariance the cofactors of the unknowns are ``Q + Q AᵀEA Q``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.calibrate.adjust import Solved
from core.calibrate.normals import reduced_equations
from core.model import Network, TargetSet

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def with_shared_errors(solved: Solved, targets: Sequence[TargetSet]) -> Solved:
    """Give a solution whose cofactors of all kept unknowns hold what its targets share."""
    found = np.zeros_like(solved.inverse.Q)
    place = np.argsort(solved.problem.order)
    for k, t in enumerate(targets):
        rows, known = _observations(solved.network, t, t.capture or str(k + 1))
        if not known.any():
            continue
        at = place[rows]
        weight = np.where(known[..., None], solved.problem.root_weight[at], 0.0).reshape(-1, 4)
        A = reduced_equations(solved.problem, solved.equations.J, solved.inverse.C, at.ravel())
        A = A.reshape(len(rows), 4, -1) * (weight > 0)[..., None]
        seen = np.flatnonzero(A.any(axis=(0, 1)))
        A = A[:, :, seen]
        # where residuals say that sigmas are smaller than given, what is shared is smaller, too
        weight = np.fmin(weight, 1 / solved.network.observation_sigma[rows].reshape(-1, 4))
        cov = np.nan_to_num(t.cov) * weight[:, :, None] * weight[:, None, :]
        cov = np.triu(cov, 1)[:, :3]  # of a symmetric sum one half is enough
        half = A[:, :3].reshape(-1, len(seen)).T @ (cov @ A).reshape(-1, len(seen))
        part = half + half.T
        if t.row_shift_px:
            by_u = np.zeros((len(rows), 4))
            by_u[:, 0] = 1.0
            by_u[:, 2:] = 0.0 if t.gradient is None else np.nan_to_num(t.gradient[:, :, 0])
            moved = np.einsum("na,nau->nu", by_u * weight, A)
            cov_u = t.row_cov
            np.fill_diagonal(cov_u, 0.0)
            part += moved.T @ cov_u @ moved
        found[np.ix_(seen, seen)] += part
    Q = solved.inverse.Q
    return replace(solved, inverse=replace(solved.inverse, Q=Q + Q @ found @ Q))


def _observations(network: Network, targets: TargetSet, capture: str) -> tuple[Ints, NDArray[np.bool_]]:
    """Numbers of every target's observations by camera and projector, shape (n, 2), and whether they were adjusted."""
    known = np.zeros((len(targets.row), 2), bool)
    rows = np.zeros(known.shape, np.int64)
    target = {key: i for i, key in enumerate(zip(targets.row.tolist(), targets.col.tolist(), strict=True))}
    of_point = np.array([target.get((p.row, p.col), -1) for p in network.point_ids])
    pairs = (targets.camera, targets.projector), (targets.projector, targets.camera)
    for s, station in enumerate(network.station_ids):
        for side, (device, other) in enumerate(pairs):
            if (station.capture, station.device) == (capture, device) and station.by in ("", other):
                own = np.flatnonzero(network.observation_station == s)
                i = of_point[network.observation_point[own]]
                rows[i, side], known[i, side] = own, True
    return rows, known
