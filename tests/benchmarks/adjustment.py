"""The bundle adjustment with all covariances at 40 to 400 free stations, beside pycolmap, mrcal and scipy."""

from __future__ import annotations

import numpy as np

from core.calibrate import adjust
from core.model import Adjustment
from tests.benchmarks.environments import peer
from tests.benchmarks.networks import Task, judge, task
from tests.benchmarks.plain_adjustment import adjusted_points
from tests.benchmarks.timing import EFFORT, OURS, Absent, Contestant, Row, race

POSES = (20, 50, 100, 200)  # of two stations each
PEERS_AT = (20, 50, 200)
SLOW = 100  # poses from which a peer that takes tens of seconds works once


def run() -> list[Row]:
    """A board of 247 targets before camera and projector; ours finds its starting values within the time."""
    rows = []
    for poses in POSES[:1] if EFFORT.quick else POSES:
        one = task(poses)
        ours = Contestant(OURS, lambda t=one: adjust(t.network), lambda result, t=one: _right(t, result))
        rows += race("adjustment", f"{2 * poses} stations", 2 * poses, "stations", [ours, *_peers(one, poses)])
    return rows


def _right(one: Task, result: Adjustment) -> str:
    assert 0.97 < result.sigma0 < 1.03, f"sigma0 is {result.sigma0}"  # the noise drawn is the noise told
    return f"{judge(one)(result.points_mm)}, sigma0 {result.sigma0:.3f}"


def _peers(one: Task, poses: int) -> list[Contestant | Absent]:
    if poses not in PEERS_AT:
        return []
    right = judge(one)

    def points(result: dict[str, np.ndarray]) -> str:
        return right(result["points"])

    return [
        peer("pycolmap", "pycolmap", one.arrays, points, warm=poses < SLOW),
        peer("mrcal", "mrcal", one.arrays, points, warm=poses < SLOW),
        Contestant(
            "scipy least_squares, no covariances",
            lambda: adjusted_points(one.arrays),
            right,
            warm=poses < SLOW,
            peer=True,
        ),
    ]
