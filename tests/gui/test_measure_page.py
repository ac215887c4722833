"""The measure page tells what is missing and why, and the stage is done only when every picked image is measured."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from core.geometry import Pose, project
from core.model import Interior
from core.pipeline.picking import measure_one
from core.project import read_picks, read_project, write_picks
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.status import State, stage_statuses


@pytest.fixture
def page(window, qtbot, finished_project: Path):
    window.open_path(finished_project)
    window.bench.session.choose_capture("depth-01")
    window.show_page("measure")
    bench = window.bench
    qtbot.waitUntil(lambda: not bench.views.busy and not bench.jobs.busy, timeout=60_000)
    return window.page


def test_missing_targets_are_listed_with_reasons_and_pointed_at(page, finished_project: Path) -> None:
    kept = json.loads((finished_project / "results" / "targets.json").read_text())["captures"]
    missing = next(c for c in kept if c["capture"] == "depth-01")["missing"]
    assert missing
    assert f"({len(missing)})" in page.tabs.tabText(1)
    rows = page.missing_table.model.table.rows
    assert [(r[0].value, r[1].value, r[2]) for r in rows] == [(m["row"], m["col"], m["reason"]) for m in missing]
    truth, spec = json.loads((finished_project / "truth.json").read_text()), read_project(finished_project).camera
    camera, pose = truth["camera"], truth["captures"]["depth-01"]["camera_from_board"]
    a = tuple(camera[f"A{i}"] for i in range(1, 7))
    interior = Interior(camera["c_mm"], camera["x0_mm"], camera["y0_mm"], a, camera["r0_mm"])
    board = {(t["row"], t["col"]): t["xyz_mm"] for t in truth["testfields"]["plate.csv"]}
    for i, m in enumerate(missing):
        page.missing_table.choose_row(i)
        at = np.ravel(page.chosen.getData())
        xyz = np.array([board[m["row"], m["col"]]])
        where = project(spec, interior, xyz, Pose(np.array(pose["rotation"]), np.array(pose["translation_mm"])))[0]
        # carried on by a pose and one radial parameter from the measured ones: the lens has five parameters more
        assert np.hypot(*(at - where)) < 2.0


def test_an_excluded_target_is_listed_as_such(page, window, qtbot, finished_project: Path) -> None:
    path = finished_project / "captures" / "testfield-02" / "picks.json"
    write_picks(path, read_picks(path)[0], [(2, 5)])
    measure_one(read_project(finished_project), "testfield-02")
    window.bench.session.choose_capture("testfield-02")
    window.bench.refresh()
    qtbot.waitUntil(lambda: not window.bench.views.busy, timeout=60_000)
    assert [row[2] for row in page.missing_table.model.table.rows] == ["excluded by the operator"]
    assert "1 excluded by the operator" in page.state.text()


def test_measuring_one_image_does_not_make_the_stage_done(project: Path) -> None:
    made = read_project(project)
    measure_one(made, "testfield-01")
    status = stage_statuses(ProjectFolder(project))["measure"]
    assert status.state is State.TODO
    assert status.reason.startswith("1 of ")
    for folder in made.captures:
        if folder.name.startswith("testfield"):
            measure_one(made, folder.name)
    assert stage_statuses(ProjectFolder(project))["measure"].state is State.DONE
