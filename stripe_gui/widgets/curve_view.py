"""One measured curve: points joined by a line, both axes named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QVBoxLayout, QWidget

from stripe_gui import theme


class CurveView(QWidget):
    """A view box with two axes: a whole pyqtgraph plot would bring menus that nobody asked for."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.canvas = pg.GraphicsView(background=None)
        self.canvas.setAccessibleName(name)
        self.box = pg.ViewBox(enableMenu=False, enableMouse=False)
        self.axes = {side: pg.AxisItem(side) for side in ("left", "bottom")}
        layout = pg.GraphicsLayout()
        layout.setContentsMargins(8, 12, 16, 4)
        layout.addItem(self.axes["left"], 0, 0)
        layout.addItem(self.box, 0, 1)
        layout.addItem(self.axes["bottom"], 1, 1)
        for axis in self.axes.values():
            axis.enableAutoSIPrefix(False)
            axis.linkToView(self.box)
        self.canvas.setCentralItem(layout)
        self.line, self.points = pg.PlotCurveItem(), pg.ScatterPlotItem(size=7)
        self.box.addItem(self.line)
        self.box.addItem(self.points)
        outer = QVBoxLayout(self)
        outer.setContentsMargins(0, 0, 0, 0)
        outer.addWidget(self.canvas)
        self.setMinimumHeight(180)
        self._colour()

    def set_curve(self, curve: Sequence[tuple[float, float]], x_label: str, y_label: str) -> None:
        """Show a curve of (x, y), the y axis from zero."""
        x, y = np.array(curve, np.float64).T
        self.line.setData(x, y)
        self.points.setData(x, y)
        self.axes["bottom"].setLabel(x_label)
        self.axes["left"].setLabel(y_label)
        margin = 0.04 * (float(np.ptp(x)) or 1.0)
        top = float(y.max()) if y.max() > 0 else 1.0
        self.box.setRange(
            xRange=(x.min() - margin, x.max() + margin), yRange=(min(0.0, y.min()), 1.08 * top), padding=0
        )
        self.canvas.setAccessibleDescription("; ".join(f"{a:g}: {b:.3g}" for a, b in curve))

    def _colour(self) -> None:
        colours = theme.current()
        self.canvas.setBackground(QColor(colours.surface))
        for axis in self.axes.values():
            axis.setPen(colours.border)
            axis.setTextPen(colours.muted)
        self.line.setPen(pg.mkPen(colours.mark, width=1.6))
        self.points.setPen(None)
        self.points.setBrush(pg.mkBrush(colours.mark))

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Follow the theme."""
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "points"):
            self._colour()
        super().changeEvent(event)
