"""The residuals of an adjustment: one plot per device, by station, with a way to the image of a suspicious one."""

from __future__ import annotations

from functools import partial

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from stripe_gui.presenters.calibrate import DeviceResiduals
from stripe_gui.presenters.status import device_name
from stripe_gui.widgets.layout import boxed, button, choice, column, emptied, label, refill, row
from stripe_gui.widgets.residual_plot import ResidualPlot
from stripe_gui.workbench import Workbench


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
