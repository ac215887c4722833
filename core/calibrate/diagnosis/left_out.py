"""Every capture left out in turn: does the rest foresee what it shows, and what would the calibration be without it.

No adjustment is repeated. With A the whitened equations of a capture, its own poses eliminated, v its residuals, Q the
cofactors of all that other captures share, and ``H = A Q Aᵀ``, the residuals against a calibration without it, but with
poses of its own, are ``(I - H)⁻¹ v``, those parameters change by ``-Q Aᵀ(I - H)⁻¹ v``, and ``vᵀ(I - H)⁻¹ v`` is
chi-square distributed. Source: Cook, Weisberg, *Residuals and influence in regression*, 1982.
"""

from __future__ import annotations

import numpy as np

from core.calibrate.adjust import solve_network
from core.calibrate.diagnosis.weakness import ORIENTATION
from core.calibrate.solution.normals import reduced_equations
from core.calibrate.solution.solve import AdjustOptions, Solved
from core.errors import InputError
from core.geometry import LENSES
from core.lazy import dataclass
from core.model import Array, Network
from core.numerics import fisher_limit
from core.progress import SILENT, Progress

LEAST_SHARE = 1e-7  # of an observation that others check: less, and only this capture determines something
LEVEL = 0.001  # chance that one of the captures of a good network is called off


@dataclass(frozen=True)
class LeftOut:
    """What the other captures say of one.

    `foreseen_px` by device are the r.m.s. residuals (px or lines) against the calibration without the capture, and
    `fitted_px` those with it. `statistic` is F distributed with `dof` degrees of freedom if the capture is like the
    others, and above `limit` once in a thousand networks. Without the capture, `parameter` would change most, by
    `change_sigmas` of its sigmas.
    """

    capture: str
    foreseen_px: dict[str, float]
    fitted_px: dict[str, float]
    statistic: float
    dof: int
    limit: float
    parameter: str
    change_sigmas: float

    @property
    def off(self) -> bool:
        """Whether the capture does not fit the others."""
        return self.statistic > self.limit


def leave_captures_out(network: Network, progress: Progress = SILENT) -> tuple[LeftOut, ...]:
    """Leave every pose of an adjusted network out in turn.

    Raises
    ------
    InputError
        If the network has fewer than three poses.
    AdjustmentError
        As `adjust`.
    """
    poses = list(dict.fromkeys(network.station_pose))
    if len(poses) < 3:
        raise InputError("the network", f"has {len(poses)} poses", "leave captures out of three or more")
    solved, _ = solve_network(network, AdjustOptions(variance_components=True), progress.part(0.0, 0.3))
    found = []
    for k, pose in enumerate(poses):
        progress(0.3 + 0.7 * k / len(poses), "leaving captures out")
        found.append(_without(solved, pose, len(poses)))
    return tuple(found)


def _without(solved: Solved, pose: int, poses: int) -> LeftOut:
    network, problem = solved.network, solved.problem
    stations = [s for s, p in enumerate(network.station_pose) if p == pose]
    rows = np.flatnonzero(np.isin(network.observation_station[problem.order], stations))
    observed = (problem.root_weight[rows] > 0).ravel()
    A = reduced_equations(problem, solved.equations.J, solved.inverse.C, rows).reshape(2 * len(rows), -1)[observed]
    v = solved.equations.w[rows].ravel()[observed]
    AQ = A @ solved.inverse.Q
    share, modes = np.linalg.eigh(np.eye(len(v)) - AQ @ A.T)
    use = share > LEAST_SHARE
    part = modes[:, use].T @ v
    foreseen = modes[:, use] @ (part / share[use])
    # a pose costs six; what the capture alone determines is no prediction
    dof = int(use.sum()) - 6
    rest = problem.redundancy - dof
    own = float(part @ (part / share[use]))
    statistic = own / dof / max((solved.equations.cost - own) / rest, 1e-300) if min(dof, rest) > 0 else 0.0
    G = problem.globals
    variance = np.diagonal(solved.inverse.Q)[:G] * solved.variance
    change = -(AQ[:, :G].T @ foreseen) / np.sqrt(np.maximum(variance, 1e-300))
    most = int(np.argmax(np.abs(change)))
    device = np.repeat(problem.device[rows], 2)[observed]
    sigma = 1.0 / problem.root_weight[rows].ravel()[observed]

    def by_device(residual: Array) -> dict[str, float]:
        return {
            name: float(np.sqrt(np.mean((residual * sigma)[device == d] ** 2)))
            for d, name in enumerate(problem.device_names)
            if (device == d).any()
        }

    ids = network.station_ids
    return LeftOut(
        capture=ids[stations[0]].capture if ids else ", ".join(network.station_names[s] for s in stations),
        foreseen_px=by_device(foreseen),
        fitted_px=by_device(v),
        statistic=statistic,
        dof=dof,
        limit=fisher_limit(dof, rest, LEVEL / poses) if min(dof, rest) > 0 else float("inf"),
        parameter=global_names(solved)[most],
        change_sigmas=float(change[most]),
    )


def global_names(solved: Solved) -> list[str]:
    """Names of the global unknowns in their order."""
    names = [""] * solved.problem.globals
    for device, model, columns in zip(
        solved.problem.device_names, solved.problem.models, solved.problem.columns, strict=True
    ):
        for name, place in zip((*ORIENTATION, *LENSES[model].names), columns, strict=False):
            if place >= 0:
                names[place] = f"{device}.{name}"
    return names
