"""The correlations of a calibration's parameters: the matrix, and the strongest pairs in a table."""

from __future__ import annotations

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

from core.report import Number, Table
from core.report.adjusted import Correlations
from stripe_gui.widgets.colour_bar import ColourBar
from stripe_gui.widgets.layout import boxed, column, label, row
from stripe_gui.widgets.matrix_view import MatrixView
from stripe_gui.widgets.result_table import EMPTY, ResultTable

ROOM_FOR_TABLE = 760


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
