"""What all wizards share: steps that open when nothing is missing before them."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLineEdit

from stripe_gui.wizards.wizard import Wizard
from stripe_gui.workbench import Workbench


class Names(Wizard):
    """Two questions and an end."""

    id, needs_project = "names", False

    def __init__(self, bench: Workbench) -> None:
        super().__init__(bench, "Names", "Asks for two names.", last="Write")
        self.first, self.second = QLineEdit(), QLineEdit()
        self.written: list[str] = []
        for name, field in (("first", self.first), ("second", self.second)):
            field.textChanged.connect(self.update_steps)
            self.add_step(name, name.title(), field, missing=lambda field=field: "" if field.text() else "Type a name.")

    def finish(self) -> None:
        self.written = [self.first.text(), self.second.text()]


@pytest.fixture
def wizard(bench: Workbench, qtbot) -> Names:
    made = Names(bench)
    qtbot.addWidget(made)
    made.show()
    made.start()
    return made


def test_next_waits_and_says_what_is_missing(wizard: Names, qtbot) -> None:
    assert not wizard.next_button.isEnabled()
    assert wizard.next_button.accessibleDescription() == "Type a name."
    assert not wizard.go_to("second")
    qtbot.keyClicks(wizard.first, "camera")
    assert wizard.next_button.isEnabled()
    qtbot.mouseClick(wizard.next_button, Qt.MouseButton.LeftButton)
    assert wizard.step.name == "second"
    assert not wizard.next_button.isEnabled()
    qtbot.keyClicks(wizard.second, "projector")
    assert wizard.next_button.text().strip() == "Write"
    qtbot.mouseClick(wizard.next_button, Qt.MouseButton.LeftButton)
    assert wizard.written == ["camera", "projector"]


def test_an_answer_taken_back_closes_the_steps_behind_it(wizard: Names) -> None:
    wizard.first.setText("camera")
    assert wizard.go_to("second")
    wizard.back()
    wizard.first.clear()
    assert not wizard.go_to("second")
    assert wizard.step.name == "first"
