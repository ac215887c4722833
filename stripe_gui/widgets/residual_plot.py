"""Residual vectors over a device's image: thousands of them in two items."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import ArrayLike, NDArray
from PySide6.QtCore import QEvent, QRectF, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QSizePolicy, QWidget

from stripe_gui import theme
from stripe_gui.presenters.maps import round_factor
from stripe_gui.widgets.image_view import Canvas
from stripe_gui.widgets.layout import column, label

REACH_PX = 10  # a click takes the nearest point within this distance on the screen


class ResidualPlot(QWidget):
    """Vectors from image points, drawn `factor` times too long; click one to learn which it is."""

    picked = Signal(int)  # index into the points

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(170, 150)
        self.canvas = Canvas()
        self.canvas.setAccessibleName(name)
        self.canvas.clicked.connect(self._click)
        self.frame = pg.PlotCurveItem()
        self.vectors = pg.PlotCurveItem(connect="pairs")
        self.points = pg.ScatterPlotItem(pxMode=True, size=3)
        self.chosen = pg.ScatterPlotItem(pxMode=True, size=14, symbol="o")
        for item in (self.frame, self.vectors, self.points, self.chosen):
            self.canvas.box.addItem(item, ignoreBounds=True)
        self.legend = label("", "muted", wrap=True)
        self._uv: NDArray = np.zeros((0, 2))
        self.factor = 1.0
        self.setLayout(column((self.canvas, 1), self.legend, spacing=4))
        self._colour()

    def set_residuals(
        self, uv: ArrayLike, residuals: ArrayLike, size: tuple[int, int], um: tuple[float, float]
    ) -> None:
        """Show residuals.

        Parameters
        ----------
        uv, residuals : array, shape (n, 2)
            Where the points are and observed minus computed, px (or lines). A NaN coordinate was not observed: it is
            drawn as zero.
        size : (width, height) of the device, px
        um : micrometres per px in u and v, for the legend
        """
        uv = np.asarray(uv, dtype=np.float64).reshape(-1, 2)
        d = np.nan_to_num(np.asarray(residuals, dtype=np.float64).reshape(-1, 2))
        keep = np.asarray(np.isfinite(uv).all(axis=1))
        self._uv = np.where(keep[:, None], uv, np.inf)
        uv, d = uv[keep], d[keep]
        width, height = size
        length = float(np.sqrt(np.mean(np.sum(d**2, axis=1)))) if len(d) else 0.0
        # an average vector covers a 40th of the image; round, so that the legend reads well
        self.factor = round_factor(width / 40 / length) if length > 0 else 1.0
        ends = uv + self.factor * d
        pairs = np.stack([uv, ends], axis=1).reshape(-1, 2)
        self.vectors.setData(pairs[:, 0], pairs[:, 1], connect="pairs")
        self.points.setData(x=uv[:, 0], y=uv[:, 1])
        self.chosen.setData([], [])
        box = np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])
        self.frame.setData(*np.vstack([box, box[:1]]).T)
        self.canvas.box.setRange(QRectF(-0.5, -0.5, width, height), padding=0.03)
        rms = np.sqrt(np.mean((d * np.array(um)) ** 2, axis=0)) if len(d) else np.zeros(2)
        text = self.tr("{n} points; vectors drawn {f:g} times; r.m.s. {x:.2f} µm in x, {y:.2f} µm in y")
        self.legend.setText(text.format(n=len(uv), f=self.factor, x=rms[0], y=rms[1]))
        self.canvas.setAccessibleDescription(self.legend.text())

    def choose(self, index: int | None) -> None:
        if index is None or not np.isfinite(self._uv[index]).all():
            self.chosen.setData([], [])
        else:
            self.chosen.setData(self._uv[index : index + 1, 0], self._uv[index : index + 1, 1])

    def _click(self, u: float, v: float, *_: object) -> None:
        if not len(self._uv):
            return
        distance = np.hypot(*(self._uv - (u, v)).T) / self.canvas.box.viewPixelSize()[0]
        nearest = int(np.argmin(distance))
        if distance[nearest] <= REACH_PX:
            self.choose(nearest)
            self.picked.emit(nearest)

    def _colour(self) -> None:
        colours = theme.current()
        self.canvas.setBackground(QColor(colours.surface))
        self.frame.setPen(pg.mkPen(colours.faint, width=1))
        self.vectors.setPen(pg.mkPen(colours.mark, width=1))
        self.points.setPen(None)
        self.points.setBrush(pg.mkBrush(colours.mark))
        self.chosen.setPen(pg.mkPen(colours.mark_other, width=2))
        self.chosen.setBrush(None)

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "legend"):
            self._colour()
        super().changeEvent(event)
