"""What Qt and matplotlib do by themselves with the same image or vectors."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QLineF, Qt
from PySide6.QtGui import QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget


class Canvas(QWidget):
    """Draws an image scaled to its own size, or lines, shape (n, 4)."""

    def __init__(self) -> None:
        super().__init__()
        self.image: QImage | None = None
        self.lines: np.ndarray | None = None

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Paint with QPainter."""
        painter = QPainter(self)
        if self.image is not None:
            painter.drawImage(self.rect(), self.image)
        if self.lines is not None:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(Qt.GlobalColor.black, 1))
            painter.drawLines([QLineF(*line) for line in self.lines.tolist()])
        painter.end()


def quiver(uv: np.ndarray, d: np.ndarray, size: tuple[int, int]) -> float:
    """Draw vectors with matplotlib into memory; give how much of the picture they cover."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size[0] / 100, size[1] / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)
    figure.subplots().quiver(*uv.T, *d.T, angles="xy", scale_units="xy", scale=1 / 200, width=0.001)
    canvas.draw()
    return float(np.mean(np.asarray(canvas.buffer_rgba())[..., 0] < 200))
