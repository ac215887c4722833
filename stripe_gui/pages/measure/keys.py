"""The keys of the picking page's image: here they pick instead of moving the image."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QWidget

from stripe_gui.widgets.image_view import ARROWS

NUDGE_PX, FINE_PX = 1.0, 0.1
Modifier = Qt.KeyboardModifier


class ImageKeys(QObject):
    """Takes keys from the image's canvas before the canvas does.

    Parameters
    ----------
    keys : mapping
        What single keys do.
    """

    nudged = Signal(float, float)  # du, dv in px
    jumped = Signal(int, int)  # to the next dot: direction in u, v
    unsnapped = Signal()  # pick where the cross hairs are, dot or not

    def __init__(self, canvas: QWidget, keys: Mapping[int, Callable[[], object]]) -> None:
        super().__init__(canvas)
        self._keys = keys
        canvas.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent) and self._take(event):
            return True
        return super().eventFilter(watched, event)

    def _take(self, event: QKeyEvent) -> bool:
        with_ctrl = bool(event.modifiers() & Modifier.ControlModifier)
        fine = bool(event.modifiers() & (Modifier.ShiftModifier | Modifier.AltModifier))
        if event.key() in ARROWS:
            du, dv = ARROWS[Qt.Key(event.key())]
            if with_ctrl:
                self.jumped.emit(du, dv)
            else:
                step = FINE_PX if fine else NUDGE_PX
                self.nudged.emit(du * step, dv * step)
        elif event.key() == Qt.Key.Key_Space and event.modifiers() & Modifier.ShiftModifier:
            self.unsnapped.emit()
        elif event.key() in self._keys and not with_ctrl and not event.modifiers() & Modifier.AltModifier:
            self._keys[event.key()]()
        else:
            return False
        return True
