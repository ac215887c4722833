"""Every action of the program in one searchable list."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QAction, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QDialog, QLineEdit, QListWidget, QListWidgetItem, QWidget

from stripe_gui.actions import ActionSet
from stripe_gui.widgets.layout import column, make


class CommandPalette(QDialog):
    """Type a few letters, choose with the arrow keys, run with Enter."""

    def __init__(self, actions: ActionSet, parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Dialog | Qt.WindowType.FramelessWindowHint)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setModal(True)
        self.setWindowTitle(self.tr("Commands"))
        self.setAccessibleName(self.tr("Commands"))
        self._actions = actions
        search = self.tr("Search all commands")
        self.search = make(QLineEdit, placeholderText=search, accessibleName=search)
        self.search.textChanged.connect(self._filter)
        self.search.returnPressed.connect(self._run)
        self.search.installEventFilter(self)
        self.found = make(QListWidget, accessibleName=self.tr("Commands found"), iconSize=QSize(18, 18))
        self.found.setUniformItemSizes(True)
        self.found.itemActivated.connect(lambda _item: self._run())
        self.found.itemClicked.connect(lambda _item: self._run())
        self.setLayout(column(self.search, self.found, spacing=6, margins=(12, 12, 12, 12)))
        self.resize(620, 420)
        self.move(parent.mapToGlobal(parent.rect().center()) - self.rect().center())
        self._filter("")
        self.search.setFocus()

    def _filter(self, text: str) -> None:
        words = text.lower().split()
        self.found.clear()
        hits = [a for a in self._actions.all() if all(w in f"{self._line(a)} {a.statusTip()}".lower() for w in words)]
        for action in sorted(hits, key=lambda a: not all(w in self._line(a).lower() for w in words)):
            item = QListWidgetItem(action.icon(), self._line(action))
            item.setData(Qt.ItemDataRole.UserRole, action.objectName())
            item.setToolTip(action.statusTip())
            if not action.isEnabled():
                item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEnabled)
            self.found.addItem(item)
        enabled = [i for i in range(self.found.count()) if self.found.item(i).flags() & Qt.ItemFlag.ItemIsEnabled]
        if enabled:
            self.found.setCurrentRow(enabled[0])

    def _line(self, action: QAction) -> str:
        keys = action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
        name = action.text().replace("&", "")
        return f"{name}   ({keys})" if keys else name

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        keys = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown)
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress and event.key() in keys:
            self.found.keyPressEvent(event)
            return True
        return super().eventFilter(watched, event)

    def _run(self) -> None:
        item = self.found.currentItem()
        if item is None or not item.flags() & Qt.ItemFlag.ItemIsEnabled:
            return
        action = self._actions[item.data(Qt.ItemDataRole.UserRole)]
        self.accept()
        action.trigger()
