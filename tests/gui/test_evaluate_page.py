"""The plane-table, from a calibrated project to the signed report and the exported files."""

from __future__ import annotations

import csv
import json
import os
import shutil
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from pypdf import PdfReader
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtWidgets import QToolButton

from core.pipeline.evaluate import load_evaluation
from core.pipeline.signed import load_sign_off
from core.project import read_project
from stripe_gui.presenters.stages import State
from tests.gui.hands import click, idle

pytestmark = pytest.mark.usefixtures("plain_reports")

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def calibrated(finished_project: Path) -> Path:
    """A project with its calibrations and nothing after them."""
    for name in ("evaluation.npz", "evaluation.json", "report/report.html", "report/report.pdf"):
        (finished_project / "results" / name).unlink()
    return finished_project


@pytest.fixture
def open_page(window, qtbot):
    """Open the page of a stage on a project."""

    def opened(folder: Path | None, stage: str = "evaluate"):
        assert folder is None or window.open_path(folder)
        window.show_page(stage)
        idle(window, qtbot)
        return window.page

    return opened


def values(path: Path) -> tuple[list[str], np.ndarray]:
    head, *rows = csv.reader(path.read_text(encoding="utf-8-sig").splitlines())
    return head, np.array([[float(x) if x else np.nan for x in row] for row in rows])


def test_from_the_calibrations_to_signed_pdf_and_csv(
    open_page, window, answers, notices, calibrated, tmp_path, qtbot
) -> None:
    page = open_page(calibrated)
    assert "not evaluated" in page.planes.item(0).text()
    click(page.run_button, qtbot)
    idle(window, qtbot)
    for name in ("maps", "profile", "histogram", "table"):
        click(page.findChild(QToolButton, f"step.{name}"), qtbot)
        assert page.step.name == name
    page = open_page(None, "report")
    qtbot.keyClicks(page.signing.operator, "A. Operator")
    qtbot.keyClicks(page.signing.instrument, "Rig 7")
    page.signing.with_tolerance.click()
    page.signing.limit.setValue(0.5)
    assert [box.verdict.state for box in page.signing.verdict.boxes] == ["passed"]
    page.signing.limit.setValue(0.001)
    assert [box.verdict.state for box in page.signing.verdict.boxes] == ["failed"]
    page.signing.limit.setValue(0.5)
    page.wanted["deviations"].click()
    answers.path = tmp_path / "out"
    click(page.export_button, qtbot)
    idle(window, qtbot)
    names = {p.name for p in answers.path.iterdir()}
    assert {"report.html", "report.pdf", "table-1a.csv", "table-2.csv", "table-3.csv", "profile-plane+00.csv"} <= names
    assert "deviations-plane+15-polynomial.csv" in names
    text = " ".join("".join(p.extract_text() for p in PdfReader(answers.path / "report.pdf").pages).split())
    assert "Signed off by A. Operator" in text
    click(page.run_button, qtbot)
    idle(window, qtbot)
    assert window.page.sentences[0].startswith("Signed off by A. Operator")
    assert {s.state for s in window.bench.session.statuses.values()} == {State.DONE}
    assert [n.kind for n in notices] == ["success"] * len(notices)


def test_exported_deviations_are_those_of_the_evaluation(open_page, window, answers, finished, tmp_path, qtbot) -> None:
    page = open_page(finished, "report")
    page.wanted["report"].click()
    page.wanted["deviations"].click()
    answers.path = tmp_path / "out"
    click(page.export_button, qtbot)
    idle(window, qtbot)
    for e in load_evaluation(read_project(finished)):
        head, found = values(tmp_path / "out" / f"deviations-{e.capture}-{e.method}.csv")
        assert head[-2:] == ["deviation [µm]", "sigma [µm]"]
        assert len(found) == e.n
        u, v = found[:, :2].astype(int).T
        np.testing.assert_allclose(found[:, 5], 1000 * e.deviation_mm[v, u], atol=0.0051)
        # who fits a plane to these points finds the deviations beside them
        points = found[:, 2:5] - found[:, 2:5].mean(axis=0)
        normal = np.linalg.svd(points, full_matrices=False)[2][2]
        np.testing.assert_allclose(points @ (normal * np.sign(normal[2])), e.deviation_mm[v, u], atol=2e-3)
        assert np.sqrt(np.mean(found[:, 6] ** 2)) == pytest.approx(1000 * e.predicted_rms_mm, rel=1e-3)


def test_only_what_is_ticked_is_evaluated_and_reported(open_page, window, calibrated, qtbot) -> None:
    page = open_page(calibrated)
    page.planes.setFocus()
    page.planes.setCurrentRow(1)
    qtbot.keyClick(page.planes, Qt.Key.Key_Space)
    page.calibrations.setCurrentRow(1)
    qtbot.keyClick(page.calibrations, Qt.Key.Key_Space)
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5)
    idle(window, qtbot)
    planes = json.loads((calibrated / "results" / "evaluation.json").read_text())["planes"]
    assert [(p["capture"], p["method"]) for p in planes] == [("plane+00", "photogrammetric")]
    click(open_page(None, "report").run_button, qtbot)
    idle(window, qtbot)
    html = (calibrated / "results" / "report" / "report.html").read_text()
    assert "plane+00" in html
    assert "plane+15" not in html
    assert open_page(None)._evaluated()  # what is ticked is still what is evaluated


def test_a_copied_calibration_keeps_its_date(open_page, calibrated, tmp_path) -> None:
    copy = shutil.copytree(calibrated, tmp_path / "copy")
    run = json.loads((copy / "results" / "runs" / "0001" / "run.json").read_text())
    for path in copy.rglob("*.npz"):
        os.utime(path, (2e9, 2e9))
    lines = [open_page(copy).calibrations.item(row).text() for row in range(2)]
    made = f"{datetime.fromisoformat(run['made_at']):%Y-%m-%d %H:%M}"
    assert all(f"calibrated {made}, run 1, up to date" in line for line in lines)


def test_unticking_everything_says_what_is_missing(open_page, calibrated, qtbot) -> None:
    page = open_page(calibrated)
    for row in range(page.planes.count()):
        page.planes.item(row).setCheckState(Qt.CheckState.Unchecked)
    assert page.chosen.text() == "Tick a plane."
    assert not page.run_button.isEnabled()


def test_cancelling_the_evaluation_leaves_the_one_before(open_page, window, finished_project, qtbot) -> None:
    file = finished_project / "results" / "evaluation.npz"
    before = file.read_bytes()
    page = open_page(finished_project)
    click(page.run_button, qtbot)
    qtbot.waitUntil(lambda: window.bench.jobs.running is not None)
    qtbot.mouseClick(window.job_bar.cancel, LEFT)
    idle(window, qtbot)
    assert file.read_bytes() == before


def test_the_cursor_reads_the_same_place_in_every_method(open_page, window, finished, qtbot) -> None:
    page = open_page(finished)
    assert page.go_to("maps")
    maps = page.deviations
    u, v = np.argwhere(np.isfinite(maps.maps[-1].image))[0][::-1] + 20
    first = maps.maps[0].canvas
    at = first.mapFromScene(first.box.mapViewToScene(QPointF(float(u), float(v))))
    qtbot.mouseMove(first.viewport(), QPoint(at.x(), at.y()))
    text = maps.readout.text()
    assert "µm" in text
    assert "mm" in text
    shown = [cursor.getData() for cursor in maps._cursors]
    here = [i for i, capture in enumerate(maps._captures) if capture == maps._captures[0]]
    assert len(here) == 2
    assert all(len(x) == (i in here) for i, (x, _) in enumerate(shown))
    assert len({(*x, *y) for i, (x, y) in enumerate(shown) if i in here}) == 1
    qtbot.keyClick(first, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    moved = int(shown[0][0][0]) + 1
    assert maps.readout.text().startswith(f"u {moved} ")
    value = 1000 * maps.maps[0].image[int(shown[0][1][0]), moved]
    assert f"photogrammetric {value:+.1f} µm" in maps.readout.text() or np.isnan(value)


def test_the_scale_is_one_for_all_maps_and_follows_the_operator(open_page, finished, qtbot) -> None:
    page = open_page(finished)
    assert page.go_to("maps")
    page.deviations.limit.setValue(0.05)
    levels = {tuple(m.image_item.levels) for m in (*page.deviations.maps, *page.profile.maps.maps)}
    assert levels == {(-0.05, 0.05)}
    click(page.deviations.automatic, qtbot)
    assert page.deviations.limit.value() == pytest.approx(page._view.limit_mm)


def test_a_line_is_drawn_by_mouse_and_moved_by_keys(open_page, window, finished, qtbot) -> None:
    page = open_page(finished)
    assert page.go_to("profile")
    canvas = page.profile.maps.maps[0].canvas
    places = [canvas.mapFromScene(canvas.box.mapViewToScene(QPointF(u, v))) for u, v in ((60.0, 60.0), (180.0, 100.0))]
    points = [QPoint(p.x(), p.y()) for p in places]
    before = canvas.box.viewRange()
    qtbot.mousePress(canvas.viewport(), LEFT, pos=points[0])
    qtbot.mouseMove(canvas.viewport(), points[1])
    qtbot.mouseRelease(canvas.viewport(), LEFT, pos=points[1])
    assert canvas.box.viewRange() == before  # drawing does not move the map
    pixel = canvas.box.viewPixelSize()[0]
    np.testing.assert_allclose(page.profile.line, [(60, 60), (180, 100)], atol=1.01 * pixel)
    u, v = page.profile.line[1]
    qtbot.keyClick(canvas, Qt.Key.Key_Right)
    qtbot.keyClick(canvas, Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier)
    assert page.profile.line[1] == (u + 1, v + 10)
    start = page.profile.line[0]
    qtbot.keyClick(canvas, Qt.Key.Key_1)
    qtbot.keyClick(canvas, Qt.Key.Key_Up)
    assert page.profile.line[0] == (start[0], start[1] - 1)
    curves = page.profile.plot.curves
    assert len(curves) == 2
    assert all(np.isfinite(curve.band).any() for curve in curves)


def test_a_sign_off_lapses_with_other_figures(open_page, window, finished_project, qtbot) -> None:
    page = open_page(finished_project, "report")
    qtbot.keyClicks(page.signing.operator, "A. Operator")
    click(page.run_button, qtbot)
    idle(window, qtbot)
    project = read_project(finished_project)
    evaluations = load_evaluation(project)
    assert load_sign_off(project, evaluations).operator == "A. Operator"
    assert load_sign_off(project, evaluations[1:]) is None


def test_a_damaged_sign_off_is_told(open_page, window, notices, finished_project) -> None:
    (finished_project / "results" / "runs" / "0001" / "sign-off.json").write_text("{")
    open_page(finished_project, "report")
    assert any(n.kind == "error" and "sign-off.json" in n.happened for n in notices)


def test_without_planes_or_calibrations_the_page_says_what_to_do_first(open_page, project: Path) -> None:
    page = open_page(project)
    assert page.chosen.text() == "Calibrate first."
    assert not page.run_button.isEnabled()
