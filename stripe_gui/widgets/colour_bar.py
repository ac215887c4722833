"""The colours of a map and the values they stand for."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize
from PySide6.QtGui import QColor, QImage, QPainter, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from stripe_gui import theme
from stripe_gui.widgets.colours import lookup, nice_ticks


class ColourBar(QWidget):
    """A vertical bar with round numbers beside it and the unit above."""

    def __init__(self) -> None:
        super().__init__()
        self._scale, self._levels, self._unit = "grey", (0.0, 1.0), ""
        self._least = 0.0  # between two numbers
        self._marked: float | None = None
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.setMinimumHeight(90)

    def sizeHint(self) -> QSize:  # noqa: N802
        metrics = self.fontMetrics()
        widest = max([metrics.horizontalAdvance(t) for t in (*self._labels().values(), self._unit)], default=0)
        return QSize(max(24 + widest + 8, 64), 200)

    def show_scale(self, scale: str, levels: tuple[float, float], unit: str, *, least: float = 0.0) -> None:
        """Show a scale between two values, numbered no finer than by `least`."""
        self._scale, self._levels, self._unit, self._least = scale, levels, unit, least
        self._marked = None
        self.setAccessibleName(
            self.tr("Colour scale from {a:g} to {b:g} {unit}").format(a=levels[0], b=levels[1], unit=unit)
        )
        self.updateGeometry()
        self.update()

    def mark(self, value: float | None) -> None:
        """Point at a value, such as the one under the cursor."""
        if value != self._marked:
            self._marked = value
            self.update()

    def _labels(self) -> dict[float, str]:
        ticks = nice_ticks(*self._levels, least=self._least)
        signed = self._scale == "deviation"
        texts = [f"{t:+g}" if signed and t else f"{t:g}" for t in ticks]
        return dict(zip(ticks, texts, strict=True))

    def paintEvent(self, _event: object) -> None:  # noqa: N802
        colours = theme.current()
        painter = QPainter(self)
        metrics = self.fontMetrics()
        top = metrics.height() * 1.8 if self._unit else metrics.height() / 2
        bar = QRectF(2, top, 14, self.height() - top - metrics.height() / 2 - 2)
        table = lookup(self._scale)[::-1].copy()
        image = QImage(table.data, 1, 256, 3, QImage.Format.Format_RGB888)
        painter.drawImage(bar, image)
        painter.setPen(QPen(QColor(colours.border), 1))
        painter.drawRect(bar)
        painter.setPen(QColor(colours.muted))
        painter.drawText(QPointF(0, metrics.ascent()), self._unit)
        for value, text in self._labels().items():
            y = self._height_of(value, bar)
            painter.drawLine(QPointF(bar.right(), y), QPointF(bar.right() + 4, y))
            painter.drawText(QPointF(bar.right() + 7, y + metrics.ascent() / 2 - 1), text)
        if self._marked is not None:
            y = min(max(self._height_of(self._marked, bar), bar.top()), bar.bottom())
            painter.setPen(QPen(QColor(colours.text), 2))
            painter.drawLine(QPointF(0, y), QPointF(bar.right() + 3, y))
        painter.end()

    def _height_of(self, value: float, bar: QRectF) -> float:
        low, high = self._levels
        return bar.bottom() - (value - low) / ((high - low) or 1.0) * bar.height()
