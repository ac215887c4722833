"""The bundle adjustment with all covariances at 40 to 400 free stations."""

from __future__ import annotations

from core.calibrate import adjust
from core.model import Adjustment
from tests.benchmarks.timing import Contestant, Row, race
from tests.core.calibrate.conftest import simulated_network


def run() -> list[Row]:
    """A board of 247 targets before camera and projector; starting values are found within the time."""
    rows = []
    for poses in (20, 50, 100, 200):
        network = simulated_network(poses=poses, rows=13, cols=19, rigid=False, extent_mm=175.0).network
        ours = Contestant("stripe workbench", lambda n=network: adjust(n), _right)
        rows += race("adjustment", f"{2 * poses} stations", 2 * poses, "stations", [ours])
    return rows


def _right(result: Adjustment) -> str:
    assert 0.95 < result.sigma0 < 1.05, f"sigma0 is {result.sigma0}"  # the noise drawn is the noise told
    return f"sigma0 {result.sigma0:.3f}, {len(result.residuals)} image points"
