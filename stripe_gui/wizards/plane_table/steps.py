"""The bodies of the plane-table wizard's steps."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QWidget,
)

from core.evaluate import line_across
from core.report import SignOff, Tolerance, verdict
from stripe_gui.presenters.evaluate import (
    EvaluationView,
    distribution_text,
    plane_name,
    profile_text,
    profiles,
)
from stripe_gui.presenters.status import method_name
from stripe_gui.widgets.deviation_maps import DeviationMaps
from stripe_gui.widgets.histogram import Histogram
from stripe_gui.widgets.layout import SPACE, boxed, button, card, column, label, row
from stripe_gui.widgets.line_tool import LineTool
from stripe_gui.widgets.plot import Curve, Plot
from stripe_gui.wizards.plane_table.model import UM, Choice, Wishes

NAME = Qt.ItemDataRole.UserRole


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
        for choice in choices:
            item = QListWidgetItem(f"{choice.title}\n{choice.state}")
            item.setData(NAME, choice.name)
            item.setToolTip(choice.state)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            item.setCheckState(Qt.CheckState.Unchecked if choice.name in unticked else Qt.CheckState.Checked)
            self.addItem(item)
        self.setCurrentRow(min(at, self.count() - 1))
        self.blockSignals(False)

    def chosen(self) -> list[str]:
        """Give the names of what is ticked."""
        items = (self.item(i) for i in range(self.count()))
        return [item.data(NAME) for item in items if item.checkState() == Qt.CheckState.Checked]


class PlaneChoice(QComboBox):
    """Chooses one of the planes evaluated."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setMinimumWidth(180)

    def show_view(self, view: EvaluationView) -> None:
        """Offer the planes of an evaluation; the one chosen stays."""
        before = self.currentData()
        self.blockSignals(True)
        self.clear()
        for capture in view.captures:
            self.addItem(plane_name(view.by_method(capture)[0]), capture)
        self.setCurrentIndex(max(self.findData(before), 0))
        self.blockSignals(False)


class ProfileStep(QWidget):
    """One plane's maps with a line over them, and the deviations along it."""

    def __init__(self) -> None:
        super().__init__()
        self._view: EvaluationView | None = None
        self.plane = PlaneChoice(self.tr("Plane"))
        self.plane.currentIndexChanged.connect(self._show_plane)
        hint = self.tr("Draw a line with the mouse; keys 1, 2 and the arrows move its ends.")
        self.maps = DeviationMaps(beside=True, hint=hint)
        self.tool = LineTool(self)
        self.tool.changed.connect(self._read)
        presets = [
            (self.tr("Horizontal"), ((0.05, 0.5), (0.95, 0.5))),
            (self.tr("Vertical"), ((0.5, 0.05), (0.5, 0.95))),
            (self.tr("Diagonal"), ((0.1, 0.9), (0.9, 0.1))),
        ]
        self.presets = [button(text, lambda ends=ends: self._preset(*ends), flat=True) for text, ends in presets]
        self.plot = Plot(self.tr("Deviations along the line"), self.tr("length [mm]"), self.tr("deviation [µm]"))
        self.ends = label(" ", "muted")
        self.maps.controls.hide()  # the scale is that of the maps before
        self.maps.foot.addWidget(self.ends)
        layout = column(row(label(self.tr("Plane")), self.plane, *self.presets, None), self.maps, self.plot, spacing=8)
        layout.setStretch(1, 5)
        layout.setStretch(2, 3)
        layout.setContentsMargins(0, 8, 0, 0)
        self.setLayout(layout)

    @property
    def line(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The line's ends, px."""
        return self.tool.ends[0], self.tool.ends[1]

    def show_view(self, view: EvaluationView) -> None:
        """Show an evaluation; the line stays, or runs across the middle at first."""
        first = self._view is None
        self._view = view
        self.plane.show_view(view)
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


class HistogramStep(QWidget):
    """The distribution of a plane's deviations against the normal one."""

    def __init__(self) -> None:
        super().__init__()
        self._view: EvaluationView | None = None
        self.plane = PlaneChoice(self.tr("Plane of the histogram"))
        self.plane.currentIndexChanged.connect(self._show_plane)
        self.histogram = Histogram(self.tr("Histogram of the deviations"), "mm")
        self.shares = label(" ", "muted", wrap=True)
        layout = column(row(label(self.tr("Plane")), self.plane, None))
        layout.addWidget(self.histogram, 1)
        layout.addWidget(self.shares)
        layout.setContentsMargins(0, 8, 0, 0)
        self.setLayout(layout)

    def show_view(self, view: EvaluationView) -> None:
        """Show an evaluation."""
        self._view = view
        self.plane.show_view(view)
        self._show_plane()

    def _show_plane(self) -> None:
        if self._view is None or self.plane.currentData() is None:
            return
        own = self._view.by_method(self.plane.currentData())
        series = [(method_name(e.method), e.deviation_mm) for e in own]
        normal = [(self.tr("normal, {rms:.4f} mm").format(rms=e.rms_mm), e.rms_mm) for e in own]
        self.histogram.set_values(series, 4 * max(e.rms_mm for e in own) or 1.0, 81, normal=normal)
        self.shares.setText(distribution_text(self._view, self.plane.currentData()))


class SignOffStep(QWidget):
    """Who signs, against which tolerance, and which files to export."""

    changed = Signal()
    export_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._view: EvaluationView | None = None
        self.operator, self.instrument, self.date, self.remark = (QLineEdit() for _ in range(4))
        self.with_tolerance = QCheckBox(self.tr("Judge against a tolerance"))
        self.limit = QDoubleSpinBox()
        self.limit.setDecimals(4)
        self.limit.setRange(0.001, 100.0)
        self.limit.setSingleStep(0.005)
        self.limit.setValue(0.05)
        self.limit.setSuffix(" mm")
        self.limit.setAccessibleName(self.tr("Tolerance"))
        self.of = QComboBox()
        self.of.setAccessibleName(self.tr("Figure that the tolerance limits"))
        self.of.addItem(self.tr("r.m.s. deviation"), "rms")
        self.of.addItem(self.tr("largest deviation"), "max")
        self.verdict = label(" ", wrap=True)
        self.verdict.setAccessibleName(self.tr("Result"))
        self.report, self.table, self.profiles, self.deviations = (
            QCheckBox(text)
            for text in (
                self.tr("Report: HTML and PDF"),
                self.tr("Table 3 as CSV"),
                self.tr("Profiles along the line as CSV"),
                self.tr("Deviations of every pixel as CSV"),
            )
        )
        for box in (self.report, self.table, self.profiles):
            box.setChecked(True)
        self.export_button = button(self.tr("Export…"), self.export_wanted.emit, "export")
        self.export_button.setToolTip(self.tr("Choose a folder for these files."))
        self._lay_out()
        for field in (self.operator, self.instrument, self.date, self.remark):
            field.textChanged.connect(self._judge)
        self.with_tolerance.toggled.connect(self._judge)
        self.limit.valueChanged.connect(self._judge)
        self.of.currentIndexChanged.connect(self._judge)

    def _lay_out(self) -> None:
        signing, layout = card(self.tr("Sign-off"))
        form = QFormLayout()
        form.setLabelAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        form.setHorizontalSpacing(SPACE)
        fields = (
            (self.tr("Operator"), self.operator),
            (self.tr("Instrument"), self.instrument),
            (self.tr("Date"), self.date),
            (self.tr("Remark"), self.remark),
        )
        for text, field in fields:
            field.setAccessibleName(text)
            form.addRow(label(text), field)
        self.operator.setPlaceholderText(self.tr("without a name the report is not signed"))
        layout.addLayout(form)
        layout.addWidget(self.with_tolerance)
        layout.addLayout(row(self.limit, self.of, None))
        layout.addWidget(self.verdict)
        layout.addStretch(1)
        files, layout = card(self.tr("Files"))
        for box in (self.report, self.table, self.profiles, self.deviations):
            layout.addWidget(box)
        layout.addLayout(row(self.export_button, None))
        layout.addStretch(1)
        files.setMaximumWidth(330)
        outer = row(signing, files)
        outer.setContentsMargins(0, 8, 0, 0)
        self.setLayout(outer)

    def show_view(self, view: EvaluationView) -> None:
        """Judge an evaluation."""
        self._view = view
        self._judge()

    def fill(self, sign_off: SignOff | None, instrument: str) -> None:
        """Show the sign-off there is, or the instrument typed last time with today's date."""
        today = f"{date.today():%Y-%m-%d}"
        shown = sign_off or SignOff("", instrument, date=today)
        self.operator.setText(shown.operator)
        self.instrument.setText(shown.instrument)
        self.date.setText(shown.date)
        self.remark.setText(shown.remark)
        self.with_tolerance.setChecked(shown.tolerance is not None)
        if shown.tolerance is not None:
            self.limit.setValue(shown.tolerance.limit_mm)
            self.of.setCurrentIndex(self.of.findData(shown.tolerance.of))
        self._judge()

    def sign_off(self) -> SignOff | None:
        """Give what was typed; None without a name."""
        name = self.operator.text().strip()
        if not name:
            return None
        return SignOff(
            operator=name,
            instrument=self.instrument.text().strip(),
            remark=self.remark.text().strip(),
            date=self.date.text().strip(),
            tolerance=self.tolerance(),
            despite=self.remark.text().strip(),  # where a verdict failed, the remark must say why it is signed
        )

    def tolerance(self) -> Tolerance | None:
        """Give the tolerance, if there is to be one."""
        return Tolerance(self.limit.value(), self.of.currentData()) if self.with_tolerance.isChecked() else None

    def wishes(self) -> Wishes:
        """Give the files wanted."""
        boxes = (self.report, self.table, self.profiles, self.deviations)
        return Wishes(*(box.isChecked() for box in boxes))

    def _judge(self) -> None:
        wanted = self.with_tolerance.isChecked()
        self.limit.setEnabled(wanted)
        self.of.setEnabled(wanted)
        tolerance = self.tolerance()
        if tolerance is None or self._view is None:
            self.verdict.setText(" ")
        else:
            found = verdict(self._view.evaluations, tolerance)
            self.verdict.setText(f"{'✓' if found.passed else '✗'} {found.text}")
        self.changed.emit()


def choose_body(planes: CheckList, calibrations: CheckList, state: QWidget, work: QWidget) -> QWidget:
    """Lay out the step that chooses."""
    lists = row(
        boxed(column(label(planes.accessibleName(), "heading"), planes, spacing=8)),
        boxed(column(label(calibrations.accessibleName(), "heading"), calibrations, spacing=8)),
        spacing=20,
    )
    below = row(state, work)
    below.setStretchFactor(state, 1)
    layout = column(lists, below)
    layout.setContentsMargins(0, 8, 0, 0)
    body = QWidget()
    body.setLayout(layout)
    return body
