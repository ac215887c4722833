"""What all wizards share: steps in a row, Back and Next, and a reason where Next has to wait."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut

from stripe_gui.pages.parts_page import PartsPage
from stripe_gui.widgets.layout import boxed, button, label, row
from stripe_gui.workbench import Workbench

if TYPE_CHECKING:
    from stripe_gui.presenters.folder import ProjectFolder


class Wizard(PartsPage):
    """A page of steps, one after the other.

    A subclass adds its steps in the constructor, calls `update_steps` whenever an answer has changed, and does its work
    in `finish`, which the last step's button calls. One about the open project asks it in `begin`.
    """

    numbered = True

    def __init__(self, bench: Workbench, title: str, purpose: str, *, last: str) -> None:
        super().__init__(bench, title, purpose)
        self._last = last
        self._begun: Path | None = None  # with which project
        self._why = label("", "muted", wrap=True)
        self._why.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.close_button = button(self.tr("Close"), self.leave, "close", flat=True)
        self.back_button = button(self.tr("Back"), self.back, "back")
        self.next_button = button(self.tr("Next"), self.next, "next", primary=True)
        self.back_button.setToolTip(self.tr("One step back (Alt+Left)"))
        self.next_button.setToolTip(self.tr("One step on (Alt+Right)"))
        for keys, slot in (("Alt+Left", self.back), ("Alt+Right", self.next)):
            QShortcut(QKeySequence(keys), self).activated.connect(slot)
        self.body.addWidget(boxed(row(self.close_button, (self._why, 1), self.back_button, self.next_button)))

    def refresh(self) -> None:
        """Begin where the wizard was left, or with another project."""
        folder = self.session.folder
        if folder is None:
            return
        if folder.path == self._begun:
            self.look_again()
            return
        self._begun = folder.path
        self.begin(folder)
        self.start()

    def begin(self, folder: ProjectFolder) -> None:
        """Ask anew, about a project."""

    def look_again(self) -> None:
        """Show what may have changed of the project meanwhile."""

    def back(self) -> None:
        if self._stack.currentIndex() > 0:
            self._show(self._stack.currentIndex() - 1)

    def next(self) -> None:
        """Go one step on; at the last, finish."""
        if self.step.missing() or not self.next_button.isEnabled():
            return
        if self._stack.currentIndex() + 1 < len(self.steps):
            self._show(self._stack.currentIndex() + 1)
        else:
            self.finish()

    def finish(self) -> None:
        self.leave()

    def leave(self) -> None:
        """Close the wizard: back to the page of its stage, or to the start page; it begins anew the next time."""
        self._begun = None
        self.bench.show_page(self.stage if self.session.is_open and self.stage else "start")

    def update_steps(self) -> None:
        """Enable what the answers allow, and say what is missing."""
        super().update_steps()
        if not self.steps:
            return
        at, missing = self._stack.currentIndex(), self.step.missing()
        self._why.setText(missing)
        self.back_button.setEnabled(at > 0)
        self.next_button.setEnabled(not missing)
        self.next_button.setText(" " + (self._last if at == len(self.steps) - 1 else self.tr("Next")))
        self.next_button.setAccessibleDescription(missing)

    def _reach(self) -> int:
        return next((i for i, step in enumerate(self.steps) if step.missing()), len(self.steps) - 1)
