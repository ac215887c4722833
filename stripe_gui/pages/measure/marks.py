"""The marks of the picking page over its image: few items, however many targets."""

from __future__ import annotations

from functools import cache

import numpy as np
import pyqtgraph as pg
from PySide6.QtGui import QPainterPath

from stripe_gui import theme
from stripe_gui.pages.measure.view import Marks
from stripe_gui.widgets.image_view import ImageView


@cache
def plus() -> QPainterPath:
    """Two strokes across each other."""
    path = QPainterPath()
    for x, y in ((1, 0), (0, 1)):
        path.moveTo(-0.5 * x, -0.5 * y)
        path.lineTo(0.5 * x, 0.5 * y)
    return path


@cache
def cross_hairs() -> QPainterPath:
    """Four strokes that leave the middle free."""
    path = QPainterPath()
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        path.moveTo(0.18 * x, 0.18 * y)
        path.lineTo(0.5 * x, 0.5 * y)
    return path


class MarksOverlay:
    """Picks with their numbers, grid, centroids with residuals, missing and excluded targets, and the cross hairs."""

    def __init__(self, view: ImageView) -> None:
        self._view = view
        ink = theme.DARK  # on the picture itself, which is the same in light and dark
        self.grid = pg.ScatterPlotItem(pxMode=False, symbol="o", pen=pg.mkPen(ink.mark, width=1.5), brush=None)
        self.residuals = pg.PlotCurveItem(pen=pg.mkPen(ink.mark_other, width=1.5))
        self.measured = pg.ScatterPlotItem(size=10, symbol=plus(), pen=pg.mkPen(ink.mark, width=1.5), brush=None)
        self.missing = pg.ScatterPlotItem(size=12, symbol="d", pen=pg.mkPen(ink.warning, width=1.5), brush=None)
        self.excluded = pg.ScatterPlotItem(size=12, symbol="x", pen=pg.mkPen(ink.danger, width=1), brush=ink.danger)
        self.picks = pg.ScatterPlotItem(size=20, symbol="s", brush=None)
        self.chosen = pg.ScatterPlotItem(size=30, symbol="o", pen=pg.mkPen("#ffffff", width=1.5), brush=None)
        self.cursor = pg.ScatterPlotItem(
            size=44, symbol=cross_hairs(), pen=pg.mkPen(ink.mark_other, width=1.5), brush=None
        )
        self._labels: list[pg.TextItem] = []
        for item in (
            self.grid,
            self.residuals,
            self.measured,
            self.missing,
            self.excluded,
            self.picks,
            self.chosen,
            self.cursor,
        ):
            view.add_item(item)

    def show(self, marks: Marks) -> None:
        inside = np.isfinite(marks.grid).all(axis=1)
        self.grid.setData(x=marks.grid[inside, 0], y=marks.grid[inside, 1], size=1.25 * marks.grid_px[inside])
        for item, points in (
            (self.measured, marks.measured),
            (self.missing, marks.missing),
            (self.excluded, marks.excluded),
            (self.picks, marks.picks),
        ):
            item.setData(x=points[:, 0], y=points[:, 1])
        ends = np.stack([marks.measured, marks.measured + marks.factor * marks.residual], axis=1).reshape(-1, 2)
        self.residuals.setData(ends[:, 0], ends[:, 1], connect="pairs")
        style = pg.QtCore.Qt.PenStyle.DotLine if marks.guessed else pg.QtCore.Qt.PenStyle.SolidLine
        self.picks.setPen(pg.mkPen(theme.DARK.ok, width=2, style=style))
        self._number(marks)

    def show_cursor(self, at: tuple[float, float] | None) -> None:
        self.cursor.setData([at[0]] if at else [], [at[1]] if at else [])

    def show_chosen(self, at: tuple[float, float] | None) -> None:
        self.chosen.setData([at[0]] if at else [], [at[1]] if at else [])

    def _number(self, marks: Marks) -> None:
        while len(self._labels) < len(marks.labels):
            made = pg.TextItem(color=theme.DARK.ok, anchor=(-0.7, 1.1))
            self._labels.append(made)
            self._view.add_item(made)
        for i, item in enumerate(self._labels):
            item.setVisible(i < len(marks.labels))
            if i < len(marks.labels):
                item.setText(marks.labels[i])
                item.setPos(*marks.picks[i])
