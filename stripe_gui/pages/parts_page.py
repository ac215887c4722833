"""A page in parts, chosen in a row above them: what a stage asks, does and found, each in one place."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QStackedWidget, QToolButton, QWidget

from core.lazy import dataclass
from stripe_gui.pages.page import Page
from stripe_gui.widgets.layout import row
from stripe_gui.workbench import Workbench


@dataclass(frozen=True)
class Part:
    """One part of a page, or step of a wizard."""

    name: str  #: a word for the program: tests and the names of pictures
    title: str  #: as the operator reads it
    body: QWidget
    enter: Callable[[], object]  #: called whenever it comes to the front
    missing: Callable[[], str]  #: gives what still has to be done before what follows, as a sentence; else nothing


class PartsPage(Page):
    """A page of parts; a subclass adds them in the constructor and calls `update_steps` when an answer has changed."""

    step_changed = Signal(str)
    numbered = False  # parts that are steps have a number

    def __init__(self, bench: Workbench, title: str, purpose: str) -> None:
        super().__init__(bench, title, purpose)
        self.steps: list[Part] = []
        self._trail: list[QToolButton] = []
        self._trail_row = row(spacing=2)
        self._stack = QStackedWidget()
        self.body.addLayout(row(self._trail_row, None))
        self.body.addWidget(self._stack, 1)

    def add_step(
        self,
        name: str,
        title: str,
        body: QWidget,
        *,
        enter: Callable[[], object] = lambda: None,
        missing: Callable[[], str] = lambda: "",
    ) -> None:
        self.steps.append(Part(name, title, body, enter, missing))
        made = QToolButton()
        made.setObjectName(f"step.{name}")
        made.setText(f"{len(self.steps)}  {title}" if self.numbered else title)
        made.setCheckable(True)
        made.clicked.connect(lambda: self.go_to(name))
        self._trail.append(made)
        self._trail_row.addWidget(made)
        self._stack.addWidget(body)
        self.update_steps()

    @property
    def step(self) -> Part:
        return self.steps[self._stack.currentIndex()]

    def start(self) -> None:
        self._show(0)

    def go_to(self, name: str) -> bool:
        """Go to a part, or as far as nothing is missing before it; say whether it was reached."""
        wanted = next(i for i, part in enumerate(self.steps) if part.name == name)
        reached = min(wanted, self._reach())
        self._show(reached)
        return reached == wanted

    def update_steps(self) -> None:
        at, reach = self._stack.currentIndex(), self._reach()
        for i, made in enumerate(self._trail):
            made.setChecked(i == at)
            made.setEnabled(i <= reach)

    def parts(self) -> Iterator[str]:
        """Bring each part that can be reached to the front, and name it."""
        for part in self.steps:
            if not self.go_to(part.name):
                break
            yield from (f"-{part.name}{inner}" for inner in self.inner_parts(part))
        self.start()

    def inner_parts(self, part: Part) -> Iterator[str]:
        """Bring everything that a part in front holds to the front, and name it."""
        yield ""

    def _reach(self) -> int:
        return len(self.steps) - 1

    def _show(self, index: int) -> None:
        self._stack.setCurrentIndex(index)
        self.update_steps()
        self.step.enter()
        self.update_steps()
        self.step_changed.emit(self.step.name)
