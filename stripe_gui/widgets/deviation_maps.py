"""Signed deviations of planes as maps on one colour scale, with a cursor at the same place of every map of a plane."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, QRectF, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QGridLayout, QWidget

from core.digits import fixed
from core.model import PlaneEvaluation
from stripe_gui.presenters.evaluate import EvaluationView, plane_name, reading
from stripe_gui.presenters.told import sentence
from stripe_gui.widgets.colour_bar import ColourBar
from stripe_gui.widgets.image_view import ARROWS, ImageView
from stripe_gui.widgets.layout import boxed, button, column, emptied, label, real, row, scrolled

CURSOR = "#101010"  # dark on the light middle of the scale, in both appearances


class DeviationMaps(QWidget):
    """One map per plane and way to make points, ways below each other (or `beside`); they zoom together.

    Shift and the arrow keys move the cursor by a pixel, with Ctrl by ten.
    """

    def __init__(self, *, beside: bool = False, hint: str = "") -> None:
        super().__init__()
        self._beside = beside
        self._hint = hint or self.tr("Move the mouse over a map, or Shift and the arrow keys, to read values.")
        self.maps: list[ImageView] = []
        self._view: EvaluationView | None = None
        self._captures: list[str] = []  # of every map
        self._cursors: list[pg.ScatterPlotItem] = []
        self._at: tuple[int, float, float] | None = None  # map, u, v
        self._grid = QGridLayout()
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(8)
        self.bar = ColourBar()
        scale = self.tr("End of the colour scale")
        self.limit = real(scale, 0.001, 100.0, 3, lambda: self._scale(self.limit.value()), " mm")
        self.limit.setPrefix("± ")
        self.automatic = button(self.tr("Automatic"), self._automatic, flat=True)
        self.automatic.setToolTip(self.tr("Three times the largest r.m.s., as in the report."))
        self.limit.setToolTip(self.tr("Deviations are positive towards the camera."))
        towards = label(self.tr("+ is towards the camera"), "muted")
        fit = button(self.tr("Whole planes"), self.fit, "fit", flat=True)
        self.controls = boxed(row(label(self.tr("Scale")), self.limit, self.automatic, towards, None, fit))
        self.readout = label(" ", "muted")
        self.readout.setAccessibleName(self.tr("Values under the cursor"))
        self.foot = row(self.readout, None)
        maps = row(scrolled(boxed(self._grid)), self.bar)
        self.setLayout(column(self.controls, (maps, 1), self.foot, spacing=8))

    def show_view(self, view: EvaluationView, captures: list[str] | None = None) -> None:
        """Show the maps of all captures, or of some."""
        self._clear()
        before, self._view = self._view, view
        for i, (way, made) in enumerate(view.ways.items()):
            if not self._beside:
                self._grid.addWidget(label(sentence(way), "heading"), 2 * i, 0, 1, -1)
            for j, capture in enumerate(captures or view.captures):
                if capture in made:
                    self._grid.addWidget(self._map(made[capture], way), *((j, i) if self._beside else (2 * i + 1, j)))
        if before is not None and before.evaluations is view.evaluations:
            self._scale(self.limit.value())
        else:
            self._automatic()
        self.fit()
        self._say(None)

    def fit(self) -> None:
        if not self.maps:
            return
        known = np.any([np.isfinite(m.image) for m in self.maps if m.image is not None], axis=0)
        rows, cols = (np.flatnonzero(known.any(axis=axis)) for axis in (1, 0))
        if len(rows):
            left, top, right, bottom = (float(x) for x in (cols[0], rows[0], cols[-1], rows[-1]))
            frame = QRectF(left - 0.5, top - 0.5, right - left + 1, bottom - top + 1)
            for made in self.maps:
                made.canvas.box.setRange(frame, padding=0.04)

    def _map(self, evaluation: PlaneEvaluation, way: str) -> QWidget:
        name = self.tr("Deviations of {capture}, {method}").format(capture=evaluation.capture, method=way)
        made = ImageView(name, bar=False)
        made.setMinimumSize(140, 76)
        made.readout.hide()  # one for all maps
        made.set_image(evaluation.deviation_mm, (-1, 1), scale="deviation", unit="mm", digits=4)
        made.canvas.setAccessibleDescription(
            self.tr("Shift and the arrow keys move the cursor; plus and minus zoom, the arrow keys move the map.")
        )
        index = len(self.maps)
        made.hovered.connect(lambda u, v: self._say((index, u, v)))
        made.canvas.left.connect(partial(self._say, None))
        made.canvas.moved.connect(partial(self._follow, made))
        made.canvas.installEventFilter(self)
        cursor = pg.ScatterPlotItem(size=17, symbol="+", brush=None, pen=pg.mkPen(CURSOR, width=1.5))
        made.add_item(cursor)
        self.maps.append(made)
        self._captures.append(evaluation.capture)
        self._cursors.append(cursor)
        title = label(sentence(way) if self._beside else plane_name(evaluation))
        figures = label(self.tr("{rms} mm r.m.s.").format(rms=fixed(evaluation.rms_mm, 4)), "muted")
        figures.setToolTip(self.tr("{n} points").format(n=evaluation.n))
        heading = row(title, figures, None) if self._beside else column(title, figures, spacing=0)
        return boxed(column(heading, made, spacing=4))

    def _automatic(self) -> None:
        if self._view is not None:
            self.limit.setValue(self._view.limit_mm)
            self._scale(self._view.limit_mm)

    def _scale(self, limit: float) -> None:
        for made in self.maps:
            made.image_item.setLevels((-limit, limit))
        self.bar.show_scale("deviation", (-limit, limit), "mm")

    def _size(self) -> tuple[int, int]:
        """Width and height of the maps, px: all are of one camera."""
        assert self._view is not None
        return self._view.camera.width, self._view.camera.height

    def _say(self, at: tuple[int, float, float] | None) -> None:
        """Put the cursor at a place of a map, and at the same place of the other ways' maps."""
        if at is not None:
            width, height = self._size()
            u, v = float(round(at[1])), float(round(at[2]))
            at = (at[0], u, v) if 0 <= u < width and 0 <= v < height else None
        self._at = at
        for i, cursor in enumerate(self._cursors):
            if at is not None and self._captures[i] == self._captures[at[0]]:
                cursor.setData([at[1]], [at[2]])
            else:
                cursor.setData([], [])
        if at is None or self._view is None:
            self.readout.setText(self._hint)
            self.bar.mark(None)
            return
        self.readout.setText(reading(self._view, self._captures[at[0]], at[1], at[2]))
        self.bar.mark(self.maps[at[0]].value_at(at[1], at[2]))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress and event.key() in ARROWS:
            held = event.modifiers()
            if held & Qt.KeyboardModifier.ShiftModifier:
                index = next(i for i, made in enumerate(self.maps) if made.canvas is watched)
                width, height = self._size()
                _, u, v = self._at if self._at is not None else (index, width // 2, height // 2)
                step = 10 if held & Qt.KeyboardModifier.ControlModifier else 1
                du, dv = ARROWS[Qt.Key(event.key())]
                self._say((index, min(max(u + step * du, 0), width - 1), min(max(v + step * dv, 0), height - 1)))
                return True
        return super().eventFilter(watched, event)

    def _follow(self, moved: ImageView) -> None:
        for other in self.maps:
            if other is not moved:
                other.show_as(moved)

    def _clear(self) -> None:
        self.maps, self._captures, self._cursors, self._at = [], [], [], None
        emptied(self._grid)
