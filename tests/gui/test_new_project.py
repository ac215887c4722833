"""From the empty start page to a new project, by clicks and keys; what is refused, with the reason."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QAbstractButton, QAbstractSpinBox, QCheckBox, QComboBox, QLineEdit, QPushButton

from core.project import nominal_testfield, read_project, read_testfield, write_testfield
from core.report.board import board_sheet
from stripe_gui.main_window import MainWindow
from stripe_gui.wizards.new_project.wizard import NewProjectWizard
from tests.gui.hands import click

LEFT, NO_KEY = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
FIELDS = (QLineEdit, QAbstractSpinBox, QComboBox, QCheckBox, QPushButton)
CONTROL, ALT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.AltModifier


@pytest.fixture
def wizard(window: MainWindow, qtbot, tmp_path: Path, bench) -> NewProjectWizard:
    """The wizard, opened by its shortcut, with a folder of the test's own."""
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_N, CONTROL)
    page = window.page
    assert isinstance(page, NewProjectWizard)
    retype(qtbot, page.place.folder, str(tmp_path / "rig"))
    return page


def retype(qtbot, field: QLineEdit | QAbstractSpinBox, text: str) -> None:
    """Replace what a field holds, by keys."""
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, text)
    if isinstance(field, QAbstractSpinBox):
        field.interpretText()


def on_sign(made: QAbstractButton) -> QPoint:
    """Where a check box or radio button is clicked."""
    return QPoint(12, made.height() // 2)


def card_button(window: MainWindow, text: str) -> QAbstractButton:
    return next(b for b in window.page.findChildren(QAbstractButton) if b.text().strip() == text)


def test_from_the_empty_start_page_to_the_opened_project_by_clicks(
    window: MainWindow, answers, tmp_path: Path, notices, qtbot
) -> None:
    assert window.page.id == "start"
    click(card_button(window, "New project"), qtbot)
    page = window.page
    assert isinstance(page, NewProjectWizard)
    retype(qtbot, page.place.name, "Rig four")
    answers.path = tmp_path / "new"
    answers.path.mkdir()
    click(page.place.choose_button, qtbot)
    assert page.place.folder.text() == str(answers.path)
    click(page.next_button, qtbot)
    assert page.step.name == "rig"
    retype(qtbot, page.rig.camera.c, "16.5")
    assert page.rig.preset.currentText() == "Custom"
    click(page.next_button, qtbot)
    retype(qtbot, page.field.rows, "9")
    retype(qtbot, page.field.columns, "11")
    retype(qtbot, page.field.spacing, "20")
    click(page.next_button, qtbot)
    qtbot.mouseClick(page.plate.wanted, LEFT, pos=on_sign(page.plate.wanted))
    for _ in range(3):  # depth plate, scale, sequence
        click(page.next_button, qtbot)
    assert page.step.name == "summary"
    assert "9 rows × 11 columns" in page.summary.rows["field"].text()
    assert list(answers.path.iterdir()) == []  # nothing is written before the last button
    click(page.next_button, qtbot)
    assert window.bench.session.folder.path == answers.path.resolve()
    assert window.page.id == "capture"
    assert "Rig four" in window.windowTitle()
    assert [n.kind for n in notices] == ["success"]
    project = read_project(answers.path)
    assert project.camera.nominal_c_mm == 16.5
    assert (project.camera.width, project.projector.width) == (748, 640)
    assert project.scale is None
    field = read_testfield(answers.path / "testfield.csv")
    assert len(field.row) == 99
    assert field.xyz_mm[0].tolist() == [-100.0, 80.0, 0.0]
    assert read_testfield(answers.path / "plate.csv").polarity == "black-on-white"


def test_the_keyboard_alone_makes_a_project(
    window: MainWindow, wizard: NewProjectWizard, tmp_path: Path, qtbot
) -> None:
    with qtbot.waitActive(window):
        for _ in range(6):
            qtbot.keyClick(window, Qt.Key.Key_Right, ALT)
    assert wizard.step.name == "summary"
    wizard.next_button.setFocus()
    qtbot.keyClick(wizard.next_button, Qt.Key.Key_Space)
    assert window.bench.session.folder.path == (tmp_path / "rig").resolve()
    assert sorted(p.name for p in (tmp_path / "rig").iterdir()) == ["project.json", "testfield.csv"]


def test_every_field_is_reached_by_tab(window: MainWindow, wizard: NewProjectWizard, qapp, qtbot) -> None:
    wizard.plate.wanted.setChecked(True)
    wizard.scale.wanted.setChecked(True)
    wizard.scale.length.setValue(259.6)
    with qtbot.waitActive(window):
        for step in wizard.steps:
            assert wizard.go_to(step.name)
            wizard.setFocus()
            reached = set()
            for _ in range(60):
                qtbot.keyClick(qapp.focusWidget(), Qt.Key.Key_Tab)
                reached.add(qapp.focusWidget())
            asked = {w for kind in FIELDS for w in step.body.findChildren(kind) if w.isVisible() and w.isEnabled()}
            inside = {box.lineEdit() for box in step.body.findChildren(QAbstractSpinBox)}
            assert asked - inside <= reached, step.name


@pytest.mark.parametrize("held", ["notes.txt", "project.json"])
def test_a_folder_that_is_not_empty_is_refused_with_the_reason(
    wizard: NewProjectWizard, tmp_path: Path, held: str, qtbot
) -> None:
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / held).touch()
    retype(qtbot, wizard.place.folder, str(tmp_path / "used"))
    assert not wizard.next_button.isEnabled()
    assert "is not empty" in wizard.next_button.accessibleDescription()
    assert held in wizard.next_button.accessibleDescription()
    assert not wizard.go_to("summary")


@pytest.mark.parametrize(
    ("name", "folder", "told"), [("", None, "name"), ("Rig", "", "folder"), ("Rig", "here", "full")]
)
def test_a_missing_name_or_folder_is_said(
    wizard: NewProjectWizard, name: str, folder: str | None, told: str, qtbot
) -> None:
    wizard.place.name.setText(name)
    if folder is not None:
        wizard.place.folder.setText(folder)
    assert told in wizard.next_button.accessibleDescription()


def test_the_folder_follows_the_name_until_it_is_chosen(window: MainWindow, qtbot, bench, tmp_path: Path) -> None:
    bench.settings.add_recent(tmp_path / "earlier")
    window.show_page("new-project")
    page = window.page
    retype(qtbot, page.place.name, "Rig 7 / left")
    assert page.place.folder.text() == str(tmp_path / "rig-7-left")
    retype(qtbot, page.place.folder, str(tmp_path / "mine"))
    retype(qtbot, page.place.name, "Another")
    assert page.place.folder.text() == str(tmp_path / "mine")


def test_a_folder_filled_meanwhile_is_left_alone(wizard: NewProjectWizard, tmp_path: Path, notices, qtbot) -> None:
    assert wizard.go_to("summary")
    (tmp_path / "rig").mkdir()
    (tmp_path / "rig" / "other.txt").write_text("kept")
    click(wizard.next_button, qtbot)
    assert [n.kind for n in notices] == ["error"]
    assert not wizard.session.is_open
    assert [p.name for p in (tmp_path / "rig").iterdir()] == ["other.txt"]


def test_presets_fill_the_numbers_and_a_typed_one_makes_it_custom(wizard: NewProjectWizard, qtbot) -> None:
    wizard.go_to("rig")
    preset = wizard.rig.preset
    preset.setFocus()
    qtbot.keyClick(preset, Qt.Key.Key_Down)
    assert wizard.rig.rig().camera.width == 2448
    assert wizard.rig.rig().projector.pitch_mm == (0.0076, 0.0076)
    retype(qtbot, wizard.rig.projector.width, "1920")
    assert preset.currentText() == "Custom"
    assert wizard.rig.rig().projector.width == 1920
    retype(qtbot, wizard.rig.projector.width, "1280")
    assert preset.currentIndex() == 1


def test_the_sketch_follows_the_numbers(wizard: NewProjectWizard, qtbot) -> None:
    wizard.go_to("rig")
    before = wizard.rig.sketch.grab().toImage()
    narrow = wizard.rig.view.camera.field_mm[0]
    retype(qtbot, wizard.rig.distance, "1200")
    assert wizard.rig.view.camera.field_mm[0] == pytest.approx(2 * narrow)
    assert wizard.rig.sketch.grab().toImage() != before
    retype(qtbot, wizard.rig.base, "1500")
    assert "base" in wizard.next_button.accessibleDescription()


def test_targets_that_overlap_are_refused(wizard: NewProjectWizard, qtbot) -> None:
    wizard.go_to("testfield")
    assert wizard.field.picture.sheet is not None
    retype(qtbot, wizard.field.diameter, "12.5")
    assert "overlap" in wizard.next_button.accessibleDescription()
    assert wizard.field.picture.sheet is None
    assert not wizard.field.print_button.isEnabled()


def test_a_csv_file_is_read_with_its_errors_told(wizard: NewProjectWizard, answers, tmp_path: Path, qtbot) -> None:
    wizard.go_to("testfield")
    qtbot.mouseClick(wizard.field.by_file, LEFT, pos=on_sign(wizard.field.by_file))
    assert "CSV" in wizard.next_button.accessibleDescription()
    answers.path = tmp_path / "board.csv"
    answers.path.write_text("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n0,1,ten,0,0,5\n")
    click(wizard.field.choose_button, qtbot)
    assert "line 3: x_mm is 'ten'" in wizard.next_button.accessibleDescription()
    write_testfield(answers.path, nominal_testfield(5, 6, 15.0, 6.0, "black-on-white"))
    wizard.go_to("rig")
    wizard.go_to("testfield")
    assert wizard.field.testfield is not None
    assert wizard.field.testfield.polarity == "black-on-white"
    assert wizard.go_to("summary")
    assert "30 targets" in wizard.summary.rows["field"].text()


def test_a_measured_distance_is_compared_with_the_nominal_one(wizard: NewProjectWizard, tmp_path: Path, qtbot) -> None:
    wizard.go_to("scale")
    step = wizard.scale
    qtbot.mouseClick(step.wanted, LEFT, pos=on_sign(step.wanted))
    assert step.wanted.isChecked()
    assert "length" in wizard.next_button.accessibleDescription()
    assert "259.600 mm" in step.comparison.text()  # 12 mm · sqrt(12² + 18²)
    retype(qtbot, step.length, "25.96")  # in cm by mistake
    assert step._warning.isVisible()
    assert wizard.next_button.isEnabled()  # it is the operator's measurement
    retype(qtbot, step.length, "259.71")
    assert not step._warning.isVisible()
    assert "+0.110 mm" in step.comparison.text()
    retype(qtbot, step.ends[2], "0")
    retype(qtbot, step.ends[3], "0")
    assert "different" in wizard.next_button.accessibleDescription()
    retype(qtbot, step.ends[3], "40")
    assert "no target in row 0, column 40" in wizard.next_button.accessibleDescription()
    retype(qtbot, step.ends[2], "12")
    retype(qtbot, step.ends[3], "18")
    wizard.go_to("summary")
    click(wizard.next_button, qtbot)
    scale = read_project(tmp_path / "rig").scale
    assert scale is not None
    assert (scale.start, scale.stop, scale.length_mm, scale.sigma_mm) == ((0, 0), (12, 18), 259.71, 0.02)


def test_a_smaller_board_takes_the_scale_to_its_own_corners(wizard: NewProjectWizard, qtbot) -> None:
    wizard.go_to("testfield")
    retype(qtbot, wizard.field.rows, "5")
    assert wizard.scale.scale().stop == (4, 18)


def test_answers_outlive_the_window(wizard: NewProjectWizard, program, qtbot) -> None:
    wizard.go_to("testfield")
    retype(qtbot, wizard.field.spacing, "17.5")
    before = wizard.draft()
    program.choose_language("en")  # a new window, as after a crash: only the settings are left
    program.window.show_page("new-project")
    assert program.window.page is not wizard
    assert program.window.page.draft() == before


def test_settings_that_make_no_sense_are_forgotten(window: MainWindow, bench) -> None:
    bench.settings.set("new-project", json.dumps({"name": 3}))
    window.show_page("new-project")
    assert window.page.draft().board.rows == 13


@pytest.mark.parametrize("ending", [".pdf", ".svg", ""])
def test_the_board_of_the_wizard_is_printed(
    wizard: NewProjectWizard, bench, answers, tmp_path: Path, notices, qtbot, ending: str
) -> None:
    wizard.go_to("testfield")
    answers.path = tmp_path / f"board{ending}"
    click(wizard.field.print_button, qtbot)
    qtbot.waitUntil(lambda: not bench.jobs.busy and bool(notices))
    written = tmp_path / f"board{ending or '.pdf'}"
    assert written.read_bytes().startswith(b"<svg" if ending == ".svg" else b"%PDF")
    across, down = board_sheet(wizard.field.testfield).bars_mm
    assert f"{across:g} mm across and {down:g} mm down" in notices[0].remedy


def test_the_open_projects_testfield_is_printed_by_its_shortcut(
    window: MainWindow, project: Path, bench, answers, tmp_path: Path, notices, qtbot
) -> None:
    assert not window.actions_["file.testfield"].isEnabled()
    window.open_path(project)
    answers.path = tmp_path / "out.pdf"
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_P, CONTROL)
    qtbot.waitUntil(lambda: not bench.jobs.busy and bool(notices))
    assert answers.path.read_bytes().startswith(b"%PDF")
    (project / "testfield.csv").unlink()
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_P, CONTROL)
    qtbot.waitUntil(lambda: len(notices) == 2)
    assert "testfield.csv" in notices[1].happened


def test_parts_show_every_step_and_change_nothing(wizard: NewProjectWizard, bench) -> None:
    before, kept = wizard.draft(), bench.settings.text("new-project")
    assert list(wizard.parts()) == ["-place", "-rig", "-testfield", "-plate", "-scale", "-sequence", "-summary"]
    assert (wizard.draft(), bench.settings.text("new-project")) == (before, kept)
    assert wizard.step.name == "place"


def test_a_recent_project_is_listed_and_can_be_taken_off(window: MainWindow, project: Path, bench, qtbot) -> None:
    bench.settings.add_recent(project)
    bench.settings.add_recent(project.parent / "gone")
    window.show_page("start")
    page = window.page
    told = [page.recent.item(i).data(Qt.ItemDataRole.AccessibleTextRole) for i in range(page.recent.count())]
    assert "not there any more" in told[0]
    assert "17 captures" in told[1]
    page.recent.setFocus()
    page.recent.setCurrentRow(0)
    with qtbot.waitActive(window):
        qtbot.keyClick(page.recent, Qt.Key.Key_Delete)
    assert bench.settings.recent() == [project]
    page.recent.setCurrentRow(0)
    qtbot.keyClick(page.recent, Qt.Key.Key_Return)
    assert window.bench.session.folder.path == project.resolve()
