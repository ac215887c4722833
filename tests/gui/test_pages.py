"""The seven pages, driven by clicks and keys on a small recorded project."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt

from stripe_gui.presenters.stages import State
from tests.copies import own
from tests.gui.hands import click, idle

pytestmark = pytest.mark.usefixtures("plain_reports")


@pytest.fixture
def open_window(window, qtbot):
    """Open a project and wait until nothing is under way."""

    def opened(folder: Path, page: str):
        assert window.open_path(folder)
        window.show_page(page)
        idle(window, qtbot)
        return window.page

    return opened


def test_the_capture_page_shows_captures_frames_and_the_frame(open_window, window, recorded: Path, qtbot) -> None:
    page = open_window(recorded, "capture")
    assert page.captures.count() == len(window.bench.session.folder.captures())
    assert "gray bit 0 of 7 across columns" in page.frames.item(0).text()
    assert page.view.image is not None
    first = page.view.image.copy()
    qtbot.keyClick(page.frames, Qt.Key.Key_Down)
    idle(window, qtbot)
    assert not np.array_equal(first, page.view.image)


def test_a_capture_that_cannot_be_read_says_why_on_the_page(open_window, project: Path) -> None:
    (project / "captures" / "testfield-01" / "capture.json").write_text("{")
    page = open_window(project, "capture")
    assert "not JSON" in page.figures.text()
    assert page.view.image is None


def test_a_truncated_frame_says_why_on_the_page(open_window, project: Path) -> None:
    frame = project / "captures" / "testfield-01" / "000.png"
    own(frame).write_bytes(frame.read_bytes()[:500])
    page = open_window(project, "capture")
    assert "truncated" in page.figures.text()


def test_the_chosen_capture_is_the_same_on_every_page(open_window, window, recorded: Path, qtbot) -> None:
    page = open_window(recorded, "capture")
    page.captures.setCurrentRow(page.captures.names().index("plane+15"))
    window.show_page("decode")
    idle(window, qtbot)
    assert window.page.captures.currentItem().text().startswith("plane+15")


def test_the_decode_page_shows_every_map_with_levels_of_the_device(open_window, window, recorded: Path, qtbot) -> None:
    page = open_window(recorded, "decode")
    lines = window.bench.session.folder.project.projector.width
    assert tuple(page.view.image_item.levels) == (0, lines - 1)
    assert page.figures.model.rowCount() > 3
    for i in range(page.kind.count()):
        page.kind.setCurrentIndex(i)
        assert page.view.image is not None
    v, u = np.argwhere(np.isfinite(page._phase.u))[0]
    assert "±" in page.view._extra(int(u), int(v))


def test_decoding_everything_marks_the_stage_done(open_window, window, project: Path, edit_json, qtbot) -> None:
    edit_json(project / "project.json", captures=["captures/testfield-01", "captures/depth-01", "captures/plane+00"])
    page = open_window(project, "decode")
    click(page.all_button, qtbot)
    idle(window, qtbot)
    assert window.bench.session.statuses["decode"].state is State.DONE
    assert (project / "results" / "decode.json").is_file()


def test_measuring_shows_targets_and_points_at_the_chosen_one(
    open_window, window, project: Path, edit_json, qtbot
) -> None:
    edit_json(project / "project.json", captures=["captures/testfield-01", "captures/testfield-02"])
    page = open_window(project, "measure")
    assert len(page._shown.marks.picks) == 4
    click(page.run_button, qtbot)
    idle(window, qtbot)
    assert window.bench.session.statuses["measure"].state is State.DONE
    assert len(page._shown.marks.measured) > 50
    page.side.targets.choose_row(7)
    assert page.model.target == page._shown.targets[7]


def test_the_options_explain_their_consequences(open_window, recorded: Path) -> None:
    page = open_window(recorded, "calibrate")
    before = page.form._consequences[page.form.rigid].text()
    page.form.rigid.setChecked(False)
    assert page.form._consequences[page.form.rigid].text() not in ("", before)
    page.form.method.setCurrentIndex(page.form.method.findData("polynomial"))
    assert not page.form.rigid.isEnabled()
    assert page.choice().method == "polynomial"


def test_a_residual_leads_to_its_image(open_window, window, finished: Path, qtbot) -> None:
    page = open_window(finished, "calibrate")
    assert page.step.name == "results"  # there are some: they are what is looked at first
    page.results.tabs.setCurrentIndex(1)
    page.results.residuals._pick(0, 3)
    assert "µm" in page.results.residuals.picked.text()
    capture = page.results.residuals._capture()
    click(page.results.residuals.open_image, qtbot)
    assert window.page.id == "measure"
    assert window.bench.session.capture_name == capture


def test_a_calibration_that_fails_is_told_and_kept(open_window, window, notices, project: Path, qtbot) -> None:
    frame = project / "captures" / "testfield-03" / "003.png"
    own(frame).write_bytes(frame.read_bytes()[:500])
    page = open_window(project, "calibrate")
    click(page.run_button, qtbot)
    idle(window, qtbot)
    assert notices[-1].kind == "error"
    assert "003.png" in notices[-1].happened
    assert "Traceback" in notices[-1].details
    status = window.bench.session.statuses["calibrate"]
    assert status.state is State.FAILED
    assert not list(project.glob("results/**/photogrammetric.npz"))


def test_cancelling_a_calibration_leaves_the_project_as_it_was(open_window, window, project: Path, qtbot) -> None:
    page = open_window(project, "calibrate")
    click(page.run_button, qtbot)
    qtbot.waitUntil(lambda: window.bench.jobs.running is not None and window.bench.jobs.running.fraction > 0)
    qtbot.mouseClick(window.job_bar.cancel, Qt.MouseButton.LeftButton)
    idle(window, qtbot)
    assert not (project / "results").exists()
    assert window.bench.session.statuses["calibrate"].state is State.TODO


def test_reconstructing_shows_the_surface_and_exports_it(
    open_window, window, answers, finished_project, tmp_path, qtbot
):
    page = open_window(finished_project, "reconstruct")
    window.bench.session.choose_capture("object-sphere")
    click(page.run_button, qtbot)
    idle(window, qtbot)
    shown = []
    for i in range(page.kind.count()):
        page.kind.setCurrentIndex(i)
        idle(window, qtbot)
        shown.append(page.view.image)
    shaded, height, depth, sigma, _ = shown
    assert np.array_equal(shaded, height, equal_nan=True)
    assert np.nanmax(height) - np.nanmin(height) > 3
    assert np.nanmedian(depth) < -100
    assert np.nanmin(sigma) > 0
    assert page.stack.currentWidget() is page.space
    for ending in ("ply", "xyz", "npz"):
        answers.path = tmp_path / f"sphere.{ending}"
        click(page.export_button, qtbot)
        idle(window, qtbot)
        assert answers.path.stat().st_size > 1000
    points = np.loadtxt(tmp_path / "sphere.xyz")
    assert points.shape == (page._points.count, 3)


def test_captures_are_merged_and_shown_by_what_made_them(
    open_window, window, answers, finished_project, tmp_path, qtbot
) -> None:
    page = open_window(finished_project, "reconstruct")
    answers.path = tmp_path / "both.ply"
    click(page.merge_button, qtbot)
    idle(window, qtbot)
    assert page.stack.currentWidget() is page.space
    said, points = page.state.text(), answers.path.read_bytes().partition(b"element vertex ")[2].split(b"\n")[0]
    assert "2 captures" in said
    counts = [int(part.split()[-1]) for part in said.split("&emsp;")[1:]]
    assert page.state.textFormat() == Qt.TextFormat.RichText  # else the colours' tags are shown as they are written
    assert "testfield-01" in said
    assert sum(counts) == int(points)


def test_the_planes_are_shown_on_one_scale_and_zoom_together(open_window, finished: Path, qtbot) -> None:
    page = open_window(finished, "evaluate")
    maps = page.deviations.maps
    assert len(maps) == 4
    assert len({tuple(m.image_item.levels) for m in maps}) == 1
    qtbot.keyClick(maps[0].canvas, Qt.Key.Key_Plus)
    ranges = [np.ptp(m.canvas.box.viewRange()[0]) for m in maps]
    assert np.allclose(ranges, ranges[0], rtol=0.02)
    assert page.table.model.rowCount() == 4


def test_a_project_changed_elsewhere_is_shown_after_looking_again(open_window, window, finished_project, qtbot) -> None:
    open_window(finished_project, "report")
    (finished_project / "results" / "report" / "report.html").unlink()
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_R, Qt.KeyboardModifier.ControlModifier)
    idle(window, qtbot)
    assert window.bench.session.statuses["report"].state is State.TODO
    assert not window.page.html_button.isEnabled()
