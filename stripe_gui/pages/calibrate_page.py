"""Calibration: options with their consequences, the run, and its results."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFrame,
    QLabel,
    QScrollArea,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from core.errors import StripeError
from stripe_gui.pages.page import Page
from stripe_gui.presenters.calibrate import CalibrationView, calibration_view
from stripe_gui.presenters.status import State
from stripe_gui.presenters.work import CalibrateChoice, calibrate
from stripe_gui.widgets.layout import boxed, card, column, label, row
from stripe_gui.widgets.residual_view import ResidualView
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.workbench import Workbench


class CalibratePage(Page):
    """Options to the left, results to the right."""

    id = stage = "calibrate"
    action_ids = ("calibrate.wizard",)

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Calibrate"),
            self.tr("Interior and relative orientation of camera and projector, and how well they are known."),
        )
        self._view: CalibrationView | None = None
        self.run_button = self.add_button(self.tr("Calibrate"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Decode, measure and calibrate in the background (F5)."))
        self.tabs = QTabWidget()
        self.tabs.setAccessibleName(self.tr("Results of the calibration"))
        self.tabs.setDocumentMode(True)
        self.tabs.tabBar().setDrawBase(False)
        self.nothing = label("", "muted", wrap=True)
        self.warnings = label("", "", wrap=True)
        self._tables = QVBoxLayout()
        self._tables.setSpacing(20)
        self._tables.setContentsMargins(0, 12, 12, 12)
        inner = QWidget()
        inner.setLayout(self._tables)
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setWidget(inner)
        self.residuals = ResidualView(bench)
        scroll.setObjectName("tables")
        self.residuals.setObjectName("residuals")
        self.tabs.addTab(scroll, self.tr("Tables"))
        self.tabs.addTab(self.residuals, self.tr("Residuals"))
        results = boxed(column(self.nothing, self.warnings, self.tabs))
        self.body.addLayout(row(self._options(), results, spacing=20), 1)
        self.body.itemAt(0).layout().setStretch(1, 1)

    # ---------------------------------------------------------------------------------------------------------- options

    def _options(self) -> QWidget:
        frame, layout = card(self.tr("Options"))
        frame.setFixedWidth(300)
        self.method = QComboBox()
        self.method.addItem(self.tr("both, as far as captures allow"), "all")
        self.method.addItem(self.tr("photogrammetric"), "photogrammetric")
        self.method.addItem(self.tr("polynomial depth"), "polynomial")
        self.rigid = QCheckBox(self.tr("Camera and projector rigidly joined"))
        self.rigid.setChecked(True)
        self.degree = QComboBox()
        for degree in (1, 2, 3, 4, 5):
            self.degree.addItem(self.tr("polynomial of degree {n}").format(n=degree), degree)
        self.degree.addItem(self.tr("table, linear between plates"), None)
        self.degree.setCurrentIndex(2)
        self.low_pass = QDoubleSpinBox()
        self.low_pass.setRange(0.0, 20.0)
        self.low_pass.setSingleStep(0.5)
        self.low_pass.setSuffix(" px")
        self.low_pass.setSpecialValueText(self.tr("none"))
        self.low_pass.setValue(CalibrateChoice.low_pass_px)
        self.low_pass.lineEdit().setTextMargins(6, 0, 0, 0)
        choices = [
            (self.tr("Method"), self.method),
            ("", self.rigid),
            (self.tr("Depth as a function of the phase"), self.degree),
            (self.tr("Low-pass of the depth calibration"), self.low_pass),
        ]
        self._consequences: dict[QWidget, QLabel] = {}
        for name, widget in choices:
            text = label("", "muted", wrap=True)
            small = text.font()
            small.setPointSizeF(small.pointSizeF() - 0.5)
            text.setFont(small)
            self._consequences[widget] = text
            widget.setAccessibleName(name or widget.text())
            parts = [label(name)] if name else []
            layout.addLayout(column(*parts, widget, text, spacing=5))
        layout.addStretch(1)
        self.method.currentIndexChanged.connect(self._explain)
        self.rigid.toggled.connect(self._explain)
        self.degree.currentIndexChanged.connect(self._explain)
        self.low_pass.valueChanged.connect(self._explain)
        self._explain()
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        scroll.setWidget(frame)
        scroll.setFixedWidth(312)
        return scroll

    def _explain(self) -> None:
        """Say what follows from each choice."""
        method = self.method.currentData()
        photogrammetric, polynomial = method != "polynomial", method != "photogrammetric"
        self.rigid.setEnabled(photogrammetric)
        self.degree.setEnabled(polynomial)
        self.low_pass.setEnabled(polynomial)
        degree = self.degree.currentData()
        texts = {
            self.method: {
                "all": self.tr("Both can be compared at every plane. Takes as long as the two together."),
                "photogrammetric": self.tr(
                    "From the moved testfield alone. Measures anywhere, with the sigma of every point."
                ),
                "polynomial": self.tr(
                    "From the plate at known depths alone. Measures between the plate positions only."
                ),
            }[method],
            self.rigid: self.tr(
                "One relative orientation for all poses: more redundancy. The program tests whether the rig was rigid."
            )
            if self.rigid.isChecked()
            else self.tr("Every station is oriented on its own: right if the rig was moved or knocked; wider sigmas."),
            self.degree: self.tr("Passes through every plate position; their noise goes straight into the depth.")
            if degree is None
            else self.tr(
                "Needs at least {n} plate positions. A higher degree follows the optics more closely and the noise too."
            ).format(n=degree + 1),
            self.low_pass: self.tr("Every pixel keeps its own depth curve; its noise stays in the result.")
            if self.low_pass.value() == 0
            else self.tr("Neighbouring pixels are averaged: less noise, and detail finer than this is lost."),
        }
        for widget, text in texts.items():
            self._consequences[widget].setText(text)

    def choice(self) -> CalibrateChoice:
        """Give what is chosen."""
        return CalibrateChoice(
            self.method.currentData(), self.rigid.isChecked(), self.degree.currentData(), self.low_pass.value()
        )

    # ---------------------------------------------------------------------------------------------------------- running

    def run(self) -> None:
        """Calibrate in the background."""
        self.bench.run_stage("calibrate", calibrate, self.choice(), on_done=self._told)

    def can_run(self) -> bool:
        """Say whether there are captures to calibrate from."""
        folder = self.session.folder
        if folder is None:
            return False
        return any(e.role == "depth" or e.capture.seeds for e in folder.of_role("testfield", "depth") if e.capture)

    def _told(self, calibrations: dict) -> None:
        names = ", ".join(calibrations)
        self.bench.notify("success", self.tr("Calibrated: {names}.").format(names=names))

    # ---------------------------------------------------------------------------------------------------------- results

    def refresh(self) -> None:
        """Show the calibrations the project has."""
        self.run_button.setEnabled(self.can_run())
        if not self.session.is_open:
            return
        try:
            view = calibration_view(self.session.folder)
        except StripeError as error:
            self.bench.report_error(error)
            view = None
        shown = view is not None and bool(view.tables)
        status = self.session.statuses.get("calibrate")
        reason = status.reason if status else ""
        self.nothing.setText(
            self.tr("No calibration yet: {reason}.").format(reason=reason)
            if not shown
            else self.tr("This calibration is out of date: {reason}.").format(reason=reason)
        )
        self.nothing.setVisible(not shown or (status is not None and status.state is State.STALE))
        self.tabs.setVisible(shown)
        warnings = view.warnings if view else ()
        self.warnings.setVisible(bool(warnings))
        self.warnings.setText("\n".join(f"⚠ {text}" for text in warnings))
        if view is not None and (self._view is None or view.tables != self._view.tables):
            self._show(view)

    def _show(self, view: CalibrationView) -> None:
        self._view = view
        while self._tables.count():
            item = self._tables.takeAt(0)
            if item.widget() is not None:
                item.widget().hide()
                item.widget().deleteLater()
        for table in view.tables:
            made = ResultTable(table.title)
            made.show_table(table)
            made.fit_height()
            self._tables.addWidget(made)
        self._tables.addStretch(1)
        self.residuals.show_residuals(view.residuals, view.convergence)
        self.tabs.setTabEnabled(1, bool(view.residuals))
