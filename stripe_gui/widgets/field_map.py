"""The testfield in small: which target is next, which are picked, measured, missing; a click or the arrows choose."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from PySide6.QtCore import QPointF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFocusEvent, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from core.lazy import dataclass
from core.model import Testfield
from stripe_gui import theme
from stripe_gui.widgets.image_view import ARROWS

MARGIN = 20
Target = tuple[int, int]


@dataclass(frozen=True)
class MapState:
    """What is known of the targets of a field."""

    wanted: Sequence[Target] = ()
    picked: Collection[Target] = ()
    measured: Collection[Target] = ()
    excluded: Collection[Target] = ()
    target: Target = (0, 0)


class FieldMap(QWidget):
    """Targets as dots: measured ones filled, others hollow, excluded ones crossed out.

    Those asked for carry their number, picked ones a ring, the one at work a square.
    """

    chosen = Signal(int, int)  # row, column
    left = Signal()  # Enter, Space or Escape: back to the image

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(200, 110)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(self.tr("Map of the testfield"))
        self._field: Testfield | None = None
        self._state = MapState()

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(250, 170)

    def show_field(self, field: Testfield | None, state: MapState) -> None:
        """Show a field and how far the picking is."""
        self._field, self._state = field, state
        text = self.tr("at work: row {r}, column {c}; {n} picked, {m} measured")
        row, col = state.target
        self.setAccessibleDescription(text.format(r=row, c=col, n=len(state.picked), m=len(state.measured)))
        self.update()

    def positions(self) -> np.ndarray:
        """Give where the targets are drawn, shape (n, 2)."""
        if self._field is None:
            return np.zeros((0, 2))
        xy = self._field.xyz_mm[:, :2] * (1, -1)
        low, span = xy.min(axis=0), np.maximum(np.ptp(xy, axis=0), 1e-9)
        room = np.array([self.width(), self.height()]) - 2 * MARGIN
        scale = float(np.min(room / span))
        return (xy - low) * scale + MARGIN + (room - span * scale) / 2

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        at = self.positions()
        if self._field is not None and len(at):
            i = int(np.argmin(np.hypot(*(at - (event.position().x(), event.position().y())).T)))
            self.chosen.emit(int(self._field.row[i]), int(self._field.col[i]))

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        if event.key() in ARROWS and self._field is not None:
            self._step(np.array(ARROWS[Qt.Key(event.key())]))
        elif event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space, Qt.Key.Key_Escape):
            self.left.emit()
        else:
            event.ignore()

    def _step(self, direction: np.ndarray) -> None:
        """Choose the nearest target in a direction of the drawing."""
        assert self._field is not None
        at, index = self.positions(), self._field.index()
        if self._state.target not in index:
            return
        away = at - at[index[self._state.target]]
        along, across = away @ direction, np.abs(away @ direction[::-1])
        cost = np.where((along > 1e-6) & (across <= along), along + 2 * across, np.inf)
        best = int(np.argmin(cost))
        if np.isfinite(cost[best]):
            self.chosen.emit(int(self._field.row[best]), int(self._field.col[best]))

    def focusInEvent(self, event: QFocusEvent) -> None:  # noqa: N802
        super().focusInEvent(event)
        self.update()

    def focusOutEvent(self, event: QFocusEvent) -> None:  # noqa: N802
        super().focusOutEvent(event)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        colours = theme.current()
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), QColor(colours.surface))
        if self._field is not None:
            for target, (x, y) in zip(self._field.keys, self.positions().tolist(), strict=True):
                self._draw(painter, target, QPointF(x, y))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(colours.accent if self.hasFocus() else colours.border), 1))
        painter.drawRect(self.rect().adjusted(0, 0, -1, -1))
        painter.end()

    def _draw(self, painter: QPainter, target: Target, at: QPointF) -> None:
        colours, state = theme.current(), self._state
        ink = QColor(colours.text if target in state.wanted else colours.muted)
        painter.setPen(QPen(ink, 1))
        painter.setBrush(ink if target in state.measured else Qt.BrushStyle.NoBrush)
        painter.drawEllipse(at, 2.5, 2.5)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        if target in state.excluded:
            painter.setPen(QPen(QColor(colours.danger), 1.5))
            painter.drawLine(at + QPointF(-4, -4), at + QPointF(4, 4))
            painter.drawLine(at + QPointF(-4, 4), at + QPointF(4, -4))
        if target in state.picked:
            painter.setPen(QPen(QColor(colours.ok), 1.5))
            painter.drawEllipse(at, 5.5, 5.5)
        if target == state.target:
            painter.setPen(QPen(QColor(colours.accent), 2))
            painter.drawRect(int(at.x()) - 8, int(at.y()) - 8, 16, 16)
        if target in state.wanted:
            painter.setPen(QColor(colours.text))
            left, top = at.x() > self.width() / 2, at.y() < self.height() / 2
            place = at + QPointF(11 if left else -19, -2 if top else 11)
            painter.drawText(place, str(list(state.wanted).index(target) + 1))
