"""A line drawn over images of one size, by mouse or by keys."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QWidget

from stripe_gui.widgets.image_view import ARROWS, ImageView

PAPER = (255, 255, 255, 190)  # behind the numbers of the ends
REACH_PX = 12  # on the screen: so near an end the mouse takes hold of it
COLOUR = "#101010"  # dark on the light middle of the scale, in both appearances
Pair = tuple[float, float]


class LineTool(QObject):
    """The same line over all its images.

    The left button draws it anew, or moves an end it takes hold of. Keys 1 and 2 (or Space) choose an end, the arrow
    keys move it by a pixel, with Shift by ten.
    """

    changed = Signal()

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.ends: list[Pair] = [(0.0, 0.0), (1.0, 1.0)]
        self.active = 1
        self._views: list[ImageView] = []
        self._items: list[tuple[pg.PlotCurveItem, pg.ScatterPlotItem, list[pg.TextItem]]] = []
        self._dragging = False

    def attach(self, views: Sequence[ImageView]) -> None:
        self._views, self._items = list(views), []
        for view in views:
            line = pg.PlotCurveItem(pen=pg.mkPen(COLOUR, width=2))
            ends = pg.ScatterPlotItem(size=11, pen=pg.mkPen(COLOUR, width=2))
            names = [pg.TextItem(str(i), color=COLOUR, anchor=(0.5, 1.4), fill=PAPER) for i in (1, 2)]
            for item in (line, ends, *names):
                view.add_item(item)
            self._items.append((line, ends, names))
            view.canvas.installEventFilter(self)
            view.canvas.viewport().installEventFilter(self)
            view.canvas.setAccessibleDescription(
                self.tr("Keys 1 and 2 choose an end of the line, the arrow keys move it, with Shift by ten pixels.")
            )
        self._draw()

    def set_line(self, start: Pair, stop: Pair) -> None:
        self.ends = [self._inside(start), self._inside(stop)]
        self._draw()
        self.changed.emit()

    def move(self, du: float, dv: float) -> None:
        u, v = self.ends[self.active]
        ends = [*self.ends]
        ends[self.active] = (u + du, v + dv)
        self.set_line(*ends)

    def choose(self, end: int) -> None:
        self.active = end
        self._draw()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        kind = event.type()
        if kind == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            return self._key(event.key(), bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier))
        view = next((v for v in self._views if v.canvas.viewport() is watched), None)
        if view is None or not isinstance(event, QMouseEvent):
            return False
        if kind == QEvent.Type.MouseButtonPress and event.button() == Qt.MouseButton.LeftButton:
            view.canvas.setFocus()
            self._press(view, event)
            return True
        if kind == QEvent.Type.MouseMove and self._dragging:
            ends = [*self.ends]
            ends[self.active] = view.canvas.position(event)
            self.set_line(*ends)
            return True
        if kind == QEvent.Type.MouseButtonRelease and self._dragging:
            self._dragging = False
            return True
        return False

    def _press(self, view: ImageView, event: QMouseEvent) -> None:
        at = view.canvas.position(event)
        self._dragging = True
        for i, end in enumerate(self.ends):
            place = view.canvas.mapFromScene(view.canvas.box.mapViewToScene(QPointF(*end)))
            if (event.position() - QPointF(place)).manhattanLength() <= REACH_PX:
                self.choose(i)
                return
        self.active = 1
        self.set_line(at, at)

    def _key(self, key: int, shift: bool) -> bool:
        if key in ARROWS:
            step, (du, dv) = 10 if shift else 1, ARROWS[Qt.Key(key)]
            self.move(step * du, step * dv)
        elif key in (Qt.Key.Key_1, Qt.Key.Key_2):
            self.choose(0 if key == Qt.Key.Key_1 else 1)
        elif key == Qt.Key.Key_Space:
            self.choose(1 - self.active)
        else:
            return False
        return True

    def _inside(self, at: Pair) -> Pair:
        if not self._views or self._views[0].image is None:
            return at
        height, width = self._views[0].image.shape
        return min(max(at[0], 0.0), width - 1.0), min(max(at[1], 0.0), height - 1.0)

    def _draw(self) -> None:
        u, v = np.array(self.ends).T
        fills = [pg.mkBrush("#ffffff" if i != self.active else "#ffd23f") for i in (0, 1)]
        for line, ends, names in self._items:
            line.setData(u, v)
            ends.setData(u, v, brush=fills)
            for name, end in zip(names, self.ends, strict=True):
                name.setPos(*end)
