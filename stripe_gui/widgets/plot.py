"""Curves over two axes, with bands and a legend, in the colours of the theme."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
import pyqtgraph as pg
from numpy.typing import ArrayLike, NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QLabel, QSizePolicy

from core.lazy import dataclass
from stripe_gui import theme
from stripe_gui.widgets.layout import column, make

STYLES = {
    "line": Qt.PenStyle.SolidLine,
    "dash": Qt.PenStyle.DashLine,
    "dot": Qt.PenStyle.DotLine,
    "dash-dot": Qt.PenStyle.DashDotLine,
}
SAMPLES = {"line": "━━━", "dash": "╍╍╍", "dot": "┈┈┈", "dash-dot": "━╍━"}  # as the legend draws them


@dataclass(frozen=True)
class Curve:
    """One line of a plot."""

    name: str  #: for the legend; empty for none
    #: x, y: of equal length, or one x more than y for steps. NaN leaves a gap.
    x: ArrayLike
    y: ArrayLike
    tone: int = 0  #: 0 or 1: which of the theme's two colours for marks
    style: str = "line"  #: {"line", "dash", "dot", "dash-dot"}
    band: ArrayLike | None = None  #: the area between ±band is tinted
    marked: bool = False  #: whether its points are marked: few values, each measured


class Plot(theme.Themed):
    """Curves told apart by colour and by dashes.

    Put together from a view box and two axes: a pyqtgraph plot would make seven menus that nobody asked for.
    """

    def __init__(self, name: str, bottom: str, left: str) -> None:
        super().__init__()
        self.canvas = pg.GraphicsView(background=None)
        self.canvas.setAccessibleName(name)
        self.box = pg.ViewBox(enableMenu=False, enableMouse=False)
        self.axes = {side: pg.AxisItem(side) for side in ("left", "bottom")}
        self.axes["bottom"].setLabel(bottom)
        self.axes["left"].setLabel(left)
        layout = pg.GraphicsLayout()
        layout.setContentsMargins(8, 8, 16, 2)
        layout.addItem(self.axes["left"], 0, 0)
        layout.addItem(self.box, 0, 1)
        layout.addItem(self.axes["bottom"], 1, 1)
        for axis in self.axes.values():
            axis.enableAutoSIPrefix(False)
            axis.linkToView(self.box)
        self.canvas.setCentralItem(layout)
        self.legend = make(QLabel, textFormat=Qt.TextFormat.RichText, wordWrap=True)
        self.curves: tuple[Curve, ...] = ()
        self._items: list[tuple[Curve, pg.PlotCurveItem, pg.FillBetweenItem | None, pg.ScatterPlotItem | None]] = []
        self.setLayout(column(self.legend, (self.canvas, 1), spacing=4))
        self.setMinimumHeight(165)
        self.canvas.setMinimumHeight(120)
        # its own wish of 500 px would crowd out what stands beside it
        self.canvas.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self.colour()

    def set_curves(
        self, curves: Sequence[Curve], x_range: tuple[float, float], y_range: tuple[float, float], said: str = ""
    ) -> None:
        """Show curves between fixed limits; `said` tells in words what is seen."""
        for _, *items in self._items:
            for item in items:
                if item is not None:
                    self.box.removeItem(item)
        self.curves, self._items = tuple(curves), []
        for curve in curves:
            steps = np.size(curve.x) == np.size(curve.y) + 1
            item = pg.PlotCurveItem(curve.x, curve.y, stepMode="center" if steps else None, connect="finite")
            band = None
            if curve.band is not None:
                edges = [pg.PlotCurveItem(curve.x, sign * np.asarray(curve.band), connect="finite") for sign in (-1, 1)]
                band = pg.FillBetweenItem(*edges)
                self.box.addItem(band)
            self.box.addItem(item)
            points = pg.ScatterPlotItem(curve.x, curve.y, size=7) if curve.marked else None
            if points is not None:
                self.box.addItem(points)
            self._items.append((curve, item, band, points))
        self.box.setRange(xRange=x_range, yRange=y_range, padding=0)
        self.canvas.setAccessibleDescription(said)
        self.colour()

    def colour(self) -> None:
        colours = theme.current()
        self.canvas.setBackground(QColor(colours.surface))
        for axis in self.axes.values():
            axis.setPen(colours.border)
            axis.setTextPen(colours.muted)
        entries = []
        for curve, item, band, points in self._items:
            colour = QColor(colours.mark if curve.tone == 0 else colours.mark_other)
            item.setPen(pg.mkPen(colour, width=1.6, style=STYLES[curve.style]))
            if curve.name:
                sample = f'<span style="color:{colour.name()}; font-weight:bold">{SAMPLES[curve.style]}</span>'
                entries.append(f"{sample}&nbsp;{escape(curve.name).replace(' ', '&nbsp;')}")
            if points is not None:
                points.setPen(None)
                points.setBrush(colour)
            if band is not None:
                colour.setAlpha(45)
                band.setBrush(colour)
        self.legend.setText(" &nbsp;&nbsp; ".join(entries))


class CurveView(Plot):
    """A plot of one curve, whose axes change with what was measured."""

    def __init__(self, name: str) -> None:
        super().__init__(name, "", "")
        self.legend.hide()

    def set_curve(self, curve: Sequence[tuple[float, float]], x_label: str, y_label: str) -> None:
        """Show a curve of (x, y), the y axis from zero."""
        x, y = np.array(curve, np.float64).T
        self.axes["bottom"].setLabel(x_label)
        self.axes["left"].setLabel(y_label)
        margin = 0.04 * (float(np.ptp(x)) or 1.0)
        top = float(y.max()) if y.max() > 0 else 1.0
        said = "; ".join(f"{a:g}: {b:.3g}" for a, b in curve)
        limits = (x.min() - margin, x.max() + margin), (min(0.0, y.min()), 1.08 * top)
        self.set_curves([Curve("", x, y, marked=True)], *limits, said)


class Histogram(Plot):
    """Step lines over common bins, and beside each, if wanted, the normal distribution of a given sigma."""

    def __init__(self, name: str, unit: str) -> None:
        super().__init__(name, "", "")
        self._unit = unit
        self.axes["left"].setLabel(self.tr("share of pixels [%]"))

    def set_values(
        self,
        series: Sequence[tuple[str, NDArray]],
        limit: float,
        bins: int = 101,
        *,
        normal: Sequence[tuple[str, float | None]] = (),
    ) -> None:
        """Show named series of values between ±limit; what lies outside counts in the outermost bins.

        `normal` has name and sigma of the normal distribution beside each series; None for none.
        """
        edges = np.linspace(-limit, limit, bins + 1)
        x = np.linspace(-limit, limit, 401)
        curves, highest, beyond = [], 0.0, False
        for i, (name, values) in enumerate(series):
            finite = values[np.isfinite(values)]
            if not len(finite):
                continue
            share = np.histogram(np.clip(finite, -limit, limit), edges)[0] / len(finite) * 100
            highest, beyond = max(highest, float(share.max())), beyond or float(np.abs(finite).max()) > limit
            style, beside = (("line", "dash"), ("dot", "dash-dot"))[i // 2 % 2]
            style = style if normal else list(STYLES)[i // 2 % len(STYLES)]
            curves.append(Curve(name, edges, share, i % 2, style))
            if normal and (sigma := normal[i][1]):
                density = 100 * (edges[1] - edges[0]) / (sigma * np.sqrt(2 * np.pi)) * np.exp(-0.5 * (x / sigma) ** 2)
                highest = max(highest, float(density.max()))
                curves.append(Curve(normal[i][0], x, density, i % 2, beside))
        text = (
            self.tr("deviation [{unit}]; the outermost steps hold all beyond")
            if beyond
            else self.tr("deviation [{unit}]")
        )
        self.axes["bottom"].setLabel(text.format(unit=self._unit))
        self.set_curves(curves, (-limit, limit), (0, highest * 1.05 or 1.0))
