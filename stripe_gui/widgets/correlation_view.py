"""The correlations of a calibration's parameters: the matrix, and the strongest pairs in a table."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from core.report import Number, Table
from core.report.adjusted import STRONG, Correlations
from stripe_gui import theme
from stripe_gui.widgets.colour_bar import ColourBar
from stripe_gui.widgets.colours import lookup
from stripe_gui.widgets.image_view import ARROWS
from stripe_gui.widgets.layout import boxed, column, label, row
from stripe_gui.widgets.result_table import EMPTY, ResultTable

ROOM_FOR_TABLE = 760
GAP = 8


class MatrixView(QWidget):
    """The lower triangle holds what there is to see; strong cells carry a dot, so that colour alone tells nothing."""

    pointed = Signal(str)  # the cell under the cursor in words, empty where there is none

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(260, 240)
        self._shown: Correlations | None = None
        self._at: tuple[int, int] | None = None

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(420, 400)

    def show_correlations(self, shown: Correlations | None) -> None:
        self._shown = shown if shown is not None and shown.names else None
        self.point_at(None)
        self.update()

    def point_at(self, at: tuple[int, int] | None) -> None:
        """Mark a cell (row, column) and tell it."""
        self._at = at
        text = self._shown.describe(*at) if at is not None and self._shown is not None else ""
        self.setAccessibleDescription(text)
        self.pointed.emit(text)
        self.update()

    def cell(self, row: int, column: int) -> QRectF:
        left, top, side = self._layout()
        return QRectF(left + column * side, top + row * side, side, side)

    def _layout(self) -> tuple[float, float, float]:
        """Left and top of the cells, and their side."""
        names = self._shown.names if self._shown else ()
        metrics = self.fontMetrics()
        room = max((metrics.horizontalAdvance(n) for n in names), default=0) + GAP
        side = min(self.width() - room - 2, self.height() - room - 2) / max(len(names), 1)
        return float(room), float(room), max(side, 1.0)

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802
        if self._shown is None:
            return
        painter = QPainter(self)
        colours, (left, top, side) = theme.current(), self._layout()
        n = len(self._shown.names)
        values = self._shown.values
        index = ((values.clip(-1, 1) + 1) / 2 * 255).round().astype(int)
        pixels = lookup("deviation")[index].copy()
        image = QImage(pixels.data, n, n, 3 * n, QImage.Format.Format_RGB888)
        painter.drawImage(QRectF(left, top, n * side, n * side), image)
        self._write_names(painter, left, top, side)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor("#ffffff"))
        radius = max(1.2, side / 9)
        for i in range(n):
            for j in range(n):
                if i != j and abs(values[i, j]) > STRONG:
                    painter.drawEllipse(self.cell(i, j).center(), radius, radius)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(colours.border), 1))
        painter.drawRect(QRectF(left, top, n * side, n * side))
        if self._at is not None:
            painter.setPen(QPen(QColor(theme.LIGHT.text), 2))
            painter.drawRect(self.cell(*self._at))
        painter.end()

    def _write_names(self, painter: QPainter, left: float, top: float, side: float) -> None:
        colours, metrics = theme.current(), self.fontMetrics()
        step = max(1, -(-metrics.height() // max(1, int(side + 1))))  # not every name where cells are small
        for i, name in enumerate(self._shown.names if self._shown else ()):
            marked = self._at is not None and i in self._at
            if i % step and not marked:
                continue
            painter.setPen(QColor(colours.text if marked else colours.muted))
            middle = (i + 0.5) * side
            width = metrics.horizontalAdvance(name)
            painter.drawText(QPointF(left - GAP / 2 - width, top + middle + metrics.ascent() / 2 - 1), name)
            painter.save()
            painter.translate(left + middle + metrics.ascent() / 2 - 1, top - GAP / 2)
            painter.rotate(-90)
            painter.drawText(QPointF(0, 0), name)
            painter.restore()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        left, top, side = self._layout()
        column, row = int((event.position().x() - left) // side), int((event.position().y() - top) // side)
        n = len(self._shown.names) if self._shown else 0
        self.point_at((row, column) if 0 <= row < n and 0 <= column < n else None)

    def leaveEvent(self, event: QEvent) -> None:  # noqa: N802
        super().leaveEvent(event)
        self.point_at(None)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        if self._shown is None or event.key() not in ARROWS:
            super().keyPressEvent(event)
            return
        n = len(self._shown.names)
        row, column = self._at or (0, 0)
        right, down = ARROWS[Qt.Key(event.key())] if self._at else (0, 0)
        self.point_at(((row + down) % n, (column + right) % n))


class CorrelationView(QWidget):
    """Matrix to the left, pairs to the right."""

    def __init__(self) -> None:
        super().__init__()
        self.matrix = MatrixView(self.tr("Correlations"))
        self.bar = ColourBar()
        self.bar.show_scale("deviation", (-1.0, 1.0), "")
        self.readout = label(" ", "muted", wrap=True)
        self.readout.setAccessibleName(self.tr("Correlation under the cursor"))
        self.table = ResultTable(self.tr("Strongest correlations"))
        self.table.setFixedWidth(380)
        self.matrix.pointed.connect(self._say)
        self.table.row_chosen.connect(self._point)
        self._shown: Correlations | None = None
        picture = boxed(column((row(self.matrix, self.bar, spacing=8), 1), self.readout, spacing=6))
        self.setLayout(column((row((picture, 1), self.table, spacing=16), 1), margins=(0, 12, 0, 0)))
        self._say("")

    def show_correlations(self, shown: Correlations | None) -> None:
        self._shown = shown
        self.matrix.show_correlations(shown)
        if shown is None:
            self.table.show_table(EMPTY)
            return
        pairs = [(a, b, Number(value, "+.3f")) for a, b, value in shown.strongest(20)]
        columns = (self.tr("parameter"), self.tr("with"), self.tr("correlation"))
        self.table.show_table(Table(self.tr("Strongest pairs"), columns, tuple(pairs)))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self.table.setVisible(self.width() >= ROOM_FOR_TABLE)

    def _point(self, index: int) -> None:
        if self._shown is not None:
            a, b, _ = self._shown.strongest(20)[index]
            names = self._shown.names
            self.matrix.point_at((names.index(b), names.index(a)))

    def _say(self, text: str) -> None:
        hint = self.tr("Point at a cell to read it, or use the arrow keys. A dot marks correlations beyond ±0.9.")
        self.readout.setText(text or hint)
