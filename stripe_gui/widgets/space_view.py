"""Points, lines and names in space, turned with the mouse or the arrow keys; painted without OpenGL."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QImage, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF, QWheelEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from core.model import Array
from stripe_gui import theme
from stripe_gui.presenters.space import Scene, ends_of
from stripe_gui.widgets.layout import button, column, label, row

DISTANCE = 2.5  # of the eye from the middle, in sizes of the scene
WHILE_TURNING = 40_000  # points that are drawn while the view moves
REST_MS = 150
FROM_CAMERA, FROM_BESIDE = (-90.0, 0.0), (-55.0, 22.0)  # azimuth and elevation of the eye, degrees


class _Space(QWidget):
    """The picture itself."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setAccessibleDescription(self.tr("The arrow keys turn the view, plus and minus zoom, 0 shows all."))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(220, 180)
        self.scene = Scene()
        self.azimuth, self.elevation = FROM_BESIDE
        self._ends = ends_of(self.scene)
        self._middle, self._size = np.zeros(3), 1.0
        self._zoom, self._shift = 1.0, QPointF()
        self._fitted = True  # until the operator comes closer or moves it
        self._pressed = QPointF()
        self._rest = QTimer(self, singleShot=True, interval=REST_MS)
        self._rest.timeout.connect(self.update)

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(260, 200)

    def show_scene(self, scene: Scene) -> None:
        """Show another scene; the direction of view stays."""
        self.scene, self._ends = scene, ends_of(scene)
        low, high = self._ends.min(axis=0), self._ends.max(axis=0)
        self._middle, self._size = (low + high) / 2, float(np.linalg.norm(high - low)) or 1.0
        self.update()

    def look(self, azimuth: float, elevation: float) -> None:
        self.azimuth, self.elevation, self._fitted = azimuth, elevation, True
        self.update()

    def _fit(self) -> None:
        """Let all fill the widget, with room for names."""
        self._zoom, self._shift = 1.0, QPointF()
        at, _ = self.on_screen(self._ends)
        low, high = at.min(axis=0), at.max(axis=0)
        wide, high_ = np.maximum(high - low, 1.0)
        self._zoom = float(min((self.width() - 60) / wide, (self.height() - 60) / high_))
        self._shift = QPointF(*(self._zoom * (np.array([self.width(), self.height()]) / 2 - (low + high) / 2)))

    def on_screen(self, places_mm: NDArray) -> tuple[Array, Array]:
        """Project places, shape (n, 3): where they are painted, shape (n, 2), and how near to the eye they are."""
        a, e = radians(self.azimuth), radians(self.elevation)
        towards = np.array([cos(e) * cos(a), cos(e) * sin(a), sin(e)])
        right = np.array([-sin(a), cos(a), 0.0])
        axes = np.stack([right, np.cross(towards, right), towards], axis=1)
        x, y, near = ((places_mm - self._middle) @ axes).T
        scale = self._zoom * min(self.width(), self.height()) / self._size
        scale = scale * DISTANCE * self._size / np.maximum(DISTANCE * self._size - near, 0.01 * self._size)
        at = QPointF(self.width() / 2, self.height() / 2) + self._shift
        return np.stack([at.x() + scale * x, at.y() - scale * y], axis=1), near

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802
        if self._fitted:
            self._fit()
        painter, colours = QPainter(self), theme.current()
        painter.drawImage(0, 0, self._points(QColor(colours.canvas)))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for line in self.scene.lines:
            colour = QColor(getattr(colours, line.colour))
            path = QPolygonF([QPointF(*p) for p in self.on_screen(line.places_mm)[0].tolist()])
            painter.setPen(QPen(colour, line.width))
            if line.filled:
                colour.setAlpha(45)
                painter.setBrush(colour)
                painter.drawPolygon(path)
            else:
                painter.drawPolyline(path)
        for name in self.scene.names:
            painter.setPen(QColor(getattr(colours, name.colour)))
            (x, y), room = self.on_screen(name.place_mm[None])[0][0], painter.fontMetrics()
            wide = room.horizontalAdvance(name.text)
            left, foot = (
                min(max(x - wide / 2, 4), self.width() - wide - 4),
                min(y + 1.2 * room.height(), self.height() - 4),
            )
            painter.drawText(QPointF(left, max(foot, room.height())), name.text)
        painter.end()

    def _points(self, background: QColor) -> QImage:
        """Set every point as a small square; what is nearer covers what is behind."""
        ratio = self.devicePixelRatioF()
        height, width = (max(1, round(ratio * side)) for side in (self.height(), self.width()))
        pixels = np.empty((height, width), np.uint32)
        pixels.fill(background.rgb())
        scene = self.scene
        if scene.colours is not None and len(scene.places_mm):
            step = max(1, len(scene.places_mm) // WHILE_TURNING) if self._rest.isActive() else 1
            at, near = self.on_screen(scene.places_mm[::step])
            order = np.argsort(near)
            x, y = (ratio * at[order]).astype(np.int32).T
            r, g, b = scene.colours[::step][order].astype(np.uint32).T
            colour = 0xFF000000 | r << 16 | g << 8 | b
            spread = scene.spacing_mm * self._zoom * min(width, height) / self._size * step**0.5
            side = min(max(round(1.4 * spread), 1), 12)
            for dx in range(-(side // 2), side - side // 2):
                for dy in range(-(side // 2), side - side // 2):
                    u, v = x + dx, y + dy
                    inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
                    pixels[v[inside], u[inside]] = colour[inside]
        image = QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_RGB32).copy()
        image.setDevicePixelRatio(ratio)
        return image

    def _move(self) -> None:
        self._rest.start()
        self.update()

    def _come(self, closer: float) -> None:
        self._zoom, self._fitted = self._zoom * closer, False
        self._move()

    def _turn(self, across: float, up: float) -> None:
        self.azimuth -= across
        self.elevation = min(max(self.elevation + up, -90.0), 90.0)
        self._move()

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        self._pressed = event.position()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        way, self._pressed = event.position() - self._pressed, event.position()
        if event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            self._shift, self._fitted = self._shift + way, False
            self._move()
        else:
            self._turn(0.4 * way.x(), 0.4 * way.y())

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: N802
        self._come(1.0015 ** event.angleDelta().y())

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        keys = Qt.Key
        turns = {keys.Key_Left: (-5, 0), keys.Key_Right: (5, 0), keys.Key_Up: (0, 5), keys.Key_Down: (0, -5)}
        zooms = {keys.Key_Plus: 1.25, keys.Key_Equal: 1.25, keys.Key_Minus: 0.8}
        if event.key() in turns:
            self._turn(*turns[Qt.Key(event.key())])
        elif event.key() in zooms:
            self._come(zooms[Qt.Key(event.key())])
        elif event.key() == keys.Key_0:
            self.look(self.azimuth, self.elevation)
        else:
            event.ignore()


class SpaceView(QWidget):
    """The picture with its two usual directions of view."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.space = _Space(name)
        hint = label(self.tr("Drag to turn, wheel to come closer, Ctrl and drag to move."), "muted", wrap=True)
        camera = button(self.tr("From the camera"), lambda: self.space.look(*FROM_CAMERA), flat=True)
        beside = button(self.tr("From beside"), lambda: self.space.look(*FROM_BESIDE), flat=True)
        self.setLayout(column((self.space, 1), row((hint, 1), camera, beside), spacing=4))

    def show_scene(self, scene: Scene) -> None:
        """Show a scene; the direction of view stays."""
        self.space.show_scene(scene)

    def fit(self) -> None:
        self.space.look(self.space.azimuth, self.space.elevation)
