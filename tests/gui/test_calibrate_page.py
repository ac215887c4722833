"""The calibrate page by clicks and keys: from a measured project to a second run without a target, compared."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtWidgets import QToolButton

from core.model import Adjustment
from core.pipeline import calibrate_project, measure_project
from core.pipeline.runs import current_runs, list_runs
from core.project import load_archive, read_capture, read_project
from stripe_gui.presenters.stages import State
from tests.copies import own
from tests.gui.hands import PATIENCE_MS, click, front, idle


@pytest.fixture
def measured_project(finished_project: Path) -> Path:
    """A project whose targets are measured and which is not calibrated."""
    shutil.rmtree(finished_project / "results" / "runs")
    for path in sorted((finished_project / "results").rglob("*"), reverse=True):
        if path.is_file() and not path.name.startswith("targets"):
            path.unlink()
    return finished_project


@pytest.fixture
def open_page(window, qtbot):
    """Open a project and its calibrate page."""

    def opened(folder: Path):
        assert window.open_path(folder)
        window.show_page("calibrate")
        idle(window, qtbot)
        return window.page

    return opened


def show(page, name: str, qtbot) -> None:
    """Click on the name of a part."""
    click(page.findChild(QToolButton, f"step.{name}"), qtbot)
    assert page.step.name == name


def click_vector(plot, index: int, qtbot) -> None:
    """Click on an image point of a residual plot."""
    at = plot.canvas.mapFromScene(plot.canvas.box.mapViewToScene(QPointF(*plot._uv[index])))
    qtbot.mouseClick(plot.canvas.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(at.x(), at.y()))


def test_from_a_measured_project_to_a_second_run_without_a_target(
    open_page, window, measured_project: Path, notices, qtbot
) -> None:
    page = open_page(measured_project)
    assert page.step.name == "method"
    show(page, "captures", qtbot)
    assert page.captures.table.rowCount() == 13
    assert page.captures.summary.text() == ("8 testfields, 4 of them turned by a quarter, and 5 plates take part.")
    assert page.state.text().startswith("No calibration yet")
    click(page.run_button, qtbot)
    assert page.step.name == "run"
    idle(window, qtbot)
    # the run shows its convergence and brings the results to the front
    assert page.step.name == "results"
    assert page.run_part.convergence.said().startswith("After ")
    assert [table.title.text().split(".")[0] for table in page.results.tables[:3]] == [
        "Table 1a",
        "Table 1b",
        "Table 2",
    ]

    # choose one capture, click the point that misfits most there, exclude it, run again
    page.results.tabs.setCurrentIndex(1)
    residuals = page.results.residuals
    residuals.stations.setCurrentIndex(residuals.stations.findText("testfield-04"))
    shown = residuals._sets[0].residual[residuals._rows[0]]
    worst = int(np.argmax(np.hypot(*shown.T)))
    click_vector(residuals.plots[0], worst, qtbot)
    assert residuals.picked.text().startswith("testfield-04/camera")
    row, col = residuals._target()
    click(residuals.exclude, qtbot)
    assert read_capture(measured_project / "captures" / "testfield-04").excluded == ((row, col),)
    assert window.bench.session.statuses["calibrate"].state is State.STALE
    assert f"testfield-04 {row}/{col}" in page.pending.text()
    click(page.again_button, qtbot)
    idle(window, qtbot)
    assert page.step.name == "results"
    assert window.bench.session.statuses["calibrate"].state is State.DONE
    network = load_archive(measured_project / "results" / "runs" / "0002" / "adjustment.npz", Adjustment).network
    at = network.station_names.index("testfield-04/camera")
    seen = {network.point_names[p] for p in network.observation_point[network.observation_station == at]}
    assert f"{row}/{col}" not in seen

    # both runs are kept and stand side by side
    show(page, "runs", qtbot)
    assert page.runs.table.model.rowCount() == 2
    assert page.runs.comparison.model.rowCount() == 24
    project = read_project(measured_project)
    assert [run.excluded for run in list_runs(project)] == [{}, {"testfield-04": ((row, col),)}]
    page.runs.table.choose_row(1)  # the newest stands first
    click(page.runs.use_button, qtbot)
    assert current_runs(project) == {"photogrammetric": 1, "polynomial": 1}
    # that run does not know of the exclusion, so it is out of date, and says so
    assert window.bench.session.statuses["calibrate"].state is State.STALE
    assert "out of date" in page.state.text()
    assert not [n for n in notices if n.kind == "error"]


def test_a_capture_is_left_out_and_taken_in_by_keys(open_page, window, finished_project: Path, qtbot) -> None:
    page = open_page(finished_project)
    page.form.method.setCurrentIndex(page.form.method.findData("photogrammetric"))
    page.go_to("captures")
    page.captures.table.setFocus()
    page.captures.table.setCurrentCell(2, 0)
    with qtbot.waitActive(window):
        qtbot.keyClick(page.captures.table, Qt.Key.Key_Space)
    assert page.choice().options.without == ("testfield-03",)
    assert page.captures.summary.text().startswith("7 testfields")
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    idle(window, qtbot)
    run = list_runs(read_project(finished_project))[-1]
    assert run.options.without == ("testfield-03",)
    assert "testfield-03" not in run.captures["photogrammetric"]
    assert "without testfield-03" in page.results.made.text()
    page.go_to("captures")
    click(page.captures.all_button, qtbot)
    assert page.choice().options.without == ()


def test_too_few_captures_say_what_is_missing(open_page, window, finished_project: Path, qtbot) -> None:
    page = open_page(finished_project)
    page.go_to("captures")
    page.captures.set_without([f"testfield-0{i}" for i in range(2, 9)])
    assert "at least 2" in page.state.text()
    page.go_to("method")
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    assert page.step.name == "captures"
    assert not window.bench.jobs.busy


def test_a_whole_capture_is_left_out_from_its_residual_and_taken_back(
    open_page, window, finished_project: Path, qtbot
) -> None:
    page = open_page(finished_project)
    page.go_to("results")
    page.results.tabs.setCurrentIndex(1)
    residuals = page.results.residuals
    click_vector(residuals.plots[1], 0, qtbot)
    capture = residuals._capture()
    click(residuals.leave_out, qtbot)
    assert page.choice().options.without == (capture,)
    assert capture in page.pending.text()
    click_vector(residuals.plots[1], 5, qtbot)
    click(residuals.exclude, qtbot)
    click(page.take_back_button, qtbot)
    assert page.choice().options.without == ()
    assert not any(c.excluded for c in page.captures._shown)
    assert page._pending.isHidden()


def test_a_residual_opens_its_image_at_the_target(open_page, window, finished_project: Path, qtbot) -> None:
    page = open_page(finished_project)
    page.go_to("results")
    page.results.tabs.setCurrentIndex(1)
    residuals = page.results.residuals
    click_vector(residuals.plots[0], 40, qtbot)
    capture, target, uv = residuals._capture(), residuals._target(), residuals._sets[0].uv[40]
    click(residuals.open_image, qtbot)
    idle(window, qtbot)
    assert window.page.id == "measure"
    assert window.bench.session.capture_name == capture
    assert window.page.model.capture.name == capture
    assert window.page.model.target == target
    assert window.page.image.cursor_at == pytest.approx(tuple(uv), abs=3.0)  # the dot itself, not its neighbour


def test_a_held_parameter_is_told_and_missing_among_the_correlations(
    open_page, window, finished_project: Path, qtbot
) -> None:
    page = open_page(finished_project)
    page.form.method.setCurrentIndex(page.form.method.findData("photogrammetric"))
    box = page.form.parameters["projector.A6"]
    qtbot.mouseClick(box, Qt.MouseButton.LeftButton, pos=QPoint(10, box.height() // 2))
    assert page.choice().options.hold == ("projector.A6",)
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    idle(window, qtbot)
    page.results.tabs.setCurrentIndex(3)
    names = page.results.correlations.matrix._shown.names
    assert "projector.A6" not in names
    assert len(names) == 23  # twice nine and six of the relative orientation, without the held one
    page.results.correlations.matrix.point_at((1, 0))
    assert "camera.x0, camera.c" in page.results.correlations.readout.text()
    # opened anew, the page goes on from the run in use
    window.bench.session.close()
    assert open_page(finished_project).choice().options.hold == ("projector.A6",)


def test_cancelling_takes_less_than_half_a_second(open_page, window, project: Path, qtbot) -> None:
    page = open_page(project)
    assert page.step.name == "method"
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    assert page.step.name == "run"
    qtbot.waitUntil(lambda: window.bench.jobs.running is not None and window.bench.jobs.running.fraction > 0)
    started = time.monotonic()
    click(page.run_part.cancel_button, qtbot)
    idle(window, qtbot)
    assert time.monotonic() - started < 0.5
    assert "Cancelled" in page.run_part.state.text()
    assert not (project / "results").exists()
    assert page.run_button.isEnabled()


def test_a_failure_is_told_on_the_page_and_the_work_can_be_started_again(
    open_page, window, finished_project: Path, qtbot
) -> None:
    page = open_page(finished_project)
    page.form.method.setCurrentIndex(page.form.method.findData("polynomial"))
    page.form.degree.setCurrentIndex(page.form.degree.findData(5))  # of five plates: one too few
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    idle(window, qtbot)
    assert page.step.name == "run"
    assert page.run_part.state.text().startswith("Failed: ")
    page.form.degree.setCurrentIndex(page.form.degree.findData(3))
    click(page.run_button, qtbot)
    idle(window, qtbot)
    assert page.step.name == "results"


def test_runs_are_named_deleted_after_asking_and_compared(
    open_page, window, answers, finished_project: Path, qtbot
) -> None:
    project = read_project(finished_project)
    measure_project(project)
    calibrate_project(project)
    page = open_page(finished_project)
    page.go_to("runs")
    runs = page.runs
    runs.table.choose_row(1)
    qtbot.keyClicks(runs.name, "first")
    qtbot.keyClick(runs.name, Qt.Key.Key_Return)
    assert list_runs(project)[0].name == "first"
    assert "run 1: first" in runs.first.currentText()
    assert runs.chosen.number == 1  # not the newest, which the next button would have meant
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


def test_captures_are_left_out_and_the_next_pose_is_found_unless_it_is_cancelled(
    open_page, window, bench, finished_project: Path, notices, qtbot
) -> None:
    page = open_page(finished_project)
    page.go_to("results")
    front(page.results.tabs, "captures")
    pose, study = page.results.studies
    before = {path: path.stat().st_mtime_ns for path in finished_project.rglob("*")}
    click(study.ask_button, qtbot)
    assert not study.ask_button.isEnabled()
    qtbot.waitUntil(lambda: bench.jobs.running is not None and bench.jobs.running.fraction > 0)
    with qtbot.waitSignal(study._job.cancelled, timeout=PATIENCE_MS):
        click(window.job_bar.cancel, qtbot)
    assert study.table.isHidden()
    click(study.ask_button, qtbot)
    click(pose.ask_button, qtbot)
    idle(window, qtbot)
    assert study.verdicts.boxes[0].verdict.state == "passed"
    table = study.table.model.table
    assert table.columns[:5] == ("capture", "Camera [px]", "with it", "Projector [lines]", "with it")
    file = finished_project / "results" / "runs" / "0001" / "adjustment.npz"
    adjustment = load_archive(file, Adjustment)
    for capture, *residuals in table.rows:
        for device, (without, fitted) in zip(("camera", "projector"), (residuals[:2], residuals[2:4]), strict=True):
            station = adjustment.network.station_names.index(f"{capture}/{device}")
            v = adjustment.residuals[adjustment.network.observation_station == station]
            # adjusted again with estimated variances of the devices: weights are a little different
            assert fitted.value == pytest.approx(np.sqrt(np.nanmean(v**2)), rel=0.02)
            assert without.value > fitted.value
    study.table.choose_row(4)
    assert bench.session.capture_name == "testfield-05"
    assert pose.table.model.rowCount() == 3
    gains = [row[1].value for row in pose.table.model.table.rows]
    assert gains == sorted(gains)
    assert gains[0] < 0  # in per cent: the sigmas fall
    assert {path: path.stat().st_mtime_ns for path in finished_project.rglob("*")} == before
    # of another calibration it says nothing
    os.utime(own(file.with_name("photogrammetric.npz")))
    page.refresh()
    assert study.table.isHidden()
    assert pose.table.isHidden()
    assert not [n for n in notices if n.kind == "error"]
    # an answer that waits for a calibration is of that one: it was thrown away as another's
    bench.jobs.run("another", lambda progress: os.utime(finished_project / "results/runs/0001/photogrammetric.npz"))
    pose.ask()
    idle(window, qtbot)
    pose.refresh()
    assert pose.table.isVisible()


def test_the_object_points_tell_their_sigmas_in_every_direction(
    open_page, window, finished_project: Path, qtbot
) -> None:
    page = open_page(finished_project)
    page.go_to("results")
    page.results.tabs.setCurrentIndex(4)
    points = page.results.points
    assert points.table.model.rowCount() == len(points._shown.names)
    for i in range(points.axis.count()):
        points.axis.setCurrentIndex(i)
        assert len(points.points.getData()[0]) == len(points._shown.names)
    points.table.choose_row(7)
    assert points.readout.text().startswith(points._shown.names[7])
    page.results.tabs.setCurrentIndex(2)
    assert [view.image.shape for view in page.results.coverage.maps] == [
        (device.spec.height, device.spec.width) for device in page.results._view.adjustment.devices.values()
    ]
