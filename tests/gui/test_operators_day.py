"""An operator's day by clicks and keys: from the empty start page to the signed plane-table report, counted."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pypdf import PdfReader
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QAbstractSpinBox, QComboBox, QLineEdit

from core.bench import experiment
from core.bench.simulate import truth_of
from core.pipeline.evaluate import load_evaluation
from core.project import read_project
from stripe_gui.presenters.stages import State
from tests.copies import copied
from tests.gui.hands import click, idle, rightly_named, true_targets

pytestmark = pytest.mark.usefixtures("plain_reports")

POSES = 5  # of the testfield, two of them flat and three inclined: fewer steps, all of them the same
ANGLES = (0, 15)  # of the plane-table


class Operator:
    """Clicks and types like a person, and counts: a click, a key and a number typed are one step each."""

    def __init__(self, window, qtbot) -> None:
        self.window, self.qtbot, self.steps = window, qtbot, 0

    @property
    def page(self):
        return self.window.page

    def wait(self, done=lambda: True) -> None:
        idle(self.window, self.qtbot, done)

    def click(self, button: QAbstractButton) -> None:
        self.steps += 1
        click(button, self.qtbot)
        self.wait()

    def click_on(self, text: str) -> None:
        """Click the button of the page that says so."""
        self.click(next(b for b in self.page.findChildren(QAbstractButton) if b.text().strip().rstrip("…") == text))

    def type(self, field: QLineEdit | QAbstractSpinBox, text: str) -> None:
        self.steps += 1
        field.setFocus()
        field.selectAll()
        self.qtbot.keyClicks(field, text)
        if isinstance(field, QAbstractSpinBox):
            field.interpretText()

    def choose(self, box: QComboBox, data: str) -> None:
        self.steps += 1
        box.setFocus()
        while box.currentData() != data:
            before = box.currentIndex()
            self.qtbot.keyClick(box, Qt.Key.Key_Down if box.findData(data) > before else Qt.Key.Key_Up)
            assert box.currentIndex() != before

    def press(self, key: Qt.Key) -> None:
        self.steps += 1
        QTest.keyClick(self.page.view.canvas, key)
        self.wait()


@pytest.fixture
def simulated(quick_original: Path, tmp_path: Path) -> Path:
    """What the bench knows of the virtual rig that the window connects to."""
    folder = copied(quick_original, tmp_path / "simulated")
    (folder / "truth.json").write_text(json.dumps(truth_of(experiment("quick"))))
    return folder


@pytest.fixture
def operator(window, qtbot) -> Operator:
    return Operator(window, qtbot)


def make_project(operator: Operator, folder: Path) -> None:
    """The small virtual rig, typed in from its data sheets."""
    operator.click_on("New project")
    page = operator.page
    operator.type(page.place.name, "Workshop two")
    operator.type(page.place.folder, str(folder))
    operator.click(page.next_button)
    for fields, values in (
        (page.rig.camera, ("320", "240", "18.5", "18.5", "12")),
        (page.rig.projector, ("160", "160", "360", "360", "182")),
    ):
        for field, value in zip(fields.all(), values, strict=True):
            operator.type(field, value)
    operator.click(page.next_button)
    operator.click(page.next_button)  # the projector's own sequence
    asked = page.field
    for field, value in ((asked.rows, "7"), (asked.columns, "9"), (asked.spacing, "19"), (asked.diameter, "9")):
        operator.type(field, value)
    for _ in range(4):  # no plate, no measured distance, the summary, create
        operator.click(page.next_button)


def capture(operator: Operator, role: str, angle: int | None = None) -> None:
    """Record one sequence with the wizard open at its second step."""
    page = operator.page
    assert page.step.name == "subject"
    operator.choose(page.subject.role, role)
    if angle:
        operator.type(page.subject.angle, str(angle))
    while page.step.name != "take":
        operator.click(page.next_button)
    take(operator)


def take(operator: Operator) -> None:
    page = operator.page
    operator.click(page.taking.start_button)
    operator.wait(lambda: not page.taking.running)
    assert page.taking.report is not None, page.taking.words.text()


def pick(operator: Operator, simulated: Path) -> None:
    """Go through the images: turn the guess until it is right, accept, next.

    `simulated` is a project in which the same captures were simulated: it knows what an operator sees.
    """
    page = operator.page
    operator.wait()
    while operator.page is page:
        for _ in range(4):
            if rightly_named(page.model.guess, true_targets(simulated, page.model.capture.name)):
                break
            operator.press(Qt.Key.Key_R)
        operator.press(Qt.Key.Key_Return)  # accept the guess
        operator.press(Qt.Key.Key_Return)  # next image, or close


def test_from_the_empty_start_page_to_the_signed_report(
    operator: Operator, window, answers, notices, simulated: Path, tmp_path: Path, capsys
) -> None:
    session = window.bench.session
    make_project(operator, tmp_path / "rig")
    assert window.page.id == "capture"
    by_part = {"project": operator.steps}

    operator.click_on("New capture")
    operator.wait(lambda: operator.page.devices.connection is not None)
    operator.click(operator.page.next_button)
    capture(operator, "testfield")
    for _ in range(POSES - 1):
        operator.click(operator.page.taking.another_button)
        while operator.page.step.name != "take":
            operator.click(operator.page.next_button)
        take(operator)
    for angle in ANGLES:
        while operator.page.step.name != "subject":
            operator.click(operator.page.back_button)
        capture(operator, "plane", angle)
    operator.click(operator.page.next_button)
    assert len(session.folder.project.captures) == POSES + len(ANGLES)
    by_part["captures"] = operator.steps - sum(by_part.values())

    operator.click(window.strip.buttons["measure"])
    pick(operator, simulated)
    assert session.statuses["measure"].state is State.DONE
    by_part["picks"] = operator.steps - sum(by_part.values())

    operator.click(window.strip.buttons["calibrate"])
    page = operator.page
    operator.click(page.run_button)
    assert page.step.name == "results"
    assert session.statuses["calibrate"].state is State.DONE
    by_part["calibration"] = operator.steps - sum(by_part.values())

    operator.click(window.strip.buttons["evaluate"])
    operator.click(operator.page.run_button)
    operator.click(window.strip.buttons["report"])
    page = operator.page
    operator.type(page.signing.operator, "A. Operator")
    answers.path = tmp_path / "handed-over"
    operator.click(page.export_button)
    by_part["evaluation"] = operator.steps - sum(by_part.values())

    text = "".join(p.extract_text() for p in PdfReader(answers.path / "report.pdf").pages)
    assert "A. Operator" in text
    planes = load_evaluation(read_project(tmp_path / "rig"))
    assert [p.angle_deg for p in planes] == list(ANGLES)
    for plane in planes:  # noise alone, as the sensor predicts it: the calibration adds no more than a tenth
        assert plane.rms_mm < 1.1 * plane.predicted_rms_mm
    assert [n.happened for n in notices if n.kind in ("error", "warning")] == []
    with capsys.disabled():
        print(f"\noperator's steps: {by_part}, together {operator.steps}")
