"""Icons, fonts and texts that come with the program."""

from __future__ import annotations

from functools import cache

from PySide6.QtCore import QByteArray, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QIconEngine, QPainter, QPixmap
from PySide6.QtSvg import QSvgRenderer

from core.resources import resource
from stripe_gui import theme


@cache
def _drawing(name: str, colour: str) -> QSvgRenderer:
    text = resource("icons", f"{name}.svg").read_text(encoding="utf-8").replace("currentColor", colour)
    return QSvgRenderer(QByteArray(text.encode()))


def draw_icon(painter: QPainter, name: str, rect: QRectF, colour: str | QColor) -> None:
    """Paint an icon in one colour, sharp at every scale."""
    _drawing(name, QColor(colour).name()).render(painter, rect)


class _Engine(QIconEngine):
    """Draws an icon when it is shown, so that it follows the theme and the screen's scale."""

    def __init__(self, name: str, on_accent: bool) -> None:
        super().__init__()
        self._name, self._on_accent = name, on_accent

    def paint(self, painter: QPainter, rect: QRect, mode: QIcon.Mode, state: QIcon.State) -> None:
        colours = theme.current()
        colour = colours.accent_text if self._on_accent else colours.text
        if mode == QIcon.Mode.Disabled:
            colour = colours.faint
        draw_icon(painter, self._name, QRectF(rect), colour)

    def pixmap(self, size: QSize, mode: QIcon.Mode, state: QIcon.State) -> QPixmap:
        pixmap = QPixmap(size)
        pixmap.fill(Qt.GlobalColor.transparent)
        painter = QPainter(pixmap)
        self.paint(painter, pixmap.rect(), mode, state)
        painter.end()
        return pixmap

    def clone(self) -> QIconEngine:
        return _Engine(self._name, self._on_accent)


def icon(name: str, on_accent: bool = False) -> QIcon:
    """Give an icon of `resources/icons` in the theme's text colour (`on_accent`: for a filled button)."""
    return QIcon(_Engine(name, on_accent))
