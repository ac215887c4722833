"""A part of an image, eight times as large, with cross hairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from stripe_gui import theme

ZOOM = 8


class Loupe(QWidget):
    """What lies round a position (px)."""

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(200, 110)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.setAccessibleName(self.tr("Loupe, 8 times"))
        self._image: NDArray | None = None
        self._bright = 255.0
        self._dots: tuple[tuple[float, float], ...] = ()
        self.at = (0.0, 0.0)

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(250, 180)

    def show_at(
        self, image: NDArray | None, bright: float, u: float, v: float, dots: tuple[tuple[float, float], ...] = ()
    ) -> None:
        """Look at a position; `bright` is the grey value shown as white, `dots` are positions (px) to be marked."""
        self._image, self._bright, self.at, self._dots = image, bright, (u, v), dots
        self.setAccessibleDescription(f"u {u:.1f}, v {v:.1f}")
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(theme.current().canvas))
        if self._image is not None:
            self._draw_pixels(painter, self._image)
            self._draw_marks(painter)
        painter.setPen(QPen(QColor(theme.current().border), 1))
        painter.drawRect(self.rect().adjusted(0, 0, -1, -1))
        painter.end()

    def _place(self, u: float, v: float) -> QPointF:
        """Where a position of the image is drawn."""
        return QPointF(self.width() / 2 + (u - self.at[0]) * ZOOM, self.height() / 2 + (v - self.at[1]) * ZOOM)

    def _draw_pixels(self, painter: QPainter, image: NDArray) -> None:
        u, v = self.at
        wide, high = self.width() // (2 * ZOOM) + 2, self.height() // (2 * ZOOM) + 2
        height, width = image.shape
        x0, x1 = max(0, round(u) - wide), min(width, round(u) + wide + 1)
        y0, y1 = max(0, round(v) - high), min(height, round(v) + high + 1)
        if x1 <= x0 or y1 <= y0:
            return
        part = np.clip(np.nan_to_num(image[y0:y1, x0:x1]) / max(self._bright, 1e-6), 0, 1)
        grey = np.ascontiguousarray(part * 255, dtype=np.uint8)
        picture = QImage(grey.data, x1 - x0, y1 - y0, x1 - x0, QImage.Format.Format_Grayscale8)
        painter.drawImage(QRectF(self._place(x0 - 0.5, y0 - 0.5), self._place(x1 - 0.5, y1 - 0.5)), picture)

    def _draw_marks(self, painter: QPainter) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(theme.DARK.mark), 1.5))
        for u, v in self._dots:
            at = self._place(u, v)
            painter.drawLine(at - QPointF(5, 0), at + QPointF(5, 0))
            painter.drawLine(at - QPointF(0, 5), at + QPointF(0, 5))
        painter.setPen(QPen(QColor(theme.DARK.mark_other), 1.5))
        middle = self._place(*self.at)
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            step = QPointF(dx, dy)
            painter.drawLine(middle + step * 8, middle + step * 60)
