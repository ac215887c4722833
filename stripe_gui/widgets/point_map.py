"""The object points over the testfield, coloured by their sigmas."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF
from PySide6.QtGui import QColor, QResizeEvent

from core.report import Number, Table
from core.report.adjusted import PointSigmas
from core.report.table import Cell
from stripe_gui import theme
from stripe_gui.presenters.maps import percentile, round_up
from stripe_gui.presenters.told import translate
from stripe_gui.widgets.colour_bar import ColourBar
from stripe_gui.widgets.colours import lookup
from stripe_gui.widgets.image_view import Canvas
from stripe_gui.widgets.layout import boxed, choice, column, label, row
from stripe_gui.widgets.result_table import EMPTY, ResultTable

ROOM_FOR_TABLE = 760
REACH_PX = 14  # the point nearest to the cursor is told within this distance on the screen


class PointMap(theme.Themed):
    """Map and table of the points; the one pointed at in either is told and marked."""

    def __init__(self) -> None:
        super().__init__()
        axes = ((self.tr("X, Y and Z together"), "XYZ"), ("X", "X"), ("Y", "Y"), ("Z", "Z"))
        self.axis = choice(self.tr("Direction of the sigma"), self.colour, *axes)
        self.canvas = Canvas()
        self.canvas.box.invertY(False)
        self.canvas.setAccessibleName(self.tr("Sigmas of the object points over the testfield"))
        self.canvas.hovered.connect(self._hover)
        self.canvas.left.connect(lambda: self._point(None))
        self.points = pg.ScatterPlotItem(pxMode=True, size=13)
        self.chosen = pg.ScatterPlotItem(pxMode=True, size=22, symbol="o")
        for item in (self.points, self.chosen):
            self.canvas.box.addItem(item, ignoreBounds=True)
        self.bar = ColourBar()
        self.summary = label("", "muted", wrap=True)
        self.readout = label(" ", "muted")
        self.table = ResultTable(self.tr("Object points"), titled=False)
        self.table.hide()  # until there is room: what is never shown would make the window wide
        self.table.row_chosen.connect(self._point)
        self._shown: PointSigmas | None = None
        top, middle = row(label(self.tr("Sigma in")), self.axis, None), row(self.canvas, self.bar, spacing=8)
        picture = boxed(column(top, (middle, 1), self.readout, spacing=6))
        halves = row((picture, 1), self.table, spacing=16)
        self.setLayout(column((halves, 1), self.summary, spacing=8, margins=(0, 12, 0, 0)))
        self._point(None)

    def show_points(self, shown: PointSigmas | None) -> None:
        self._shown = shown
        self.chosen.setData([], [])
        if shown is None:
            self.points.setData([], [])
            self.table.show_table(EMPTY)
            self.summary.setText("")
            return
        rows: list[tuple[Cell, ...]] = [
            (name, *(Number(float(s), ".1f") for s in sigma), Number(int(n), "d"))
            for name, sigma, n in zip(shown.names, shown.sigma_um, shown.images, strict=True)
        ]
        columns = (self.tr("point"), "σX [µm]", "σY [µm]", "σZ [µm]", self.tr("images"))
        self.table.show_table(Table("", columns, tuple(rows)))
        self.table.fit_width()
        low, high = shown.xyz_mm[:, :2].min(axis=0), shown.xyz_mm[:, :2].max(axis=0)
        self.canvas.box.setRange(QRectF(*low, *(high - low)), padding=0.06)
        rms = np.sqrt(np.mean(shown.sigma_um**2, axis=0))
        worst = int(np.argmax(shown.of("XYZ")))
        text = self.tr("R.m.s. {x:.1f}, {y:.1f}, {z:.1f} µm in X, Y, Z. Least certain: {worst}.")
        self.summary.setText(text.format(x=rms[0], y=rms[1], z=rms[2], worst=_described(shown, worst)))
        self.canvas.setAccessibleDescription(self.summary.text())
        self.colour()

    def colour(self) -> None:
        colours = theme.current()
        self.canvas.setBackground(QColor(colours.surface))
        self.chosen.setPen(pg.mkPen(colours.mark_other, width=2))
        self.chosen.setBrush(None)
        if self._shown is None:
            return
        sigma = self._shown.of(self.axis.currentData())
        top = round_up(percentile(sigma, 99))
        self.bar.show_scale("map", (0.0, top), "µm")
        table = lookup("map")[np.clip(sigma / top * 255, 0, 255).astype(int)]
        brushes = [pg.mkBrush(*map(int, rgb)) for rgb in table]
        xy = self._shown.xyz_mm[:, :2]
        self.points.setData(x=xy[:, 0], y=xy[:, 1], brush=brushes, pen=pg.mkPen(colours.border))

    def _hover(self, x: float, y: float) -> None:
        if self._shown is None or not len(self._shown.names):
            return
        distance: NDArray = np.hypot(*(self._shown.xyz_mm[:, :2] - (x, y)).T) / self.canvas.box.viewPixelSize()[0]
        nearest = int(np.argmin(distance))
        self._point(nearest if distance[nearest] <= REACH_PX else None)

    def _point(self, index: int | None) -> None:
        if index is None or self._shown is None:
            self.chosen.setData([], [])
            self.readout.setText(self.tr("Point at a target to read its sigmas."))
            self.bar.mark(None)
            return
        self.chosen.setData(*self._shown.xyz_mm[index : index + 1, :2].T)
        self.readout.setText(_described(self._shown, index))
        self.bar.mark(float(self._shown.of(self.axis.currentData())[index]))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self.table.setVisible(self.width() >= ROOM_FOR_TABLE)


def _described(shown: PointSigmas, index: int) -> str:
    """Name a point, its sigmas and in how many images it was seen."""
    x, y, z = shown.sigma_um[index]
    text = translate("Calibrate", "{point}: σ {x:.1f}, {y:.1f}, {z:.1f} µm in X, Y, Z; {n} images")
    return text.format(point=shown.names[index], x=x, y=y, z=z, n=shown.images[index])
