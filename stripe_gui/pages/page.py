"""What all pages share: a title, a line that says what the page is for, buttons, whose frames are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QComboBox, QPushButton, QWidget

from stripe_gui.session import Session
from stripe_gui.widgets.layout import MARGIN, SPACE, action_button, button, column, label, row
from stripe_gui.workbench import Workbench


class PairChoice(QComboBox):
    """Cameras by name, with their projector where there are several; hidden for one camera and one projector."""

    def __init__(self, session: Session, parent: QWidget) -> None:
        super().__init__(parent)
        self._session = session
        self._pairs: tuple[tuple[str, str], ...] = ()
        self.setAccessibleName(self.tr("Camera and projector"))
        self.setToolTip(self.tr("Whose frames are shown."))
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.setVisible(False)
        self.currentIndexChanged.connect(lambda i: session.choose_pair(self._pairs[i]))
        for changed in (session.project_changed, session.refreshed, session.capture_changed):
            changed.connect(self.refresh)  # no lambda: the session outlives the widget
        self.refresh()

    def refresh(self, _capture: str = "") -> None:
        rig = self._session.opened.project.rig if self._session.is_open else None
        pairs = rig.pairs if rig is not None and not rig.is_pair else ()
        with QSignalBlocker(self):
            if pairs != self._pairs:
                self._pairs = pairs
                self.clear()
                several = rig is not None and len(rig.projectors) > 1
                for camera, projector in pairs:
                    both = self.tr("{camera} with {projector}").format(camera=camera, projector=projector)
                    self.addItem(both if several else camera)
            if pairs:
                self.setCurrentIndex(pairs.index(self._session.pair))
        self.setVisible(bool(pairs))


class Page(QWidget):
    """One page of the window.

    A subclass sets `id` (a stage's word for a stage's page) and `action_ids`, fills `self.body` in its constructor and
    shows the project in `refresh`, which is called when the page comes to the front and whenever files have changed
    while it is there. `stage` is marked in the strip, and its word is the help topic; a page that `needs_project` is
    shown only while one is open; one `by_pair` shows the frames of one camera and one projector, chosen at its top;
    where it `undoes`, "Undo" and "Redo" mean something.
    """

    id = ""
    stage = ""
    needs_project = True
    by_pair = False
    undoes = False
    action_ids: tuple[str, ...] = ()  # of actions, such as those of wizards, that get a button where they exist

    def __init__(self, bench: Workbench, title: str, purpose: str) -> None:
        super().__init__()
        self.bench = bench
        self.session = bench.session
        self.setAccessibleName(title)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)  # takes the focus when it opens: Tab goes on from its top
        self.heading = label(title, "title")
        self.purpose = label(purpose, "muted", wrap=True)
        self.purpose.setMinimumWidth(200)
        self._buttons = row(spacing=8)
        if self.by_pair:
            choice = PairChoice(bench.session, self)
            choice.activated.connect(lambda _: self.refresh())
            self._buttons.addWidget(choice)
        words = column(self.heading, self.purpose, spacing=4)
        top = row((words, 1), self._buttons, spacing=SPACE * 2)
        self.body = column()
        self.setLayout(column(top, (self.body, 1), spacing=16, margins=(MARGIN, 16, MARGIN, 16)))

    def add_button(
        self, text: str, slot: Callable[[], object], icon: str = "", *, primary: bool = False
    ) -> QPushButton:
        """Add a button beside the title."""
        made = button(text, slot, icon, primary=primary)
        self._buttons.addWidget(made)
        return made

    def add_action_button(self, action: QAction) -> None:
        """Add a button for an action; the window calls it for each of `action_ids`."""
        self._buttons.insertWidget(1 if self.by_pair else 0, action_button(action))

    def look_for(
        self,
        title: str,
        show: Callable[[Any], None],
        refuse: Callable[[str], None],
        function: Callable[..., Any],
        *arguments: Any,
    ) -> None:
        """Work out what is to be shown, in the background; where that fails, give the reason to `refuse`."""
        self.bench.views.run(
            title, function, *arguments, on_done=show, on_failed=lambda failure: refuse(str(failure.error))
        )

    def parts(self) -> Iterator[str]:
        """Bring each part of the page to the front, one after the other, and name it: for pictures of everything."""
        yield ""

    def refresh(self) -> None:
        """Show the project as it is now."""

    def undo(self) -> None:
        """Take the operator's last change back; pages that set `undoes` do."""

    def redo(self) -> None:
        """Make the change again that was taken back last."""

    def run(self) -> None:
        """Do this stage's work (the action "Run this stage"); pages without any do nothing."""

    def can_run(self) -> bool:
        """Say whether `run` would do something now."""
        return False
