"""The project's captures, to choose one; the choice is the session's."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from stripe_gui.assets import icon
from stripe_gui.presenters.capture import capture_row
from stripe_gui.session import Session

SIGNS = {"testfield": "measure", "depth": "runall", "plane": "evaluate", "object": "reconstruct"}


class CaptureList(QListWidget):
    """One line per capture: its name, what it is, and what is wrong with it."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self._session = session
        self.setAccessibleName(self.tr("Captures"))
        self.setIconSize(QSize(20, 20))
        self.setUniformItemSizes(True)  # or thousands are measured one by one
        self.setMinimumWidth(235)
        self.setMaximumWidth(320)
        self.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.currentItemChanged.connect(self._chosen)
        self.verticalScrollBar().rangeChanged.connect(lambda *_: self.scrollToItem(self.currentItem()))
        session.capture_changed.connect(self._mark)

    def refresh(self) -> None:
        self._list()
        self._mark(self._session.capture_name)

    def _list(self) -> None:
        rows = map(capture_row, self._session.folder.captures() if self._session.folder else ())
        self.blockSignals(True)
        self.clear()
        for row in rows:
            sign = "error" if row.problem else SIGNS.get(row.role, "capture")
            item = QListWidgetItem(icon(sign), f"{row.name}\n{row.summary}")
            item.setData(Qt.ItemDataRole.UserRole, row.name)
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{row.name}: {row.summary}")
            item.setToolTip(row.problem or row.summary)
            self.addItem(item)
        self.blockSignals(False)

    def names(self) -> list[str]:
        return [self.item(i).data(Qt.ItemDataRole.UserRole) for i in range(self.count())]

    def _mark(self, name: str) -> None:
        if name and name not in self.names():
            self._list()  # a list without a choice would choose by itself when it takes the focus
        names = self.names()
        self.blockSignals(True)
        self.setCurrentRow(names.index(name) if name in names else -1)
        self.blockSignals(False)

    def _chosen(self, item: QListWidgetItem | None, _previous: object = None) -> None:
        if item is not None:
            self._session.choose_capture(item.data(Qt.ItemDataRole.UserRole))
