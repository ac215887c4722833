"""Where the image points of each device lie: counts per cell, the points and their hull."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QWidget

from core.report.adjusted import Coverage
from stripe_gui import theme
from stripe_gui.presenters.decode import round_up
from stripe_gui.presenters.status import device_name
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, column, emptied, label, row


class CoverageView(QWidget):
    """One map of counts per device, side by side."""

    def __init__(self) -> None:
        super().__init__()
        self.maps: list[ImageView] = []
        self._maps = row(spacing=16)
        note = self.tr(
            "Points of all stations per cell of the image. Where there are none the additional parameters are "
            "extrapolated: fill edges and corners."
        )
        self.setLayout(column((self._maps, 1), label(note, "muted", wrap=True), spacing=8, margins=(0, 12, 0, 0)))

    def show_coverage(self, devices: tuple[Coverage, ...]) -> None:
        emptied(self._maps)
        self.maps = []
        for device in devices:
            view = ImageView(self.tr("Coverage of {name}").format(name=device_name(device.name)))
            self._fill(view, device)
            self.maps.append(view)
            text = self.tr("{n} points; hull {h:.0%} of the image; {c:.0%} of the cells hold points")
            said = text.format(n=len(device.uv), h=device.hull_share, c=device.filled)
            words = label(said, "muted", wrap=True)
            view.canvas.setAccessibleDescription(said)
            self._maps.addWidget(boxed(column(label(device_name(device.name), "heading"), view, words, spacing=6)), 1)

    def _fill(self, view: ImageView, device: Coverage) -> None:
        image = device.map().astype(np.float32)
        image[image == 0] = np.nan  # an empty cell stays empty
        view.set_image(image, (0.0, round_up(float(device.counts.max(initial=1)))), scale="map")
        edge = pg.PlotCurveItem(device.hull[:, 0], device.hull[:, 1], pen=pg.mkPen("#ffffff", width=2))
        around = pg.PlotCurveItem(device.hull[:, 0], device.hull[:, 1], pen=pg.mkPen(theme.LIGHT.text, width=4))
        points = pg.ScatterPlotItem(
            x=device.uv[:, 0], y=device.uv[:, 1], pxMode=True, size=2, pen=None, brush=pg.mkBrush("#ffffffa0")
        )
        for item in (points, around, edge):
            view.add_item(item)
