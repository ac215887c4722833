"""The residuals of an adjustment: one plot per device, by station, with a way to the image of a suspicious one."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyqtgraph as pg
from numpy.typing import ArrayLike, NDArray
from PySide6.QtCore import QRectF, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QSizePolicy, QWidget

from stripe_gui import theme
from stripe_gui.presenters.calibrate import DeviceResiduals
from stripe_gui.presenters.maps import round_factor
from stripe_gui.presenters.status import device_name
from stripe_gui.widgets.image_view import Canvas
from stripe_gui.widgets.layout import boxed, button, choice, column, emptied, label, refill, row
from stripe_gui.workbench import Workbench

REACH_PX = 10  # a click takes the nearest point within this distance on the screen


class ResidualPlot(theme.Themed):
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
        self.colour()

    def set_residuals(
        self, uv: ArrayLike, residuals: ArrayLike, size: tuple[int, int], um: tuple[float, float]
    ) -> None:
        """Show residuals, observed minus computed, at `uv`, both (n, 2) px or lines of a device of this size.

        A NaN coordinate was not observed: it is drawn as zero. `um` is micrometres per px in u and v, for the legend.
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

    def colour(self) -> None:
        colours = theme.current()
        self.canvas.setBackground(QColor(colours.surface))
        self.frame.setPen(pg.mkPen(colours.faint, width=1))
        self.vectors.setPen(pg.mkPen(colours.mark, width=1))
        self.points.setPen(None)
        self.points.setBrush(pg.mkBrush(colours.mark))
        self.chosen.setPen(pg.mkPen(colours.mark_other, width=2))
        self.chosen.setBrush(None)


class ResidualView(QWidget):
    """Residual vectors of camera and projector side by side; the chosen target, or its capture, can be excluded."""

    target_unwanted = Signal(str, int, int)  # capture, row, col
    capture_unwanted = Signal(str)

    def __init__(self, bench: Workbench) -> None:
        super().__init__()
        self._bench = bench
        self._sets: tuple[DeviceResiduals, ...] = ()
        self._rows: list[np.ndarray] = []
        self._at: tuple[int, int] | None = None
        self.stations = choice(self.tr("Captures whose residuals are shown"), self._draw, minimumWidth=150)
        self.picked = label(self.tr("Click a vector to learn which point it is."), "muted")
        self.open_image = button(self.tr("Open image"), self._open, "measure", flat=True)
        self.open_image.setToolTip(self.tr("Look at this target in its image."))
        self.exclude = button(self.tr("Exclude target"), self._exclude, "close", flat=True)
        self.exclude.setToolTip(self.tr("Leave this target of this capture out, and calibrate again."))
        self.leave_out = button(self.tr("Leave out capture"), self._leave_out, "close", flat=True)
        self.leave_out.setToolTip(self.tr("Calibrate again without this capture."))
        self.plots: list[ResidualPlot] = []
        self._plots = row(spacing=16)
        buttons = row(self.open_image, self.exclude, self.leave_out, spacing=2)
        top = row(label(self.tr("Captures")), self.stations, None, buttons)
        self.setLayout(column(top, (self._plots, 1), self.picked, spacing=10, margins=(0, 12, 0, 0)))

    def show_residuals(self, sets: tuple[DeviceResiduals, ...]) -> None:
        self._sets = sets
        emptied(self._plots)
        self.plots = []
        for i, device in enumerate(sets):
            plot = ResidualPlot(self.tr("Residual vectors of {name}").format(name=device_name(device.name)))
            plot.picked.connect(partial(self._pick, i))
            self.plots.append(plot)
            self._plots.addWidget(boxed(column(label(device_name(device.name), "heading"), plot, spacing=6)), 1)
        captures = dict.fromkeys(d.capture(i) for d in sets for i in range(len(d.station)))
        refill(self.stations, [(self.tr("all"), ""), *((name, name) for name in captures)], "")
        self._draw()

    def _draw(self) -> None:
        wanted = self.stations.currentData() or ""
        self._rows, self._at = [], None
        for device, plot in zip(self._sets, self.plots, strict=True):
            rows = np.array(
                [i for i in range(len(device.station)) if not wanted or device.capture(i) == wanted], dtype=np.intp
            )
            self._rows.append(rows)
            plot.set_residuals(device.uv[rows], device.residual[rows], device.size, device.um_per_px)
        self._offer("")

    def _offer(self, text: str) -> None:
        """Say which point is chosen, and enable what can be done with it."""
        self.picked.setText(text or self.tr("Click a vector to learn which point it is."))
        folder = self._bench.session.folder
        known = bool(text) and folder is not None and folder.entry(self._capture()) is not None
        for made in (self.open_image, self.exclude, self.leave_out):
            made.setEnabled(known)

    def _pick(self, device: int, index: int) -> None:
        self._at = device, int(self._rows[device][index])
        for i, plot in enumerate(self.plots):
            if i != device:
                plot.choose(None)
        self._offer(self._sets[device].describe(self._at[1]))

    def _capture(self) -> str:
        return self._sets[self._at[0]].capture(self._at[1]) if self._at else ""

    def _target(self) -> tuple[int, int] | None:
        return self._sets[self._at[0]].target(self._at[1]) if self._at else None

    def _open(self) -> None:
        self._bench.session.choose_capture(self._capture(), self._target())
        self._bench.show_page("measure")

    def _exclude(self) -> None:
        if (target := self._target()) is not None:
            self.target_unwanted.emit(self._capture(), *target)

    def _leave_out(self) -> None:
        self.capture_unwanted.emit(self._capture())
