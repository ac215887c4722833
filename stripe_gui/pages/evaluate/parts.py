"""The bodies of the evaluate page's parts, and the line that is drawn over its maps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QComboBox, QListWidget, QListWidgetItem, QWidget

from core.digits import fixed
from core.evaluate import line_across
from stripe_gui.presenters.evaluate import Choice, EvaluationView, distribution_text, plane_name, profile_text, profiles
from stripe_gui.widgets.deviation_maps import DeviationMaps
from stripe_gui.widgets.image_view import ARROWS, ImageView
from stripe_gui.widgets.layout import button, choice, column, label, refill, row
from stripe_gui.widgets.plot import STYLES, Curve, Histogram, Plot

NAME = Qt.ItemDataRole.UserRole
UM = 1000.0
BELOW = (0, 8, 0, 0)  # the margins of a part, below the row that chooses it
PAPER = (255, 255, 255, 190)  # behind the numbers of the ends
REACH_PX = 12  # on the screen: so near an end the mouse takes hold of it
COLOUR = "#101010"  # dark on the light middle of the scale, in both appearances
Pair = tuple[float, float]


class LineTool(QObject):
    """The same line over all its images.

    The left button draws it anew, or moves an end it takes hold of. Keys 1 and 2 (or Space) choose an end, the arrow
    keys move it by a pixel, with Shift by ten.
    """

    changed = Signal()

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.ends: list[Pair] = [(0.0, 0.0), (1.0, 1.0)]
        self.active = 1
        self._views: list[ImageView] = []
        self._items: list[tuple[pg.PlotCurveItem, pg.ScatterPlotItem, list[pg.TextItem]]] = []
        self._dragging = False

    def attach(self, views: Sequence[ImageView]) -> None:
        self._views, self._items = list(views), []
        for view in views:
            line = pg.PlotCurveItem(pen=pg.mkPen(COLOUR, width=2))
            ends = pg.ScatterPlotItem(size=11, pen=pg.mkPen(COLOUR, width=2))
            names = [pg.TextItem(str(i), color=COLOUR, anchor=(0.5, 1.4), fill=PAPER) for i in (1, 2)]
            for item in (line, ends, *names):
                view.add_item(item)
            self._items.append((line, ends, names))
            view.canvas.installEventFilter(self)
            view.canvas.viewport().installEventFilter(self)
            view.canvas.setAccessibleDescription(
                self.tr("Keys 1 and 2 choose an end of the line, the arrow keys move it, with Shift by ten pixels.")
            )
        self._draw()

    def set_line(self, start: Pair, stop: Pair) -> None:
        self.ends = [self._inside(start), self._inside(stop)]
        self._draw()
        self.changed.emit()

    def move(self, du: float, dv: float) -> None:
        u, v = self.ends[self.active]
        ends = [*self.ends]
        ends[self.active] = (u + du, v + dv)
        self.set_line(*ends)

    def choose(self, end: int) -> None:
        self.active = end
        self._draw()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        kind = event.type()
        if kind == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            return self._key(event.key(), bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier))
        view = next((v for v in self._views if v.canvas.viewport() is watched), None)
        if view is None or not isinstance(event, QMouseEvent):
            return False
        if kind == QEvent.Type.MouseButtonPress and event.button() == Qt.MouseButton.LeftButton:
            view.canvas.setFocus()
            self._press(view, event)
            return True
        if kind == QEvent.Type.MouseMove and self._dragging:
            ends = [*self.ends]
            ends[self.active] = view.canvas.position(event)
            self.set_line(*ends)
            return True
        if kind == QEvent.Type.MouseButtonRelease and self._dragging:
            self._dragging = False
            return True
        return False

    def _press(self, view: ImageView, event: QMouseEvent) -> None:
        at = view.canvas.position(event)
        self._dragging = True
        for i, end in enumerate(self.ends):
            place = view.canvas.mapFromScene(view.canvas.box.mapViewToScene(QPointF(*end)))
            if (event.position() - QPointF(place)).manhattanLength() <= REACH_PX:
                self.choose(i)
                return
        self.active = 1
        self.set_line(at, at)

    def _key(self, key: int, shift: bool) -> bool:
        if key in ARROWS:
            step, (du, dv) = 10 if shift else 1, ARROWS[Qt.Key(key)]
            self.move(step * du, step * dv)
        elif key in (Qt.Key.Key_1, Qt.Key.Key_2):
            self.choose(0 if key == Qt.Key.Key_1 else 1)
        elif key == Qt.Key.Key_Space:
            self.choose(1 - self.active)
        else:
            return False
        return True

    def _inside(self, at: Pair) -> Pair:
        if not self._views or self._views[0].image is None:
            return at
        height, width = self._views[0].image.shape
        return min(max(at[0], 0.0), width - 1.0), min(max(at[1], 0.0), height - 1.0)

    def _draw(self) -> None:
        u, v = np.array(self.ends).T
        fills = [pg.mkBrush("#ffffff" if i != self.active else "#ffd23f") for i in (0, 1)]
        for line, ends, names in self._items:
            line.setData(u, v)
            ends.setData(u, v, brush=fills)
            for name, end in zip(names, self.ends, strict=True):
                name.setPos(*end)


class CheckList(QListWidget):
    """Things to tick, each with a line that says where it stands; Space ticks."""

    ticked = Signal()

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.setMinimumSize(200, 110)
        self.itemChanged.connect(lambda _: self.ticked.emit())

    def show_choices(self, choices: Sequence[Choice]) -> None:
        """List the choices; what was unticked stays so, anything new is ticked."""
        unticked = {self.item(i).data(NAME) for i in range(self.count())} - set(self.chosen())
        at = max(self.currentRow(), 0)
        self.blockSignals(True)
        self.clear()
        for offered in choices:
            item = QListWidgetItem(f"{offered.title}\n{offered.state}")
            item.setData(NAME, offered.name)
            item.setToolTip(offered.state)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            item.setCheckState(Qt.CheckState.Unchecked if offered.name in unticked else Qt.CheckState.Checked)
            self.addItem(item)
        self.setCurrentRow(min(at, self.count() - 1))
        self.blockSignals(False)

    def chosen(self) -> list[str]:
        items = (self.item(i) for i in range(self.count()))
        return [item.data(NAME) for item in items if item.checkState() == Qt.CheckState.Checked]


def _offer(box: QComboBox, view: EvaluationView, *more: tuple[str, str]) -> None:
    """Offer the planes of an evaluation; the one chosen stays."""
    planes = [(plane_name(view.of(capture)[0]), capture) for capture in view.captures]
    refill(box, [*planes, *more], box.currentData())


class ProfilePart(QWidget):
    """One plane's maps with a line over them, and the deviations along it."""

    line_changed = Signal(object)  # its ends

    def __init__(self) -> None:
        super().__init__()
        self._view: EvaluationView | None = None
        self.plane = choice(self.tr("Plane"), self._show_plane, minimumWidth=180)
        hint = self.tr("Draw a line with the mouse; keys 1, 2 and the arrows move its ends.")
        self.maps = DeviationMaps(beside=True, hint=hint)
        self.tool = LineTool(self)
        self.tool.changed.connect(self._read)
        presets = [
            (self.tr("Horizontal"), ((0.05, 0.5), (0.95, 0.5))),
            (self.tr("Vertical"), ((0.5, 0.05), (0.5, 0.95))),
            (self.tr("Diagonal"), ((0.1, 0.9), (0.9, 0.1))),
        ]
        self.presets = [button(text, partial(self._preset, *ends), flat=True) for text, ends in presets]
        self.plot = Plot(self.tr("Deviations along the line"), self.tr("length [mm]"), self.tr("deviation [µm]"))
        self.ends = label(" ", "muted")
        self.maps.controls.hide()  # the scale is that of the maps before
        self.maps.foot.addWidget(self.ends)
        top = row(label(self.tr("Plane")), self.plane, *self.presets, None)
        self.setLayout(column(top, (self.maps, 5), (self.plot, 3), spacing=8, margins=BELOW))

    @property
    def line(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The line's ends, px."""
        return self.tool.ends[0], self.tool.ends[1]

    def show_view(self, view: EvaluationView) -> None:
        """Show an evaluation; the line stays, or runs across the middle at first."""
        first = self._view is None
        self._view = view
        _offer(self.plane, view)
        self._show_plane()
        if first:
            self._preset((0.05, 0.5), (0.95, 0.5))

    def _show_plane(self) -> None:
        if self._view is None or self.plane.currentData() is None:
            return
        self.maps.show_view(self._view, [self.plane.currentData()])
        self.tool.attach(self.maps.maps)
        self._read()

    def _preset(self, start: tuple[float, float], stop: tuple[float, float]) -> None:
        """Put the line at shares of the area that has deviations."""
        if self._view is None:
            return
        maps = [e.deviation_mm for e in self._view.of(self.plane.currentData())]
        if any(np.isfinite(m).any() for m in maps):
            self.tool.set_line(*line_across(maps, start, stop))

    def _read(self) -> None:
        """Read the profile along the line and plot it."""
        (u0, v0), (u1, v1) = self.line
        if self._view is None or np.hypot(u1 - u0, v1 - v0) < 1:
            return
        self.line_changed.emit(self.line)
        found = profiles(self._view, self.plane.currentData(), *self.line)
        curves, reach, longest = [], 1.0, 1.0
        for i, (name, line) in enumerate(found.items()):
            known = np.isfinite(line.sigma_mm).any()
            text = self.tr("{said}, tinted: ±σ predicted") if known else "{said}"
            text = text.format(said=profile_text(name, line))
            band = line.sigma_mm * UM if known else None
            style = list(STYLES)[i % len(STYLES)]
            curves.append(Curve(text, line.length_mm, line.deviation_mm * UM, i % 2, style, band))
            finite = np.abs(line.deviation_mm[np.isfinite(line.deviation_mm)]) * UM
            reach = max(reach, float(finite.max())) if len(finite) else reach
            longest = max(longest, float(line.length_mm[-1]))
        ends = self.tr("{a:.0f}, {b:.0f} to {c:.0f}, {d:.0f} px").format(a=u0, b=v0, c=u1, d=v1)
        self.ends.setText(ends)
        said = "; ".join([ends, *(curve.name for curve in curves)])
        self.plot.set_curves(curves, (0.0, longest), (-1.1 * reach, 1.1 * reach), said)


class HistogramPart(QWidget):
    """The distribution of a plane's deviations against the normal one."""

    def __init__(self) -> None:
        super().__init__()
        self._view: EvaluationView | None = None
        self.plane = choice(self.tr("Plane of the histogram"), self._show_plane, minimumWidth=180)
        self.histogram = Histogram(self.tr("Histogram of the deviations"), "mm")
        self.shares = label(" ", "muted", wrap=True)
        top = row(label(self.tr("Plane")), self.plane, None)
        self.setLayout(column(top, (self.histogram, 1), self.shares, margins=BELOW))

    def show_view(self, view: EvaluationView) -> None:
        self._view = view
        _offer(self.plane, view, (self.tr("all planes"), ""))
        self._show_plane()

    def _show_plane(self) -> None:
        view, plane = self._view, self.plane.currentData()
        if view is None or plane is None:
            return
        if not plane:
            ordered = sorted(view.evaluations, key=lambda e: view.captures.index(e.capture))
            series = [(f"{e.capture}, {view.name(e)}", e.deviation_mm) for e in ordered]
            self.histogram.set_values(series, view.limit_mm)
            self.shares.setText("\n".join(distribution_text(view, capture) for capture in view.captures))
            return
        own = view.of(plane)
        series = [(view.name(e), e.deviation_mm) for e in own]
        normal = [(self.tr("normal, {rms} mm").format(rms=fixed(e.rms_mm, 4)), e.rms_mm) for e in own]
        self.histogram.set_values(series, 4 * max(e.rms_mm for e in own) or 1.0, 81, normal=normal)
        self.shares.setText(distribution_text(view, plane))
