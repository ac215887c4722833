"""Histograms of deviations, one step line per plane and method."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QVBoxLayout, QWidget

from stripe_gui import theme

STYLES = (Qt.PenStyle.SolidLine, Qt.PenStyle.DashLine, Qt.PenStyle.DotLine, Qt.PenStyle.DashDotLine)


class Histogram(QWidget):
    """Step lines over common bins; told apart by colour and by dashes.

    Put together from a view box and two axes: a pyqtgraph plot would make seven menus that nobody asked for.
    """

    def __init__(self, name: str, unit: str) -> None:
        super().__init__()
        self.canvas = pg.GraphicsView(background=None)
        self.canvas.setAccessibleName(name)
        self.box = pg.ViewBox(enableMenu=False, enableMouse=False)
        self.axes = {side: pg.AxisItem(side) for side in ("left", "bottom")}
        self.axes["bottom"].setLabel(self.tr("deviation [{unit}]").format(unit=unit))
        self.axes["left"].setLabel(self.tr("share of pixels [%]"))
        layout = pg.GraphicsLayout()
        layout.setContentsMargins(8, 12, 16, 4)
        layout.addItem(self.axes["left"], 0, 0)
        layout.addItem(self.box, 0, 1)
        layout.addItem(self.axes["bottom"], 1, 1)
        for axis in self.axes.values():
            axis.enableAutoSIPrefix(False)
            axis.linkToView(self.box)
        self.canvas.setCentralItem(layout)
        self.legend = pg.LegendItem(offset=(-10, 10))
        self.legend.setParentItem(self.box)
        self._curves: list[tuple[pg.PlotCurveItem, str]] = []
        outer = QVBoxLayout(self)
        outer.setContentsMargins(0, 12, 0, 0)
        outer.addWidget(self.canvas)
        self.setMinimumHeight(180)
        self._colour()

    def set_values(self, series: Sequence[tuple[str, NDArray]], limit: float, bins: int = 101) -> None:
        """Show named series of values between ±limit; what lies outside counts in the outermost bins."""
        for curve, _ in self._curves:
            self.box.removeItem(curve)
        self._curves = []
        edges = np.linspace(-limit, limit, bins + 1)
        highest = 0.0
        for name, values in series:
            finite = values[np.isfinite(values)]
            if not len(finite):
                continue
            share = np.histogram(np.clip(finite, -limit, limit), edges)[0] / len(finite) * 100
            highest = max(highest, float(share.max()))
            curve = pg.PlotCurveItem(edges, share, stepMode="center")
            self.box.addItem(curve)
            self._curves.append((curve, name))
        self.box.setRange(xRange=(-limit, limit), yRange=(0, highest * 1.05 or 1.0), padding=0)
        self._colour()

    def _colour(self) -> None:
        colours = theme.current()
        self.canvas.setBackground(QColor(colours.surface))
        for axis in self.axes.values():
            axis.setPen(colours.border)
            axis.setTextPen(colours.muted)
        self.legend.clear()
        self.legend.setLabelTextColor(colours.text)
        for i, (curve, name) in enumerate(self._curves):
            colour = colours.mark if i % 2 == 0 else colours.mark_other
            curve.setPen(pg.mkPen(colour, width=1.6, style=STYLES[i // 2 % len(STYLES)]))
            self.legend.addItem(curve, name)

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Follow the theme."""
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "legend"):
            self._colour()
        super().changeEvent(event)
