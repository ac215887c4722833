"""Targets that stand in each other's place: no residual shows it, for images do not show how targets are called."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import adjust
from core.checks import exchanged_notes
from core.model import Testfield
from core.pipeline.judge import judge_adjustment
from core.project.boards import nominal_testfield
from tests.core.calibrate.conftest import simulated_network

BOARD = nominal_testfield(7, 9, 19.0, 9.0)
OFF = np.random.default_rng(0).normal(0, 0.3, BOARD.xyz_mm.shape)  # of a board that was measured


def taking_places(board: Testfield, *at: tuple[int, int]) -> Testfield:
    """Give every target of some the place of the next one."""
    rows = [board.index()[key] for key in at]
    xyz = board.xyz_mm.copy()
    xyz[rows] = xyz[[*rows[1:], rows[0]]]
    return replace(board, xyz_mm=xyz)


@pytest.mark.parametrize("at", [((3, 4), (3, 5)), ((0, 0), (6, 8)), ((1, 1), (2, 2), (5, 7)), ((0, 0), (0, 1))])
@pytest.mark.parametrize("off", [0.0, 1.0])
def test_targets_in_each_other_s_place_are_named(at, off):
    board = replace(BOARD, xyz_mm=BOARD.xyz_mm + off * OFF)
    told = exchanged_notes(taking_places(board, *at))
    assert len(told) == 1
    assert ", ".join(f"{row}/{col}" for row, col in at[:-1]) + f" and {at[-1][0]}/{at[-1][1]} of" in told[0]


@pytest.mark.parametrize(
    "xyz",
    [
        BOARD.xyz_mm,
        BOARD.xyz_mm + OFF,
        BOARD.xyz_mm + np.stack([9.5 * (BOARD.row % 2), 0.0 * BOARD.row, 0.0 * BOARD.row], axis=1),  # hexagons
        BOARD.xyz_mm * np.where(BOARD.row % 2, -1.0, 1.0)[:, None] ** [1, 0, 0],  # every other row backwards
        np.random.default_rng(1).uniform(-80, 80, BOARD.xyz_mm.shape),  # without order
        BOARD.xyz_mm + np.array([0, 0, 2e-3]) * BOARD.xyz_mm[:, :1] ** 2,  # bent
        BOARD.xyz_mm + 30.0 * (np.arange(len(OFF)) == 31)[:, None] * [1, 0, 0],  # one misplaced, as told elsewhere
    ],
)
def test_other_boards_are_not_accused(xyz):
    assert exchanged_notes(replace(BOARD, xyz_mm=xyz)) == ()


def test_points_adjusted_to_each_other_s_place_are_named():
    network = simulated_network(seed=3).network
    names, xyz = network.point_names, network.point_xyz_mm.copy()
    assert judge_adjustment(adjust(network)).verdict.state == "passed"
    xyz[[20, 28]] = xyz[[28, 20]]
    verdict = judge_adjustment(adjust(replace(network, point_xyz_mm=xyz))).verdict
    assert verdict.state == "doubtful"
    assert f"points.csv: {names[20]} and {names[28]} are adjusted to each other's place" in verdict.because[0]
