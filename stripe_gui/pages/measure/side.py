"""Beside the image: the map of the field, the loupe, and the images and targets as lists."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QWidget

from stripe_gui.assets import icon
from stripe_gui.pages.measure.model import Picking
from stripe_gui.pages.measure.view import PickingView, state_text
from stripe_gui.widgets.field_map import FieldMap, MapState
from stripe_gui.widgets.layout import boxed, column, make, tabbed
from stripe_gui.widgets.loupe import Loupe
from stripe_gui.widgets.result_table import EMPTY, ResultTable

WIDTH = 272


class SidePanel(QWidget):
    """What is known of the image at work and of the others."""

    image_chosen = Signal(int)
    target_chosen = Signal(int, int)  # row, column
    excluded = Signal()  # exclude the target at work, or restore it
    left = Signal()  # back to the image

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumWidth(WIDTH)
        self.map, self.loupe = FieldMap(), Loupe()
        self.images = make(QListWidget, accessibleName=self.tr("Images"), iconSize=QSize(18, 18))
        self.targets = ResultTable(self.tr("Targets of this image"), titled=False)
        self.tabs = tabbed(
            ("images", self.tr("Images"), boxed(column(self.images))),
            ("targets", self.tr("Targets"), boxed(column(self.targets))),
        )
        self.setLayout(column(self.map, self.loupe, (self.tabs, 1), spacing=8))
        self._shown: PickingView | None = None
        self.map.chosen.connect(self.target_chosen)
        self.map.left.connect(self.left)
        self.images.currentRowChanged.connect(self.image_chosen)
        self.targets.row_chosen.connect(self._row_chosen)
        self.images.installEventFilter(self)
        self.targets.view.installEventFilter(self)

    def clear(self) -> None:
        self._shown = None
        self.map.show_field(None, MapState())
        self.loupe.show_at(None, 1.0, 0.0, 0.0)
        self.images.clear()
        self.targets.show_table(EMPTY)

    def show_image(self, model: Picking, view: PickingView, at_work: set[int]) -> None:
        if self._shown is None or view.table != self._shown.table:
            with QSignalBlocker(self.targets):
                self.targets.show_table(view.table)
        self._shown = view
        with QSignalBlocker(self.images):
            while self.images.count() > len(model.captures):
                self.images.takeItem(self.images.count() - 1)
            for i in range(len(model.captures)):
                self._show_item(i, model.captures[i].name, *state_text(model, i, at_work))
            self.images.setCurrentRow(model.image)

    def _show_item(self, i: int, name: str, sign: str, text: str) -> None:
        if i >= self.images.count():
            self.images.addItem(QListWidgetItem())
        item = self.images.item(i)
        item.setIcon(icon(sign))
        item.setText(f"{name}\n{text}")
        item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{name}: {text}")
        item.setToolTip(text)

    def show_target(self, model: Picking, view: PickingView) -> None:
        measurement = model.measured(model.image)
        found = measurement.targets if measurement else None
        measured = set(found.keys) if found is not None else set()
        state = MapState(model.wanted, set(model.picked), measured, set(model.picks.excluded), model.target)
        self.map.show_field(model.field, state)
        if model.target in view.targets:
            with QSignalBlocker(self.targets):
                self.targets.choose_row(view.targets.index(model.target))

    def next_pane(self, first: QWidget) -> None:
        """Take the focus round: `first`, the map, the tabs, the list in front."""
        lists: dict[str, QWidget] = {"images": self.images, "targets": self.targets.view}
        panes = [first, self.map, self.tabs.tabBar(), lists[self.tabs.currentWidget().objectName()]]
        at = next((i for i, pane in enumerate(panes) if pane.hasFocus()), -1)
        panes[(at + 1) % len(panes)].setFocus(Qt.FocusReason.ShortcutFocusReason)

    def _row_chosen(self, index: int) -> None:
        if self._shown is not None and index < len(self._shown.targets):
            self.target_chosen.emit(*self._shown.targets[index])

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            keys: dict[int, Callable[[], object]] = {
                Qt.Key.Key_Return: self.left.emit,
                Qt.Key.Key_Enter: self.left.emit,
            }
            if watched is self.targets.view:
                keys |= {Qt.Key.Key_X: self.excluded.emit, Qt.Key.Key_Delete: self.excluded.emit}
            if event.key() in keys:
                keys[event.key()]()
                return True
        return super().eventFilter(watched, event)
