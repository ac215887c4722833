"""Points in space, turned with the mouse or the arrow keys; needs OpenGL (see `stripe_gui.gl`)."""

from __future__ import annotations

import pyqtgraph as pg
import pyqtgraph.opengl as gl
from PySide6.QtCore import QEvent, Signal
from PySide6.QtGui import QColor, QVector3D
from PySide6.QtWidgets import QVBoxLayout, QWidget

from stripe_gui import theme
from stripe_gui.presenters.reconstruct import Cloud
from stripe_gui.widgets.layout import button, label, row

DISTANCE = 1.5  # of the eye, in sizes of the cloud
CLOSED = 1.4  # times their spacing: so large points close a surface that is seen from in front


class _Space(gl.GLViewWidget):
    painted = Signal()

    def paintGL(self, *arguments: object) -> None:  # noqa: N802
        """Paint, and say that it went well."""
        super().paintGL(*arguments)
        self.painted.emit()


class CloudView(QWidget):
    """A cloud seen first from beside the camera."""

    painted = Signal()

    def __init__(self, name: str) -> None:
        super().__init__()
        self.space = _Space(rotationMethod="euler")
        self.space.setAccessibleName(name)
        self.space.setAccessibleDescription(self.tr("The arrow keys turn the points, page up and down come closer."))
        self.space.painted.connect(self.painted)
        self._points: gl.GLScatterPlotItem | None = None
        self._size = 0.0
        self.hint = label(self.tr("Drag to turn, wheel to come closer, Ctrl and drag to move."), "muted")
        camera = button(self.tr("From the camera"), lambda: self.look(-90, 0), flat=True)
        beside = button(self.tr("From beside"), lambda: self.look(-60, 20), flat=True)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        layout.addWidget(self.space, 1)
        layout.addLayout(row(self.hint, None, camera, beside))
        self._colour()

    def show_cloud(self, cloud: Cloud) -> None:
        """Show points; the direction of view stays."""
        if self._points is not None:
            self.space.removeItem(self._points)
        self._points = gl.GLScatterPlotItem(
            pos=cloud.places_mm, color=cloud.colours, size=CLOSED * cloud.spacing_mm, pxMode=False
        )
        self._points.setGLOptions("opaque")
        self.space.addItem(self._points)
        first, self._size = not self._size, cloud.size_mm
        if first:
            self.look(-60, 20)

    def look(self, azimuth_deg: float, elevation_deg: float) -> None:
        """Look at the middle of the cloud from a direction; -90° and 0° is where the camera stands."""
        self.space.setCameraPosition(
            pos=QVector3D(0, 0, 0), distance=DISTANCE * self._size, azimuth=azimuth_deg, elevation=elevation_deg
        )

    def _colour(self) -> None:
        self.space.setBackgroundColor(pg.mkColor(QColor(theme.current().canvas)))

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Follow the theme."""
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "hint"):
            self._colour()
        super().changeEvent(event)
