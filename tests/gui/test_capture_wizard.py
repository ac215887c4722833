"""The capture wizard on the virtual bench: from two devices to a stored capture, by clicks and keys."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPushButton

from core.capture import capture_status
from core.patterns import Black, Code, Phase, White
from core.project import read_capture, read_image, read_project
from stripe_gui.presenters.capturing import Subject, in_scene, next_name, scene_for, url_problem
from stripe_gui.presenters.looking import Rig
from stripe_gui.widgets.pattern_strip import picture
from stripe_gui.wizards.capture.picture import hatch
from tests.gui.hands import click, idle


@pytest.fixture
def wizard(window, project: Path, qtbot):
    """The wizard on a recorded project, both virtual devices tested; opened as an operator does."""
    return opened(window, project, qtbot)


def opened(window, folder: Path, qtbot):
    """Open the wizard by its keys, and wait for the devices."""
    assert window.open_path(folder)
    window.show_page("capture")
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    page = window.page
    assert page.id == "capture-wizard"
    qtbot.waitUntil(lambda: page.devices.connection is not None, timeout=60_000)
    return page


def go_to(wizard, name: str, qtbot) -> None:
    while wizard.step.name != name:
        click(wizard.next_button, qtbot)


def take(wizard, qtbot) -> None:
    go_to(wizard, "take", qtbot)
    click(wizard.taking.start_button, qtbot)
    qtbot.waitUntil(lambda: not wizard.taking.running, timeout=60_000)


def test_from_the_capture_page_to_a_stored_capture(wizard, window, project: Path, notices, qtbot) -> None:
    assert "160 × 160" in wizard.devices.connection.words[0]
    click(wizard.next_button, qtbot)
    assert wizard.subject.name.text() == "testfield-09"
    assert wizard.subject.pose.isHidden()  # nothing is calibrated
    click(wizard.next_button, qtbot)
    assert wizard.sequence.strip.count() == len(wizard.devices.connection.patterns)
    take(wizard, qtbot)
    assert set(wizard.taking.strip.states) == {"taken"}
    assert {f.check for f in wizard.taking.findings.findings} >= {"identity", "movement", "lamp", "saturation"}
    capture = read_capture(project / "captures" / "testfield-09")
    assert tuple(f.pattern for f in capture.frames) == wizard.devices.connection.patterns
    assert capture.testfield is not None
    assert project / "captures" / "testfield-09" in read_project(project).captures
    idle(window, qtbot)
    click(wizard.next_button, qtbot)
    assert window.page.id == "capture"
    assert window.bench.session.capture_name == "testfield-09"
    assert not [n for n in notices if n.kind == "error"]


def test_the_best_pose_for_a_calibrated_rig_is_told_beside_the_live_picture(
    window, finished_project: Path, qtbot
) -> None:
    wizard = opened(window, finished_project, qtbot)
    subject = wizard.subject
    go_to(wizard, "subject", qtbot)
    click(subject.pose.ask_button, qtbot)
    idle(window, qtbot)
    first, second, third = (row[0] for row in subject.pose.table.model.table.rows)
    for row, words in ((None, first), (1, second)):  # the first, unless another is chosen
        if row is not None:
            subject.pose.table.choose_row(row)
        go_to(wizard, "picture", qtbot)
        assert words in wizard.picture.pose.text()
        assert wizard.picture.pose.isVisible()
        wizard.go_to("subject")
    # the pose that was captured stayed the one that was told
    subject.role.setCurrentIndex(subject.role.findData("plane"))
    wizard.taking.stored.emit()
    subject.role.setCurrentIndex(subject.role.findData("testfield"))
    assert subject.pose_words == second
    take(wizard, qtbot)
    assert subject.pose_words == third
    wizard.taking.stored.emit()
    assert not subject.pose_words
    assert subject.pose.ask_button.isEnabled()
    subject.role.setCurrentIndex(subject.role.findData("object"))
    assert subject.pose.isHidden()
    wizard.go_to("picture")
    assert wizard.picture.pose.isHidden()


def test_whoever_leaves_for_other_pictures_lets_the_devices_go(wizard, window, qtbot) -> None:
    go_to(wizard, "picture", qtbot)
    qtbot.waitUntil(lambda: wizard.picture.view.image is not None, timeout=60_000)
    click(wizard.close_button, qtbot)
    assert window.page.id == "capture"  # it reads a frame at once
    with_devices = wizard.rig.setting is not None
    qtbot.waitUntil(lambda: wizard.rig.setting is None, timeout=10_000)
    assert with_devices


def test_one_frame_is_taken_again_by_the_keyboard(wizard, window, project: Path, qtbot) -> None:
    take(wizard, qtbot)
    folder = project / "captures" / "testfield-09"
    before = [f.path.name for f in read_capture(folder).frames]
    wizard.taking.strip.setFocus()
    wizard.taking.strip.setCurrentRow(4)
    qtbot.keyClick(wizard.taking.strip, Qt.Key.Key_Right)
    frame = wizard.taking.strip.currentRow()
    assert frame == 5
    qtbot.keyClick(wizard.taking.retake_button, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: not wizard.taking.running, timeout=60_000)
    after = [f.path.name for f in read_capture(folder).frames]
    assert [i for i, name in enumerate(after) if name != before[i]] == [frame]
    idle(window, qtbot)


def test_cancelled_within_half_a_second_and_gone_on_with_later(wizard, window, project: Path, qtbot) -> None:
    slow = "&exposure_ms=60"
    wizard.devices.camera.url.setText(wizard.devices.urls[1] + slow)
    assert wizard.devices.missing()
    click(wizard.devices.test_button, qtbot)
    qtbot.waitUntil(lambda: not wizard.devices.missing(), timeout=60_000)
    go_to(wizard, "take", qtbot)
    click(wizard.taking.start_button, qtbot)
    qtbot.waitUntil(lambda: wizard.taking.strip.states.count("taken") > 3, timeout=60_000)
    start = time.monotonic()
    click(wizard.taking.cancel_button, qtbot)
    qtbot.waitUntil(lambda: not wizard.taking.running, timeout=10_000)
    assert time.monotonic() - start < 0.5
    folder = project / "captures" / "testfield-09"
    status = capture_status(folder)
    assert 3 < status.taken < status.planned
    assert folder not in read_project(project).captures
    idle(window, qtbot)
    click(wizard.close_button, qtbot)
    # another day: the interrupted capture is offered, its frames are kept
    window.show_page("capture-wizard")
    qtbot.waitUntil(lambda: not wizard.devices.missing(), timeout=60_000)
    click(wizard.next_button, qtbot)
    assert wizard.subject.interrupted.count() == 1
    assert f"{status.taken} of {status.planned}" in wizard.subject.interrupted.item(0).text()
    wizard.subject.interrupted.setCurrentRow(0)
    qtbot.keyClick(wizard.subject.interrupted, Qt.Key.Key_Return)
    assert wizard.subject.name.text() == "testfield-09"
    take(wizard, qtbot)
    assert wizard.taking.report.resumed >= status.taken
    assert capture_status(folder).state == "complete"
    idle(window, qtbot)


def test_another_like_this_takes_the_next_pose(wizard, window, project: Path, qtbot) -> None:
    take(wizard, qtbot)
    first = wizard.devices.urls[0]
    idle(window, qtbot)
    click(wizard.taking.another_button, qtbot)
    assert wizard.step.name == "picture"
    assert wizard.subject.name.text() == "testfield-10"
    assert wizard.devices.urls[0] != first
    take(wizard, qtbot)
    images = [
        read_image(read_capture(project / "captures" / n).frames[0].path).astype(float)
        for n in ("testfield-09", "testfield-10")
    ]
    assert np.abs(images[0] - images[1]).max() > 50  # the board stands elsewhere
    idle(window, qtbot)


def test_the_live_picture_marks_and_counts_what_is_over_exposed(wizard, window, qtbot) -> None:
    go_to(wizard, "picture", qtbot)
    step = wizard.picture
    qtbot.waitUntil(lambda: step.clipped.text() == "0.00 %", timeout=30_000)
    assert not step.marks.isVisible()
    step.exposure.setValue(4.0)
    qtbot.waitUntil(lambda: step.marks.isVisible(), timeout=30_000)
    share = step._look.clipped.mean()
    assert step.clipped.text() == f"{100 * share:.2f} %"
    assert share == pytest.approx(np.mean(step._look.image == 255))
    assert "gain=4" in wizard.devices.urls[1]
    assert not wizard.devices.missing()
    step.light.setCurrentIndex(step.light.findData("black"))
    qtbot.waitUntil(lambda: step._look.image.mean() < 60, timeout=30_000)
    step.live.setChecked(False)
    idle(window, qtbot)


def test_the_rig_is_checked_with_a_picture_or_curve_of_every_check(wizard, window, qtbot) -> None:
    go_to(wizard, "checks", qtbot)
    step = wizard.checks
    assert step.words.text().startswith("Worth doing once")  # no count of checks that nobody has run
    click(step.run_button, qtbot)
    qtbot.waitUntil(lambda: not step.running, timeout=120_000)
    assert {f.check for f in step.findings.findings} == {
        "exposure", "settle", "linearity", "focus", "order", "orientation",
    }  # fmt: skip
    for i in range(step.findings.count()):
        step.findings.setCurrentRow(i)
        assert step.stack.currentWidget() is not step.nothing
    assert " of 6 checks are good" in step.words.text()
    for z_mm in (-50.0, 50.0):
        step.z.setValue(z_mm)
        click(step.depth_button, qtbot)
        qtbot.waitUntil(lambda: not step.running, timeout=60_000)
    depth = next(f for f in step.findings.findings if f.check == "visibility")
    assert [z for z, _ in depth.curve] == [-50.0, 50.0]
    idle(window, qtbot)
    step.clear()  # another rig
    assert step.words.text().startswith("Worth doing once")
    assert step.stack.currentWidget() is step.nothing


def test_devices_that_do_not_answer_are_told_in_words_and_close_the_way(wizard, window, tmp_path, qtbot) -> None:
    card = wizard.devices.camera
    card.kind.setCurrentIndex(card.kind.findData("folder"))
    assert card.url.text().startswith("folder:")
    assert "tethered" in card.explanation.text()
    card.url.setText(f"folder:{tmp_path}/nowhere")
    click(wizard.devices.test_button, qtbot)
    idle(window, qtbot)
    assert "Test the connection first." in wizard.devices.missing()
    assert not wizard.next_button.isEnabled()
    card.url.setText("nonsense")
    assert "KIND:PLACE" in card.explanation.text()


def test_a_camera_of_another_size_is_told(wizard, window, qtbot) -> None:
    wizard.devices.projector.url.setText("virtual:flat")
    wizard.devices.camera.url.setText("virtual:flat")
    click(wizard.devices.test_button, qtbot)
    idle(window, qtbot)
    assert wizard.devices.missing()
    texts = [
        wizard.devices.result.itemAt(i).widget().findChildren(type(wizard.heading))[-1].text()
        for i in range(wizard.devices.result.count())
    ]
    assert any("64x64" in text for text in texts)


def test_what_belongs_to_a_role_is_asked_and_names_are_free(wizard, qtbot) -> None:
    go_to(wizard, "subject", qtbot)
    step = wizard.subject
    step.role.setCurrentIndex(step.role.findData("plane"))
    step.angle.setValue(15.0)
    assert step.name.text() == "plane+15-2"
    assert step.subject == Subject("plane", "plane+15-2", None, 15.0, None)
    assert wizard.devices.urls[0].endswith("shot=plane%2B15")
    step.role.setCurrentIndex(step.role.findData("depth"))
    assert step.board.currentText() == "plate.csv"
    step.name.setText("depth-01")
    assert "already" in step.missing()
    assert not wizard.next_button.isEnabled()


def test_a_capture_that_fails_is_told_and_can_go_on(wizard, window, project: Path, notices, qtbot) -> None:
    good = wizard.devices.camera.url.text()
    bad = f"{good}&faults=no-frame@12,no-frame@13,no-frame@14"
    go_to(wizard, "take", qtbot)
    wizard.devices.camera.url.setText(bad)
    click(wizard.taking.start_button, qtbot)
    qtbot.waitUntil(lambda: not wizard.taking.running, timeout=60_000)
    assert notices[-1].kind == "error"
    assert "no image" in notices[-1].happened
    wizard.devices.camera.url.setText(good)
    click(wizard.taking.start_button, qtbot)
    qtbot.waitUntil(lambda: not wizard.taking.running, timeout=60_000)
    assert wizard.taking.report is not None
    assert wizard.taking.report.resumed > 0
    idle(window, qtbot)


def test_everything_has_a_name_for_those_who_cannot_see(wizard, qtbot) -> None:
    for step in ("devices", "subject", "sequence", "picture", "checks", "take"):
        assert wizard.go_to(step)
        for button in wizard.step.body.findChildren(QPushButton):
            assert button.accessibleName(), (step, button.text())
    assert wizard.taking.strip.item(0).data(Qt.ItemDataRole.AccessibleTextRole).endswith("not taken yet")


# ------------------------------------------------------------------------------------------------- without a window


@pytest.mark.parametrize(
    ("subject", "taken", "wanted"),
    [
        (Subject("testfield"), [], "testfield-01"),
        (Subject("testfield"), ["testfield-01", "testfield-03"], "testfield-02"),
        (Subject("depth", z_mm=5.0), ["depth-01"], "depth-02"),
        (Subject("plane", angle_deg=0.0), [], "plane+00"),
        (Subject("plane", angle_deg=-7.4), [], "plane-07"),
        (Subject("object"), ["object-sphere"], "object-01"),
    ],
)
def test_the_next_free_name_is_proposed(subject: Subject, taken: list[str], wanted: str) -> None:
    assert next_name(subject, taken) == wanted


def test_the_virtual_bench_shows_what_suits_the_capture() -> None:
    names = ["testfield-01", "testfield-02", "depth-01", "plane+00"]
    assert scene_for("testfield-02", "testfield", names) == "testfield-02"
    assert scene_for("testfield-11", "testfield", names) == "testfield-01"
    assert scene_for("plane-15", "plane", names) == "plane+00"
    assert in_scene("virtual:quick?seed=2", "plane+00") == "virtual:quick?seed=2&shot=plane%2B00"
    assert in_scene("serial:/dev/ttyUSB0", "plane+00") == "serial:/dev/ttyUSB0"
    assert url_problem("virtual:quick") == ""


@pytest.mark.parametrize(
    "pattern", [White(), Black(), Code("gray", "y", 0, 9, 2), Phase("x", 4.0, 4, 0, 0.0, "square")]
)
def test_little_pictures_show_stripes_one_can_see(pattern) -> None:
    drawn, enlarged = picture(pattern, (640, 640), 48)
    assert drawn.shape == (48, 48)
    assert enlarged == isinstance(pattern, Phase)
    if isinstance(pattern, Phase):  # two lines on, two off: every stripe is four pixels wide
        edges = np.flatnonzero(np.diff(drawn[0].astype(int)))
        assert set(np.diff(edges)) == {4}


def test_hatching_marks_exactly_the_clipped_pixels() -> None:
    clipped = np.random.default_rng(1).random((40, 50)) > 0.5
    marks = hatch(clipped, "#b42318")
    assert np.array_equal(marks[..., 3] > 0, clipped)
    assert len({tuple(m) for m in marks[clipped]}) == 2  # lines of two brightnesses, not a colour alone


def test_a_look_that_fails_lets_the_devices_go(tmp_path: Path) -> None:
    rig = Rig()
    with pytest.raises(Exception, match="no image"):
        rig.look(("virtual:flat", "virtual:flat?faults=no-frame:1"))
    assert rig.setting is None
    assert rig.look(("virtual:flat", "virtual:flat")).image.shape == (72, 96)
    rig.close()


def test_a_copied_transcript_of_a_cut_capture_is_offered(wizard, project: Path, qtbot) -> None:
    take(wizard, qtbot)
    folder = project / "captures" / "testfield-09"
    cut = Path(shutil.copytree(folder, project / "captures" / "testfield-10"))
    document = json.loads((cut / "capture.json").read_text())
    document |= {"state": "taking", "planned": [f["pattern"] for f in document["frames"]], "frames": []}
    (cut / "capture.json").write_text(json.dumps(document))
    click(wizard.taking.another_button, qtbot)
    assert wizard.subject.interrupted.count() == 1
    assert wizard.subject.name.text() == "testfield-11"
