"""Calibrations over the working volume, in the window: the millimetres of a closed form, and nothing lost meanwhile."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QRect

from core.geometry import Pose
from core.model import Adjustment, DepthCalibration, PhotogrammetricCalibration
from core.pipeline import CalibrateOptions
from core.pipeline.runs import keep_run, list_runs, run_folder
from core.project import load_archive, read_project
from tests.gui.conftest import settle
from tests.gui.hands import front, idle

LONGER = 1.001  # base of the second run over that of the first: all points are farther by this


@pytest.fixture
def page(window, finished_project: Path, qtbot):
    """The calibrate page of a project with a second run, whose base is longer."""
    project = read_project(finished_project)
    (run,) = list_runs(project)
    folder = run_folder(project, run.number)
    calibration = load_archive(folder / "photogrammetric.npz", PhotogrammetricCalibration)
    longer = {
        name: replace(o, device_from_base=Pose(o.device_from_base.rotation, LONGER * o.device_from_base.translation_mm))
        for name, o in calibration.orientations.items()
    }
    archives = {
        "photogrammetric.npz": replace(calibration, orientations=longer),
        "adjustment.npz": load_archive(folder / "adjustment.npz", Adjustment),
    }
    keep_run(project, replace(run, captures={"photogrammetric": run.captures["photogrammetric"]}), archives)
    assert window.open_path(finished_project)
    window.show_page("calibrate")
    idle(window, qtbot)
    return window.page


def test_a_longer_base_puts_every_point_farther_by_its_share(page, window, qtbot) -> None:
    page.go_to("runs")
    assert page.runs.comparison.model.rowCount() == 24
    front(page.runs.tabs, "volume")
    idle(window, qtbot)
    volume, project = page.runs.volume, window.bench.session.opened.project
    # no capture was shared, or all of it was: what differs by a thousandth of the distance is far beyond the sigmas
    assert volume.said.text().startswith("They differ by more than chance")
    columns = volume.table.model.table.columns
    assert columns == ("distance [mm]", "difference [mm]", "in σ", "form [mm]", "in σ")
    spec, c = project.camera, project.camera.nominal_c_mm
    for row in range(volume.table.model.rowCount()):
        volume.table.choose_row(row)
        depth = volume.table.model.table.rows[row][0].value
        seen = np.argwhere(np.isfinite(volume.view.image))
        offset = (seen[:, ::-1] - np.array([spec.width - 1, spec.height - 1]) / 2) * spec.pitch_mm
        wanted = (LONGER - 1) * depth * np.sqrt(1 + np.sum((offset / c) ** 2, axis=1))
        # lens and principal point move the rays by some per cent of their slope; cells are constant over 1/13 image
        assert np.abs(volume.view.image[tuple(seen.T)] / wanted - 1).max() < 0.03
        assert volume.table.model.table.rows[row][1].value == pytest.approx(np.sqrt(np.mean(wanted**2)), rel=0.01)
    window.resize(window.minimumSize())  # all of it is seen in the smallest window, too
    settle()
    table = volume.table
    assert table.view.geometry().bottom() < table.notes.geometry().top()
    assert volume.rect().contains(QRect(table.mapTo(volume, QPoint(0, 0)), table.size()))
    page.state.setText("Out of date.\n" * 3)  # the note lay over the rows
    page.state.show()
    settle()
    assert not table.notes.isVisible() or table.view.geometry().bottom() < table.notes.geometry().top()
    assert table.rect().contains(table.view.geometry())
    assert table.toolTip() == table.notes.text()
    # the other way round it is the same but for the volume it is told of
    before = volume.table.model.table.rows[2][1].value
    page.runs.first.setCurrentIndex(0)
    assert "two different" in page.runs.nothing.text()
    page.runs.second.setCurrentIndex(1)
    idle(window, qtbot)
    assert volume.table.model.table.rows[2][1].value == pytest.approx(before, rel=0.01)


def test_what_is_shown_is_of_what_was_asked_last_and_a_failure_is_not_kept(page, window, qtbot) -> None:
    """Maps of the runs before stayed beside "Working out…"; a file that was missing once was never looked for again."""
    page.go_to("runs")
    front(page.runs.tabs, "volume")
    idle(window, qtbot)
    volume, folder = page.runs.volume, run_folder(window.bench.session.opened.project, 2)
    assert volume.view.isVisible()
    (folder / "photogrammetric.npz").rename(folder / "away")
    page.runs.first.setCurrentIndex(0)
    page.runs.second.setCurrentIndex(1)
    assert volume.said.text() == "Working out…"
    assert not volume.view.isVisible()
    idle(window, qtbot)
    assert "no photogrammetric calibration of run 2" in volume.said.text()
    (folder / "away").rename(folder / "photogrammetric.npz")
    page.go_to("results")
    page.go_to("runs")
    idle(window, qtbot)
    assert volume.view.isVisible()


def test_runs_that_can_be_compared_are_even_where_the_newest_cannot(page, window, qtbot) -> None:
    project = window.bench.session.opened.project
    first = list_runs(project)[0]
    depth = load_archive(run_folder(project, 1) / "polynomial.npz", DepthCalibration)
    captures = {"polynomial": first.captures["polynomial"]}
    keep_run(project, replace(first, captures=captures, options=CalibrateOptions(degree=2)), {"polynomial.npz": depth})
    page.go_to("runs")
    assert [box.currentData() for box in (page.runs.second, page.runs.first)] == [2, 1]
    assert page.runs.comparison.isVisible()
