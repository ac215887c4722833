"""The calibration wizard by clicks and keys: from a measured project to a second run without a target, compared."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt

from core.model import Adjustment
from core.pipeline import calibrate_project, current_runs, list_runs, measure_project
from core.project import load_archive, read_capture, read_project
from stripe_gui.presenters.status import State
from tests.gui.hands import click, idle


@pytest.fixture
def measured_project(finished_project: Path) -> Path:
    """A project whose targets are measured and which is not calibrated."""
    for path in sorted((finished_project / "results").rglob("*"), reverse=True):
        if path.is_file() and not path.name.startswith("targets"):
            path.unlink()
    return finished_project


@pytest.fixture
def open_wizard(window, qtbot):
    """Open a project and its calibration wizard by the action's key."""

    def opened(folder: Path):
        assert window.open_path(folder)
        window.show_page("calibrate")
        idle(window, qtbot)
        with qtbot.waitActive(window):
            qtbot.keyClick(
                window, Qt.Key.Key_K, Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
            )
        assert window.page.id == "calibrate-wizard"
        idle(window, qtbot)
        return window.page

    return opened


def click_vector(plot, index: int, qtbot) -> None:
    """Click on an image point of a residual plot."""
    at = plot.canvas.mapFromScene(plot.canvas.box.mapViewToScene(QPointF(*plot._uv[index])))
    qtbot.mouseClick(plot.canvas.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(at.x(), at.y()))


def test_from_a_measured_project_to_a_second_run_without_a_target(
    open_wizard, window, measured_project: Path, notices, qtbot
) -> None:
    wizard = open_wizard(measured_project)
    assert wizard.step.name == "method"
    click(wizard.next_button, qtbot)
    assert wizard.captures.table.rowCount() == 13
    assert wizard.captures.summary.text() == ("8 testfields, 4 of them turned by a quarter, and 5 plates take part.")
    click(wizard.next_button, qtbot)
    assert wizard.step.name == "run"
    assert not wizard.next_button.isEnabled()  # nothing to look at yet
    click(wizard.run_step.start_button, qtbot)
    idle(window, qtbot)
    # the run shows its convergence and brings the results to the front
    assert wizard.step.name == "results"
    assert wizard.run_step.convergence.said().startswith("After ")
    assert [table.title.text().split(".")[0] for table in wizard.results.tables[:3]] == [
        "Table 1a",
        "Table 1b",
        "Table 2",
    ]

    # choose one capture, click the point that misfits most there, exclude it, run again
    wizard.results.tabs.setCurrentIndex(1)
    residuals = wizard.results.residuals
    residuals.stations.setCurrentIndex(residuals.stations.findText("testfield-04"))
    shown = residuals._sets[0].residual[residuals._rows[0]]
    worst = int(np.argmax(np.hypot(*shown.T)))
    click_vector(residuals.plots[0], worst, qtbot)
    assert residuals.picked.text().startswith("testfield-04/camera")
    row, col = residuals._target()
    click(residuals.exclude, qtbot)
    assert read_capture(measured_project / "captures" / "testfield-04").excluded == ((row, col),)
    assert window.bench.session.statuses["calibrate"].state is State.STALE
    assert f"testfield-04 {row}/{col}" in wizard.pending.text()
    click(wizard.again_button, qtbot)
    idle(window, qtbot)
    assert wizard.step.name == "results"
    assert window.bench.session.statuses["calibrate"].state is State.DONE
    network = load_archive(measured_project / "results" / "adjustment.npz", Adjustment).network
    at = network.station_names.index("testfield-04/camera")
    seen = {network.point_names[p] for p in network.observation_point[network.observation_station == at]}
    assert f"{row}/{col}" not in seen

    # both runs are kept and stand side by side
    click(wizard.next_button, qtbot)
    assert wizard.runs.table.model.rowCount() == 2
    assert wizard.runs.comparison.model.rowCount() == 24
    project = read_project(measured_project)
    assert [run.excluded for run in list_runs(project)] == [{}, {"testfield-04": ((row, col),)}]
    wizard.runs.table.choose_row(1)  # the newest stands first
    click(wizard.runs.use_button, qtbot)
    assert current_runs(project) == {"photogrammetric": 1, "polynomial": 1}
    # that run does not know of the exclusion, so it is out of date, and says so
    assert window.bench.session.statuses["calibrate"].state is State.STALE
    click(wizard.next_button, qtbot)
    assert window.page.id == "calibrate"
    assert not [n for n in notices if n.kind == "error"]


def test_a_capture_is_left_out_and_taken_in_by_keys(open_wizard, window, finished_project: Path, qtbot) -> None:
    wizard = open_wizard(finished_project)
    wizard.go_to("captures")
    wizard.captures.table.setFocus()
    wizard.captures.table.setCurrentCell(2, 0)
    with qtbot.waitActive(window):
        qtbot.keyClick(wizard.captures.table, Qt.Key.Key_Space)
    assert wizard.choice().options.without == ("testfield-03",)
    assert wizard.captures.summary.text().startswith("7 testfields")
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    idle(window, qtbot)
    run = list_runs(read_project(finished_project))[-1]
    assert run.options.without == ("testfield-03",)
    assert "testfield-03" not in run.captures["photogrammetric"]
    assert "without testfield-03" in wizard.results.made.text()
    wizard.go_to("captures")
    click(wizard.captures.all_button, qtbot)
    assert wizard.choice().options.without == ()


def test_too_few_captures_say_what_is_missing(open_wizard, window, finished_project: Path, qtbot) -> None:
    wizard = open_wizard(finished_project)
    wizard.go_to("captures")
    wizard.captures.set_without([f"testfield-0{i}" for i in range(2, 9)])
    assert not wizard.next_button.isEnabled()
    assert "at least two" in wizard.next_button.accessibleDescription()
    wizard.go_to("method")
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    assert wizard.step.name == "captures"
    assert not window.bench.jobs.busy


def test_a_whole_capture_is_left_out_from_its_residual_and_taken_back(
    open_wizard, window, finished_project: Path, qtbot
) -> None:
    wizard = open_wizard(finished_project)
    wizard.go_to("results")
    wizard.results.tabs.setCurrentIndex(1)
    residuals = wizard.results.residuals
    click_vector(residuals.plots[1], 0, qtbot)
    capture = residuals._capture()
    click(residuals.leave_out, qtbot)
    assert wizard.choice().options.without == (capture,)
    assert capture in wizard.pending.text()
    click_vector(residuals.plots[1], 5, qtbot)
    click(residuals.exclude, qtbot)
    click(wizard.take_back_button, qtbot)
    assert wizard.choice().options.without == ()
    assert not any(c.excluded for c in wizard.captures._shown)
    assert wizard._pending.isHidden()


def test_a_residual_opens_its_image_at_the_target(open_wizard, window, finished_project: Path, qtbot) -> None:
    wizard = open_wizard(finished_project)
    wizard.go_to("results")
    wizard.results.tabs.setCurrentIndex(1)
    residuals = wizard.results.residuals
    click_vector(residuals.plots[0], 40, qtbot)
    capture, target, uv = residuals._capture(), residuals._target(), residuals._sets[0].uv[40]
    click(residuals.open_image, qtbot)
    idle(window, qtbot)
    assert window.page.id == "pick"
    assert window.bench.session.capture_name == capture
    assert window.page.model.capture.name == capture
    assert window.page.model.target == target
    assert window.page.image.cursor_at == pytest.approx(tuple(uv), abs=3.0)  # the dot itself, not its neighbour
    # the same on the measure page
    window.bench.session.choose_capture(capture, target)
    window.show_page("measure")
    idle(window, qtbot)
    page = window.page
    assert page._shown.targets[page.table.chosen_row()] == target
    (u0, u1), (v0, v1) = page.view.canvas.box.viewRange()
    assert ((u0 + u1) / 2, (v0 + v1) / 2) == pytest.approx(tuple(uv), abs=0.5)


def test_a_held_parameter_is_told_and_missing_among_the_correlations(
    open_wizard, window, finished_project: Path, qtbot
) -> None:
    wizard = open_wizard(finished_project)
    wizard.form.method.setCurrentIndex(wizard.form.method.findData("photogrammetric"))
    box = wizard.form.parameters["projector.A6"]
    qtbot.mouseClick(box, Qt.MouseButton.LeftButton, pos=QPoint(10, box.height() // 2))
    assert wizard.choice().options.hold == ("projector.A6",)
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    idle(window, qtbot)
    wizard.results.tabs.setCurrentIndex(3)
    names = wizard.results.correlations.matrix._shown.names
    assert "projector.A6" not in names
    assert len(names) == 23  # twice nine and six of the relative orientation, without the held one
    wizard.results.correlations.matrix.point_at((1, 0))
    assert "camera.x0, camera.c" in wizard.results.correlations.readout.text()
    # the calibrate page goes on from the run in use
    window.show_page("calibrate")
    assert "projector.A6 held" in window.page.form.also.text()
    assert window.page.choice().options.hold == ("projector.A6",)


def test_cancelling_takes_less_than_half_a_second(open_wizard, window, project: Path, qtbot) -> None:
    wizard = open_wizard(project)
    assert wizard.step.name == "method"
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    assert wizard.step.name == "run"
    qtbot.waitUntil(lambda: window.bench.jobs.running is not None and window.bench.jobs.running.fraction > 0)
    started = time.monotonic()
    click(wizard.run_step.cancel_button, qtbot)
    idle(window, qtbot)
    assert time.monotonic() - started < 0.5
    assert "Cancelled" in wizard.run_step.state.text()
    assert not (project / "results").exists()
    assert wizard.run_step.start_button.isEnabled()


def test_a_failure_is_told_in_the_step_and_the_work_can_be_started_again(
    open_wizard, window, measured_project: Path, qtbot
) -> None:
    wizard = open_wizard(measured_project)
    wizard.form.degree.setCurrentIndex(wizard.form.degree.findData(5))  # of five plates: one too few
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    idle(window, qtbot)
    assert wizard.step.name == "run"
    assert wizard.run_step.state.text().startswith("Failed: ")
    assert not wizard.next_button.isEnabled()
    wizard.form.degree.setCurrentIndex(wizard.form.degree.findData(3))
    click(wizard.run_step.start_button, qtbot)
    idle(window, qtbot)
    assert wizard.step.name == "results"


def test_runs_are_named_deleted_after_asking_and_compared(
    open_wizard, window, answers, finished_project: Path, qtbot
) -> None:
    project = read_project(finished_project)
    measure_project(project)
    calibrate_project(project)
    wizard = open_wizard(finished_project)
    wizard.go_to("runs")
    runs = wizard.runs
    runs.table.choose_row(1)
    qtbot.keyClicks(runs.name, "first")
    qtbot.keyClick(runs.name, Qt.Key.Key_Return)
    assert list_runs(project)[0].name == "first"
    assert "run 1: first" in runs.first.currentText()
    runs.table.choose_row(0)
    assert not runs.delete_button.isEnabled()  # it is in use
    runs.table.choose_row(1)
    answers.agree = False
    click(runs.delete_button, qtbot)
    assert len(list_runs(project)) == 2
    answers.agree = True
    runs.table.choose_row(1)
    click(runs.delete_button, qtbot)
    assert [run.number for run in list_runs(project)] == [2]
    assert "once there are two" in runs.nothing.text()


def test_the_object_points_tell_their_sigmas_in_every_direction(
    open_wizard, window, finished_project: Path, qtbot
) -> None:
    wizard = open_wizard(finished_project)
    wizard.go_to("results")
    wizard.results.tabs.setCurrentIndex(4)
    points = wizard.results.points
    assert points.table.model.rowCount() == len(points._shown.names)
    for i in range(points.axis.count()):
        points.axis.setCurrentIndex(i)
        assert len(points.points.getData()[0]) == len(points._shown.names)
    points.table.choose_row(7)
    assert points.readout.text().startswith(points._shown.names[7])
    wizard.results.tabs.setCurrentIndex(2)
    assert [view.image.shape for view in wizard.results.coverage.maps] == [
        (device.spec.height, device.spec.width) for device in wizard.results._view.adjustment.devices.values()
    ]
