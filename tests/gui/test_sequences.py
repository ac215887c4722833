"""The sequence chosen in the window, and frames from elsewhere imported there."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox

from core.patterns import Code, Level, Lines, Phase, SequenceSpec, grey_reason, pattern_to_dict
from core.project import choose_sequence, read_capture, read_project
from stripe_gui.presenters.capture import pattern_text
from stripe_gui.presenters.sequences import Shown, look_at, options_of, typed
from stripe_gui.presenters.told import speak
from tests.gui.hands import click, idle

CONTROL = Qt.KeyboardModifier.ControlModifier
SINE = SequenceSpec("gray-sine", {"period": 8, "steps": 3})


def test_a_new_project_keeps_the_chosen_sequence(window, tmp_path: Path, qtbot) -> None:
    window.show_page("new-project")
    page = window.page
    page.place.folder.setText(str(tmp_path / "rig"))
    assert page.go_to("sequence")
    assert page.sequence.spec is None
    page.sequence.kind.setCurrentIndex(page.sequence.kind.findData("gray-sine"))
    idle(window, qtbot)
    for key, text in (("period", "8"), ("steps", "2")):
        field = page.sequence._fields[key][1]
        field.setText(text)
        field.editingFinished.emit()
    assert "steps" in page.next_button.accessibleDescription()  # two steps tell no phase
    field.setText("3")
    field.editingFinished.emit()
    idle(window, qtbot)
    assert page.sequence.view.patterns == SINE.patterns((640, 640))
    assert "black and white cannot" in page.sequence.words.text()
    assert page.go_to("summary")
    assert "gray-sine" in page.summary.rows["sequence"].text()
    click(page.next_button, qtbot)
    document = json.loads((tmp_path / "rig" / "project.json").read_text())
    assert document["version"] == 2
    assert document["sequence"] == {"preset": "gray-sine", "period": 8, "steps": 3}


def test_a_list_of_patterns_comes_from_a_file(window, answers, tmp_path: Path, qtbot) -> None:
    patterns = SequenceSpec("paper").patterns((640, 640))
    answers.path = tmp_path / "mine.json"
    answers.path.write_text(json.dumps([pattern_to_dict(p) for p in patterns]))
    window.show_page("new-project")
    page = window.page
    page.place.folder.setText(str(tmp_path / "rig"))
    page.go_to("sequence")
    page.sequence.kind.setCurrentIndex(page.sequence.kind.count() - 1)
    assert "file" in page.next_button.accessibleDescription()
    click(page.sequence.choose_button, qtbot)
    idle(window, qtbot)
    assert page.sequence.spec.listed == patterns
    page.sequence.file.setText(str(tmp_path / "none.json"))
    page.sequence.file.editingFinished.emit()
    assert "none.json" in page.next_button.accessibleDescription()


def test_the_capture_wizard_says_what_this_projector_cannot_show(window, project: Path, qtbot) -> None:
    window.open_path(project)
    window.show_page("capture-wizard")
    page = window.page
    qtbot.waitUntil(lambda: page.devices.connection is not None, timeout=60_000)
    assert page.go_to("sequence")
    page.sequence.kind.setCurrentIndex(page.sequence.kind.findData("gray-sine"))
    idle(window, qtbot)
    assert "cannot show" in page.next_button.accessibleDescription()  # its bench is a projector of black and white
    assert not page.next_button.isEnabled()
    page.sequence.kind.setCurrentIndex(page.sequence.kind.findData("paper"))
    idle(window, qtbot)
    assert page.sequence.strip.count() == len(page.devices.connection.patterns)
    assert read_project(project).sequence is None  # nothing is kept before the operator goes on
    click(page.next_button, qtbot)
    idle(window, qtbot)
    assert read_project(project).sequence == SequenceSpec("paper")
    click(page.close_button, qtbot)


def test_what_a_sequence_is_to_a_projector() -> None:
    lcd = Shown((640, 640), (), grey_reason, 0.5)  # refuses what a plate of black and white refuses
    seen = look_at(SequenceSpec("gray-sine"), lcd)
    shown = SequenceSpec("gray-sine").patterns((640, 640))
    assert f"{sum(grey_reason(p) is not None for p in shown)} of {len(shown)}" in seen.refusal
    seen = look_at(SequenceSpec("paper"), lcd)
    assert (len(seen.patterns), seen.refusal) == (28, "")
    assert "28 images, about 14 s at 500 ms" in seen.words
    wrong = SequenceSpec(listed=(Lines("x", "0110"),))
    assert "640 lines" in look_at(wrong, lcd).problem
    assert typed("[16, 106]") == [16, 106]
    assert {o.key for o in options_of("dense")} >= {"frames", "axes", "seed"}


def test_patterns_are_told_in_the_operators_language() -> None:
    assert pattern_text(Lines("x", "01" * 10)) == "word 010101010101… across columns"
    speak("de")
    assert pattern_text(Level(0.25)) == "Stufe 0.25"
    assert pattern_text(Code("gray", "y", 3, 9, 2, True)) == "inverser Gray-Code, Bit 3 von 9 über die Zeilen"
    assert pattern_text(Phase("x", 16, 4, 1, 0.0)) == "Sinus, Schritt 1 von 4, Periode 16 über die Spalten"
    speak("en")


def test_a_chosen_sequence_leaves_all_else_in_place(project: Path, edit_json) -> None:
    edit_json(project / "project.json", mine={"kept": 1})
    before = json.loads((project / "project.json").read_text())
    choose_sequence(project, SINE)
    assert read_project(project).sequence == SINE
    choose_sequence(project, None)
    assert json.loads((project / "project.json").read_text()) == before | {"version": 2}


@pytest.fixture
def foreign(project: Path, tmp_path: Path) -> tuple[Path, list[str]]:
    """Frames of the bench under names that do not tell their order, and what the pattern of each is."""
    source = project / "captures" / "plane+00"
    names = [frame.path.name for frame in read_capture(source).frames]
    random.Random(3).shuffle(names)
    (tmp_path / "foreign").mkdir()
    for i, name in enumerate(names):
        shutil.copyfile(source / name, tmp_path / "foreign" / f"shot{i}.png")
    return tmp_path / "foreign", names


def test_frames_from_elsewhere_become_a_capture(window, project: Path, foreign, notices, qtbot) -> None:
    folder, names = foreign
    window.open_path(project)
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_I, CONTROL)
    page = window.page
    assert "folder" in page.next_button.accessibleDescription()
    page.frames.folder.setText(str(folder))
    assert f"{len(names)} images" in page.frames.words.text()
    click(page.next_button, qtbot)
    page.subject.role.setCurrentIndex(page.subject.role.findData("object"))
    page.subject.name.setText("from-elsewhere")
    click(page.next_button, qtbot)
    assert page.sequence.view.patterns  # those of the project's latest capture
    page.sequence.kind.setCurrentIndex(page.sequence.kind.findData("gray-sine"))
    idle(window, qtbot)
    click(page.next_button, qtbot)
    click(page.importing.start_button, qtbot)
    idle(window, qtbot)
    assert page.importing.report is None  # refused, with the core's words
    told = [w.text() for w in page.importing.findChildren(type(page.purpose))]
    assert any(f"holds {len(names)} images" in text for text in told)
    assert not (project / "captures" / "from-elsewhere").exists()
    page.go_to("sequence")
    page.sequence.kind.setCurrentIndex(0)
    page.order.setCurrentIndex(page.order.findData("content"))
    page.go_to("import")
    qtbot.keyClick(page, Qt.Key.Key_F5)
    idle(window, qtbot)
    told = [w.text() for w in page.importing.findChildren(type(page.purpose))]
    assert any("pixels decode" in text for text in told)  # how surely
    assert page.importing.findings.findings
    taken = read_capture(project / "captures" / "from-elsewhere")
    shown = {frame.path.name: frame.pattern for frame in read_capture(project / "captures" / "plane+00").frames}
    imported = json.loads((taken.path / "capture.json").read_text())["imported"]["files"]
    for frame, file in zip(taken.frames, imported, strict=True):
        assert frame.pattern == shown[names[int(file[4:-4])]]
    click(page.next_button, qtbot)
    assert (window.page.id, window.bench.session.capture_name) == ("capture", "from-elsewhere")


def test_what_is_asked_for_has_names(window, project: Path, qtbot) -> None:
    window.open_path(project)
    window.show_page("import-wizard")
    assert all(box.accessibleName() for box in window.page.findChildren(QComboBox))
