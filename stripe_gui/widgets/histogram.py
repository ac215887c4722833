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
    """Step lines over common bins; told apart by colour and by dashes."""

    def __init__(self, name: str, unit: str) -> None:
        super().__init__()
        self.plot = pg.PlotWidget(background=None, enableMenu=False)
        self.plot.setAccessibleName(name)
        self.plot.hideButtons()
        self.plot.setMouseEnabled(False, False)
        self.plot.setLabel("bottom", self.tr("deviation [{unit}]").format(unit=unit))
        self.plot.setLabel("left", self.tr("share of pixels [%]"))
        self.plot.getAxis("bottom").enableAutoSIPrefix(False)
        self.plot.getAxis("left").enableAutoSIPrefix(False)
        self.legend = self.plot.addLegend(offset=(-10, 10))
        self._curves: list[tuple[pg.PlotCurveItem, int]] = []
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.plot)
        self.setMinimumHeight(180)
        self._colour()

    def set_values(self, series: Sequence[tuple[str, NDArray]], limit: float, bins: int = 101) -> None:
        """Show named series of values between ±limit; what lies outside counts in the outermost bins."""
        self.legend.clear()
        for curve, _ in self._curves:
            self.plot.removeItem(curve)
        self._curves = []
        edges = np.linspace(-limit, limit, bins + 1)
        for i, (name, values) in enumerate(series):
            finite = values[np.isfinite(values)]
            if not len(finite):
                continue
            share = np.histogram(np.clip(finite, -limit, limit), edges)[0] / len(finite) * 100
            curve = pg.PlotCurveItem(edges, share, stepMode="center", name=name)
            self.plot.addItem(curve)
            self._curves.append((curve, i))
        self.plot.setXRange(-limit, limit, padding=0)
        self._colour()

    def _colour(self) -> None:
        colours = theme.current()
        self.plot.setBackground(QColor(colours.surface))
        for side in ("bottom", "left"):
            axis = self.plot.getAxis(side)
            axis.setPen(colours.border)
            axis.setTextPen(colours.muted)
        self.legend.setLabelTextColor(colours.text)
        for curve, i in self._curves:
            colour = colours.mark if i % 2 == 0 else colours.mark_other
            curve.setPen(pg.mkPen(colour, width=1.6, style=STYLES[i // 2 % len(STYLES)]))

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Follow the theme."""
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "legend"):
            self._colour()
        super().changeEvent(event)
