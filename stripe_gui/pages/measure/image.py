"""The middle of the picking page: the image with its marks, cross hairs and keys, and what is said about them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent, QPainterPath
from PySide6.QtWidgets import QWidget

from core.model import DeviceSpec
from stripe_gui import theme
from stripe_gui.pages.measure.view import Marks
from stripe_gui.presenters.capture import FrameView
from stripe_gui.widgets.image_view import ARROWS, ImageView
from stripe_gui.widgets.layout import button, column, label, row

REACH_PX = 12  # on the screen: how far beside a dot a click may be
NUDGE_PX, FINE_PX = 1.0, 0.1
Modifier = Qt.KeyboardModifier


@cache
def cross(free: float) -> QPainterPath:
    """Four strokes to the middle, which they leave free by a part of their length."""
    path = QPainterPath()
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        path.moveTo(free * x, free * y)
        path.lineTo(0.5 * x, 0.5 * y)
    return path


class MarksOverlay:
    """Picks with their numbers, grid, centroids with residuals, missing and excluded targets, and the cross hairs."""

    def __init__(self, view: ImageView) -> None:
        self._view = view
        ink = theme.DARK  # on the picture itself, which is the same in light and dark
        self.grid = pg.ScatterPlotItem(pxMode=False, symbol="o", pen=pg.mkPen(ink.mark, width=1.5), brush=None)
        self.residuals = pg.PlotCurveItem(pen=pg.mkPen(ink.mark_other, width=1.5))
        self.measured = pg.ScatterPlotItem(size=10, symbol=cross(0.0), pen=pg.mkPen(ink.mark, width=1.5), brush=None)
        self.missing = pg.ScatterPlotItem(size=12, symbol="d", pen=pg.mkPen(ink.warning, width=1.5), brush=None)
        self.excluded = pg.ScatterPlotItem(size=12, symbol="x", pen=pg.mkPen(ink.danger, width=1), brush=ink.danger)
        self.picks = pg.ScatterPlotItem(size=20, symbol="s", brush=None)
        self.chosen = pg.ScatterPlotItem(size=30, symbol="o", pen=pg.mkPen("#ffffff", width=1.5), brush=None)
        self.cursor = pg.ScatterPlotItem(
            size=44, symbol=cross(0.18), pen=pg.mkPen(ink.mark_other, width=1.5), brush=None
        )
        self._labels: list[pg.TextItem] = []
        for item in (
            self.grid,
            self.residuals,
            self.measured,
            self.missing,
            self.excluded,
            self.picks,
            self.chosen,
            self.cursor,
        ):
            view.add_item(item)

    def show(self, marks: Marks) -> None:
        inside = np.isfinite(marks.grid).all(axis=1)
        self.grid.setData(x=marks.grid[inside, 0], y=marks.grid[inside, 1], size=1.25 * marks.grid_px[inside])
        for item, points in (
            (self.measured, marks.measured),
            (self.missing, marks.missing),
            (self.excluded, marks.excluded),
            (self.picks, marks.picks),
        ):
            item.setData(x=points[:, 0], y=points[:, 1])
        ends = np.stack([marks.measured, marks.measured + marks.factor * marks.residual], axis=1).reshape(-1, 2)
        self.residuals.setData(ends[:, 0], ends[:, 1], connect="pairs")
        style = pg.QtCore.Qt.PenStyle.DotLine if marks.guessed else pg.QtCore.Qt.PenStyle.SolidLine
        self.picks.setPen(pg.mkPen(theme.DARK.ok, width=2, style=style))
        self._number(marks)

    def show_cursor(self, at: tuple[float, float]) -> None:
        self.cursor.setData([at[0]], [at[1]])

    def show_chosen(self, at: tuple[float, float] | None) -> None:
        self.chosen.setData([at[0]] if at else [], [at[1]] if at else [])

    def _number(self, marks: Marks) -> None:
        while len(self._labels) < len(marks.labels):
            made = pg.TextItem(color=theme.DARK.ok, anchor=(-0.7, 1.1))
            self._labels.append(made)
            self._view.add_item(made)
        for i, item in enumerate(self._labels):
            item.setVisible(i < len(marks.labels))
            if i < len(marks.labels):
                item.setText(marks.labels[i])
                item.setPos(*marks.picks[i])


class ImagePanel(QWidget):
    """The image; `cursor` is where the cross hairs are, px."""

    looked_at = Signal(float, float)  # where the loupe should look

    def __init__(self, exclude: Callable[[], object]) -> None:
        super().__init__()
        self.view = ImageView(self.tr("Image with its targets"), bar=False)
        self.view.canvas.setAccessibleDescription(
            self.tr(
                "1 to 4 and Tab choose a target, arrows move the cross hairs, Space picks, Enter does the next step, "
                "F6 goes to the map and the lists."
            )
        )
        self.marks = MarksOverlay(self.view)
        self.frame: FrameView | None = None
        self.cursor_at = (0.0, 0.0)
        self.name = label(" ", "heading")
        self.ask = label(" ", wrap=True)
        self.legend = label(" ", "muted", wrap=True)
        said = self.tr(
            "Arrows: 1 px, Shift 0.1 px, Ctrl next dot · Space: pick · 1–4, Tab: target · X: exclude · "
            "Page Up, Down: image · F6: map and lists"
        )
        keys = label(said, "muted", wrap=True)
        self.exclude_button = button(self.tr("Exclude (X)"), exclude, "close", flat=True)
        fit = button(self.tr("Whole image"), self.view.fit, "fit", flat=True)
        top = row(self.name, None, self.exclude_button, fit)
        self.setLayout(column(top, self.ask, (self.view, 1), self.legend, keys, spacing=6))
        self.view.hovered.connect(self.looked_at)
        self.view.canvas.left.connect(lambda: self.looked_at.emit(*self.cursor_at))

    def show_frame(self, frame: FrameView | None) -> None:
        """Show an image; the zoom stays."""
        if frame is not self.frame:
            self.frame = frame
            self.view.set_image(frame.image if frame else None, (0.0, frame.bright if frame else 1.0))
            self.looked_at.emit(*self.cursor_at)

    def show_excluded(self, excluded: bool, possible: bool) -> None:
        """Say what the button would do with the target at work."""
        self.exclude_button.setText(" " + (self.tr("Restore (X)") if excluded else self.tr("Exclude (X)")))
        self.exclude_button.setEnabled(possible)

    @property
    def reach_px(self) -> float:
        """How far beside a dot a pick may be, px of the image."""
        return max(REACH_PX * float(self.view.canvas.box.viewPixelSize()[0]), 4.0)

    @property
    def middle(self) -> tuple[float, float]:
        """The middle of what is seen, px."""
        (x0, x1), (y0, y1) = self.view.canvas.box.viewRange()
        return (x0 + x1) / 2, (y0 + y1) / 2

    def ahead(self, du: int, dv: int) -> tuple[float, float]:
        """Give the place a tenth of the view further in a direction, px."""
        (x0, x1), (y0, y1) = self.view.canvas.box.viewRange()
        return self.cursor_at[0] + du * (x1 - x0) / 10, self.cursor_at[1] + dv * (y1 - y0) / 10

    def set_cursor(self, u: float, v: float, camera: DeviceSpec, *, follow: bool = False) -> None:
        """Move the cross hairs; `follow` brings them into view where they would leave it."""
        u, v = min(max(u, 0.0), camera.width - 1.0), min(max(v, 0.0), camera.height - 1.0)
        self.cursor_at = (u, v)
        self.marks.show_cursor(self.cursor_at)
        self.looked_at.emit(u, v)
        (x0, x1), (y0, y1) = self.view.canvas.box.viewRange()
        if follow and not (x0 <= u <= x1 and y0 <= v <= y1):
            self.view.centre_on(u, v)


class ImageKeys(QObject):
    """Takes keys from the image's canvas before the canvas does."""

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
