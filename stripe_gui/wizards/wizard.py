"""What all wizards share: steps in a row, Back and Next, and a reason where Next has to wait."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QStackedWidget, QToolButton, QWidget

from stripe_gui.pages.page import Page
from stripe_gui.widgets.layout import boxed, button, label, row
from stripe_gui.workbench import Workbench


def _nothing() -> None:
    return None


def _nothing_missing() -> str:
    return ""


@dataclass(frozen=True)
class Step:
    """One step of a wizard.

    Attributes
    ----------
    name : str
        A word for the program: tests and the names of pictures.
    title : str
        As the operator reads it.
    body : QWidget
    enter : callable
        Called whenever the step comes to the front.
    missing : callable
        Gives what still has to be done before the next step, as a sentence; empty when nothing is.
    """

    name: str
    title: str
    body: QWidget
    enter: Callable[[], None] = _nothing
    missing: Callable[[], str] = _nothing_missing


class Wizard(Page):
    """A page of steps, one after the other.

    A subclass adds its steps in the constructor, calls `update_steps` whenever an answer has changed, and does its work
    in `finish`, which the last step's button calls.
    """

    step_changed = Signal(str)

    def __init__(self, bench: Workbench, title: str, purpose: str, *, last: str) -> None:
        super().__init__(bench, title, purpose)
        self.steps: list[Step] = []
        self._last = last
        self._trail: list[QToolButton] = []
        self._trail_row = row(spacing=2)
        self._stack = QStackedWidget()
        self._why = label("", "muted", wrap=True)
        self._why.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.close_button = button(self.tr("Close"), self.leave, "close", flat=True)
        self.back_button = button(self.tr("Back"), self.back, "back")
        self.next_button = button(self.tr("Next"), self.next, "next", primary=True)
        self.back_button.setToolTip(self.tr("One step back (Alt+Left)"))
        self.next_button.setToolTip(self.tr("One step on (Alt+Right)"))
        for keys, slot in (("Alt+Left", self.back), ("Alt+Right", self.next)):
            QShortcut(QKeySequence(keys), self).activated.connect(slot)
        self.body.addLayout(row(self._trail_row, None))
        self.body.addWidget(self._stack, 1)
        foot = row(self.close_button, self._why, self.back_button, self.next_button)
        foot.setStretchFactor(self._why, 1)
        self.body.addWidget(boxed(foot))

    def add_step(
        self,
        name: str,
        title: str,
        body: QWidget,
        *,
        enter: Callable[[], None] = _nothing,
        missing: Callable[[], str] = _nothing_missing,
    ) -> None:
        """Add a step at the end."""
        self.steps.append(Step(name, title, body, enter, missing))
        made = QToolButton()
        made.setObjectName(f"step.{name}")
        made.setText(f"{len(self.steps)}  {title}")
        made.setCheckable(True)
        made.clicked.connect(lambda: self.go_to(name))
        self._trail.append(made)
        self._trail_row.addWidget(made)
        self._stack.addWidget(body)
        self.update_steps()

    @property
    def step(self) -> Step:
        """The step in front."""
        return self.steps[self._stack.currentIndex()]

    def start(self) -> None:
        """Begin at the first step."""
        self._show(0)

    def go_to(self, name: str) -> bool:
        """Go to a step, or as far as nothing is missing before it; say whether it was reached."""
        wanted = next(i for i, step in enumerate(self.steps) if step.name == name)
        reached = min(wanted, self._reach())
        self._show(reached)
        return reached == wanted

    def back(self) -> None:
        """Go one step back."""
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
        """Do what the last button promises."""
        self.leave()

    def leave(self) -> None:
        """Close the wizard: back to the page of its stage, or to the start page."""
        self.bench.show_page(self.stage if self.session.is_open and self.stage else "start")

    def update_steps(self) -> None:
        """Enable what the answers allow, and say what is missing."""
        at, reach = self._stack.currentIndex(), self._reach()
        for i, made in enumerate(self._trail):
            made.setChecked(i == at)
            made.setEnabled(i <= reach)
        if not self.steps:
            return
        missing = self.step.missing()
        self._why.setText(missing)
        self.back_button.setEnabled(at > 0)
        self.next_button.setEnabled(not missing)
        self.next_button.setText(" " + (self._last if at == len(self.steps) - 1 else self.tr("Next")))
        self.next_button.setAccessibleDescription(missing)

    def parts(self) -> Iterator[str]:
        """Bring each step that can be reached to the front, and name it."""
        for step in self.steps:
            if not self.go_to(step.name):
                break
            yield f"-{step.name}"
        self.start()

    def _reach(self) -> int:
        """The last step that can be opened."""
        return next((i for i, step in enumerate(self.steps) if step.missing()), len(self.steps) - 1)

    def _show(self, index: int) -> None:
        self._stack.setCurrentIndex(index)
        self.update_steps()
        self.step.enter()
        self.update_steps()
        self.step_changed.emit(self.step.name)
