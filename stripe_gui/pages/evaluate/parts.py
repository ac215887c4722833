"""The bodies of the evaluate page's parts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QComboBox, QListWidget, QListWidgetItem, QWidget

from core.evaluate import line_across
from stripe_gui.pages.evaluate.choices import Choice
from stripe_gui.presenters.evaluate import (
    EvaluationView,
    distribution_text,
    plane_name,
    profile_text,
    profiles,
)
from stripe_gui.presenters.told import told
from stripe_gui.widgets.deviation_maps import DeviationMaps
from stripe_gui.widgets.histogram import Histogram
from stripe_gui.widgets.layout import button, choice, column, label, refill, row
from stripe_gui.widgets.line_tool import LineTool
from stripe_gui.widgets.plot import Curve, Plot

NAME = Qt.ItemDataRole.UserRole
UM = 1000.0
BELOW = (0, 8, 0, 0)  # the margins of a part, below the row that chooses it


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
    planes = [(plane_name(view.by_method(capture)[0]), capture) for capture in view.captures]
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
        maps = [e.deviation_mm for e in self._view.by_method(self.plane.currentData())]
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
        for i, (method, line) in enumerate(found.items()):
            known = np.isfinite(line.sigma_mm).any()
            text = self.tr("{said}, tinted: ±σ predicted") if known else "{said}"
            text = text.format(said=profile_text(method, line))
            band = line.sigma_mm * UM if known else None
            curves.append(
                Curve(text, line.length_mm, line.deviation_mm * UM, i % 2, "line" if i % 2 == 0 else "dash", band)
            )
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
            series = [(f"{e.capture}, {told(e.method)}", e.deviation_mm) for e in ordered]
            self.histogram.set_values(series, view.limit_mm)
            self.shares.setText("\n".join(distribution_text(view, capture) for capture in view.captures))
            return
        own = view.by_method(plane)
        series = [(told(e.method), e.deviation_mm) for e in own]
        normal = [(self.tr("normal, {rms:.4f} mm").format(rms=e.rms_mm), e.rms_mm) for e in own]
        self.histogram.set_values(series, 4 * max(e.rms_mm for e in own) or 1.0, 81, normal=normal)
        self.shares.setText(distribution_text(view, plane))
