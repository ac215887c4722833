"""The measure page tells what is missing and why, and the stage is done only when every picked image is measured."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from core.pipeline.picking import measure_one
from core.project import read_picks, read_project, write_picks
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.stages import State
from stripe_gui.presenters.status import stage_statuses
from tests.gui.hands import idle, true_targets


@pytest.fixture
def page(window, qtbot, finished_project: Path):
    window.open_path(finished_project)
    window.bench.session.choose_capture("depth-01")
    window.show_page("measure")
    idle(window, qtbot)
    return window.page


def test_missing_targets_are_listed_with_reasons_and_pointed_at(page, finished_project: Path) -> None:
    kept = json.loads((finished_project / "results" / "targets.json").read_text())["captures"]
    missing = next(c for c in kept if c["capture"] == "depth-01")["missing"]
    assert missing
    shown = page.side.targets.model.table.rows
    rows = [row for row in shown if row[3] is None]  # no coordinates
    assert [(r[0].value, r[1].value, r[2]) for r in rows] == [(m["row"], m["col"], m["reason"]) for m in missing]
    targets = true_targets(finished_project, "depth-01", "plate.csv")
    for m in missing:
        page.side.targets.choose_row(page._shown.targets.index((m["row"], m["col"])))
        # carried on by a pose and one radial parameter from the measured ones: the lens has five parameters more
        assert np.hypot(*(page.image.cursor_at - targets[m["row"], m["col"]])) < 2.0


def test_measured_targets_are_listed_with_their_coordinates(page, finished_project: Path) -> None:
    kept = json.loads((finished_project / "results" / "targets.json").read_text())["captures"]
    targets = next(c for c in kept if c["capture"] == "depth-01")["targets"]
    rows = {(r[0].value, r[1].value): r for r in page.side.targets.model.table.rows}
    for t in targets:
        u, v, _, up, vp = (cell.value for cell in rows[t["row"], t["col"]][3:])
        assert [u, v] == pytest.approx([t["u"], t["v"]])
        assert [up, vp] == pytest.approx(
            [np.nan if t[k] is None else t[k] for k in ("projector_u", "projector_v")], nan_ok=True
        )


def test_an_excluded_target_is_listed_as_such(page, window, qtbot, finished_project: Path) -> None:
    path = finished_project / "captures" / "testfield-02" / "picks.json"
    write_picks(path, read_picks(path)[0], [(2, 5)])
    measure_one(read_project(finished_project), "testfield-02")
    window.bench.session.choose_capture("testfield-02")
    window.bench.refresh()
    idle(window, qtbot)
    unmeasured = [(r[0].value, r[1].value, r[2]) for r in page.side.targets.model.table.rows if r[3] is None]
    assert unmeasured[0] == (2, 5, "excluded by the operator")  # what the operator did stands first
    assert not [reason for *_, reason in unmeasured[1:] if "excluded" in reason]


def test_measuring_one_image_does_not_make_the_stage_done(project: Path, edit_json) -> None:
    few = ("testfield-01", "testfield-02", "depth-01", "plane+00")
    edit_json(project / "project.json", captures=[f"captures/{name}" for name in few])
    made = read_project(project)
    measure_one(made, "testfield-01")
    status = stage_statuses(ProjectFolder(project))["measure"]
    assert status.state is State.TODO
    assert status.reason.startswith("2 of 3 captures: not measured yet (testfield-02")
    for folder in made.captures:
        if (folder / "picks.json").exists():
            measure_one(made, folder.name)
    assert stage_statuses(ProjectFolder(project))["measure"].state is State.DONE
