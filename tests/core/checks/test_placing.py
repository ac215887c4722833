"""Known lengths on boards that look the same turned or mirrored: between which targets they lie is told, or asked."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from core.calibrate import adjust
from core.checks import mirrored_concerns, named_from_behind, turned_concerns
from core.model import Adjustment, Capture, Project, Rig, ScaleBar, Seed, TargetId, Testfield
from core.pipeline.methods.photogrammetric import placing_concerns, words_from_behind
from tests.core.calibrate.conftest import CAMERA, PROJECTOR, Simulated, simulated_network

ROWS, COLS = 6, 8
CELLS = np.array([[r, c] for r in range(ROWS) for c in range(COLS)])
HALF_A_TURN = (np.array([[-1, 0], [0, -1]]), np.array([ROWS - 1, COLS - 1]))
Ends = tuple[tuple[int, int], tuple[int, int]]
ALONG, DIAGONAL = ((0, 0), (0, 7)), ((0, 0), (5, 7))  # the diagonal is itself after half a turn


@cache
def adjusted() -> tuple[Simulated, Adjustment, Testfield]:
    """Targets lie 0.1 mm off their nominal places: lengths differ by half a permille from those across the middle."""
    simulated = simulated_network(rows=ROWS, cols=COLS, poses=8, depth_mm=0.5)
    ids = tuple(TargetId(int(r), int(c)) for r, c in CELLS)
    network = replace(simulated.network, point_ids=ids, point_names=tuple(map(str, ids)))
    field = Testfield(*CELLS.T, network.point_xyz_mm, np.full(len(CELLS), 6.0))
    return simulated, adjust(network), field


def bar(ends: Ends, sigma_mm: float = 0.005) -> ScaleBar:
    """As measured between those targets."""
    a, b = (adjusted()[0].points_mm[end[0] * COLS + end[1]] for end in ends)
    return ScaleBar(*ends, float(np.linalg.norm(b - a)), sigma_mm)


def change_ppm(ends: Ends, others: Ends) -> float:
    """What the scale changes by when a length lies between other targets, from the truth."""
    return 1e6 * abs(bar(ends).length_mm / bar(others).length_mm - 1)


def test_a_length_that_a_turn_would_lay_elsewhere_leaves_the_scale_in_doubt() -> None:
    _, adjustment, field = adjusted()
    (told,) = turned_concerns(adjustment, field, [bar(ALONG)], [HALF_A_TURN])
    assert told.state == "doubtful"
    found = float(told.text.split("change the scale by ")[1].split(" ppm")[0])
    expected = change_ppm(ALONG, ((5, 7), (5, 0)))
    assert expected > 200
    assert found == pytest.approx(expected, abs=150)  # points are known to 10 to 20 µm over 250 mm


@pytest.mark.parametrize(
    "bars",
    [
        (),
        ((DIAGONAL, 0.005),),
        ((ALONG, 1.0),),  # all its placements agree within its sigma
        ((ALONG, 0.005), (((0, 0), (5, 0)), 0.005)),  # two lengths that fit one placement only
    ],
)
def test_lengths_that_fit_however_the_board_is_turned_or_one_way_alone_are_no_doubt(bars: tuple) -> None:
    _, adjustment, field = adjusted()
    assert not turned_concerns(adjustment, field, [bar(*b) for b in bars], [HALF_A_TURN])


def test_a_file_with_the_true_places_of_its_targets_tells_how_the_board_is_turned() -> None:
    simulated, adjustment, field = adjusted()
    true = replace(field, xyz_mm=simulated.points_mm)
    assert not turned_concerns(adjustment, true, [bar(ALONG)], [HALF_A_TURN])


def test_only_of_boards_that_nobody_picked_turns_are_in_doubt(tmp_path: Path) -> None:
    """A wrong turn was warned of alone, where the scale it gave was 1262 ppm off at a sigma of 20 ppm."""
    _, adjustment, field = adjusted()
    project = Project(tmp_path, "one", Rig({"camera": CAMERA}, {"projector": PROJECTOR}), bar(ALONG), ())
    unpicked = Capture(tmp_path / "one", "testfield", (), field)
    (told,) = placing_concerns(project, [unpicked], adjustment)
    assert told.text.startswith("nobody picked, and the board looks the same when turned: the length from (0, 0) to")
    assert not placing_concerns(project, [replace(unpicked, seeds=(Seed(0, 0, 1.0, 2.0),))], adjustment)
    rings = replace(unpicked, testfield=replace(field, kind="charuco"))
    assert not placing_concerns(project, [rings], adjustment)  # tags cannot be turned
    assert not placing_concerns(replace(project, scale=bar(DIAGONAL)), [unpicked], adjustment)


def named(columns_from_right: bool = False, y_down: bool = False) -> tuple[Adjustment, Testfield]:
    """The same images with other names, or other nominal coordinates."""
    simulated, _, field = adjusted()
    names = CELLS if not columns_from_right else np.column_stack([CELLS[:, 0], COLS - 1 - CELLS[:, 1]])
    if y_down:
        field = replace(field, xyz_mm=field.xyz_mm * (1, -1, 1))
    ids = tuple(TargetId(int(r), int(c)) for r, c in names)
    places = field.xyz_mm[[field.index()[i.row, i.col] for i in ids]]
    network = replace(simulated.network, point_ids=ids, point_names=tuple(map(str, ids)), point_xyz_mm=places)
    return adjust(network), field


def test_picks_in_mirrored_order_are_told_where_a_length_then_lies_elsewhere() -> None:
    """Every board seems to be seen from its back then, which passed without a word."""
    adjustment, field = named(columns_from_right=True)
    assert named_from_behind(adjustment, field, ["camera"])
    (told,) = mirrored_concerns(adjustment, field, [bar(((1, 1), (4, 3)))], ["camera"])
    assert told.state == "doubtful"
    assert "seen from behind, by the order in which the picks name targets" in told.text
    assert not mirrored_concerns(adjustment, field, [bar(((1, 1), (4, 3)), sigma_mm=1.0)], ["camera"])


@pytest.mark.parametrize("y_down", [False, True])
def test_a_field_whose_y_runs_downwards_is_as_sound_as_one_whose_y_runs_upwards(y_down: bool) -> None:
    adjustment, field = named(y_down=y_down)
    behind = [pose.rotation[2, 2] < 0 for pose in adjustment.station_from_object]
    assert all(behind) if y_down else not any(behind)
    assert not named_from_behind(adjustment, field, ["camera"])
    assert not mirrored_concerns(adjustment, field, [bar(ALONG)], ["camera"])


def test_rows_counted_upwards_are_no_mirrored_order() -> None:
    """As those of Kalibr's boards are: the first row is the lowest."""
    _, adjustment, field = adjusted()
    ids = tuple(TargetId(ROWS - 1 - i.row, i.col) for i in adjustment.network.point_ids)
    upwards = replace(field, row=ROWS - 1 - field.row)
    assert not named_from_behind(
        replace(adjustment, network=replace(adjustment.network, point_ids=ids)), upwards, ["camera"]
    )


def test_mirrored_picks_are_said_where_nothing_else_comes_of_them(tmp_path: Path) -> None:
    adjustment, field = named(columns_from_right=True)
    project = Project(tmp_path, "one", Rig({"camera": CAMERA}, {"projector": PROJECTOR}), None, ())
    picked = Capture(tmp_path / "one", "testfield", (), field, seeds=(Seed(0, 0, 1.0, 2.0),))
    assert not placing_concerns(project, [picked], adjustment)
    (told,) = words_from_behind(project, [picked], adjustment)
    assert "rows or columns were counted from the wrong side" in told
    assert not words_from_behind(project, [picked], adjusted()[1])
