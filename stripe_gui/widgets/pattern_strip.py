"""A sequence as a row of little pattern pictures, with what has become of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QImage, QPainter, QPixmap
from PySide6.QtWidgets import QListView, QListWidget, QListWidgetItem

from core.patterns import Pattern, axis_of, brightness
from stripe_gui import theme
from stripe_gui.assets import draw_icon
from stripe_gui.presenters.capture import pattern_text

SIDE = 48  # px of a picture
STRIPE = 4  # px that a stripe has at least; finer ones are shown as an enlarged part
SIGNS = {"taken": ("success", "ok"), "again": ("refresh", "warning")}


def picture(pattern: Pattern, lines: tuple[int, int], side: int = SIDE) -> tuple[NDArray[np.uint8], bool]:
    """Draw a pattern, shape (side, side), and say whether only an enlarged part of it is shown.

    Examples
    --------
    >>> from core.patterns import Code
    >>> drawn, enlarged = picture(Code("gray", "x", 0, 3, 80), (640, 640), 8)
    >>> drawn[0].tolist(), enlarged
    ([0, 0, 0, 0, 255, 255, 255, 255], False)
    """
    axis = axis_of(pattern) or "x"
    count = lines[0 if axis == "x" else 1]
    whole = brightness(pattern, np.arange(count))
    changes = int(np.count_nonzero(np.diff(whole > 0.5)))
    stripe = count / (changes + 1)
    shown = count if stripe * side / count >= STRIPE else max(2, round(stripe * side / STRIPE))
    first = (count - shown) // 2
    at = first + (np.arange(side) * shown) // side
    row = np.rint(255 * whole[at]).astype(np.uint8)
    drawn = np.tile(row, (side, 1))
    return (drawn if axis == "x" else np.ascontiguousarray(drawn.T)), shown < count


class PatternStrip(QListWidget):
    """One little picture a pattern; signs say which have been taken, or are to be taken again."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setViewMode(QListView.ViewMode.IconMode)
        self.setFlow(QListView.Flow.LeftToRight)
        self.setWrapping(False)
        self.setMovement(QListView.Movement.Static)
        self.setIconSize(QSize(SIDE, SIDE))
        self.setGridSize(QSize(SIDE + 14, SIDE + 24))
        self.setHorizontalScrollMode(QListWidget.ScrollMode.ScrollPerPixel)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setFixedHeight(SIDE + 24 + 20)
        self._pictures: list[NDArray[np.uint8]] = []
        self._states: list[str] = []
        self._patterns: tuple[Pattern, ...] = ()

    @property
    def states(self) -> tuple[str, ...]:
        """What has become of each pattern: "", "taken", "again"."""
        return tuple(self._states)

    def set_patterns(self, patterns: Sequence[Pattern], lines: tuple[int, int]) -> None:
        """Show another sequence, nothing taken of it yet."""
        self._patterns = tuple(patterns)
        drawn = [picture(pattern, lines) for pattern in patterns]
        self._pictures, self._states = [image for image, _ in drawn], [""] * len(patterns)
        self.clear()
        for i, (pattern, (_, enlarged)) in enumerate(zip(patterns, drawn, strict=True)):
            item = QListWidgetItem(str(i))
            text = pattern_text(pattern)
            item.setToolTip(self.tr("{text} (a part, enlarged)").format(text=text) if enlarged else text)
            self.addItem(item)
            self._draw(i)

    def set_state(self, index: int, state: str) -> None:
        if 0 <= index < len(self._states) and self._states[index] != state:
            self._states[index] = state
            self._draw(index)

    def follow(self, index: int) -> None:
        if 0 <= index < self.count():
            self.scrollToItem(self.item(index))

    def set_all(self, state: str) -> None:
        for i in range(len(self._states)):
            self.set_state(i, state)

    def _draw(self, index: int) -> None:
        item, state = self.item(index), self._states[index]
        word = {"taken": self.tr("taken"), "again": self.tr("to be taken again")}.get(state, self.tr("not taken yet"))
        text = f"{index}: {pattern_text(self._patterns[index])}, {word}"
        item.setData(Qt.ItemDataRole.AccessibleTextRole, text)
        drawn = QIcon()
        for mode in (QIcon.Mode.Normal, QIcon.Mode.Selected):  # a chosen picture is not tinted
            drawn.addPixmap(self._pixmap(self._pictures[index], state), mode)
        item.setIcon(drawn)

    def _pixmap(self, image: NDArray[np.uint8], state: str) -> QPixmap:
        ratio = self.devicePixelRatioF()
        pixmap = QPixmap(round(SIDE * ratio), round(SIDE * ratio))
        pixmap.setDevicePixelRatio(ratio)
        colours = theme.current()
        pixmap.fill(QColor(colours.border))
        painter = QPainter(pixmap)
        grey = QImage(image.data, image.shape[1], image.shape[0], image.strides[0], QImage.Format.Format_Grayscale8)
        painter.drawImage(QRectF(1, 1, SIDE - 2, SIDE - 2), grey)
        if state in SIGNS:
            name, colour = SIGNS[state]
            spot = QRectF(SIDE - 22, SIDE - 22, 20, 20)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colours.surface))
            painter.drawEllipse(spot)
            draw_icon(painter, name, spot.adjusted(2, 2, -2, -2), getattr(colours, colour))
        painter.end()
        return pixmap

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_pictures"):
            for i in range(len(self._pictures)):
                self._draw(i)
