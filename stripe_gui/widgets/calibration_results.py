"""Everything a calibration found: warnings, tables, residuals, coverage, correlations, object points."""

from __future__ import annotations

from math import ceil

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QGridLayout, QWidget

from core.report.adjusted import Coverage, correlations, coverage, point_sigmas
from stripe_gui import theme
from stripe_gui.presenters.calibrate import CalibrationView
from stripe_gui.presenters.folder import version
from stripe_gui.presenters.maps import round_up
from stripe_gui.presenters.status import device_name
from stripe_gui.presenters.told import sentence
from stripe_gui.presenters.volumes import uncertainty_view
from stripe_gui.widgets.correlation_view import CorrelationView
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, card, column, emptied, label, row, scrolled, tabbed
from stripe_gui.widgets.point_map import PointMap
from stripe_gui.widgets.residual_view import ResidualView
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.widgets.studies import CrossValidation, NextPose
from stripe_gui.widgets.verdict import VerdictList
from stripe_gui.widgets.volume_maps import VolumeMaps
from stripe_gui.workbench import Workbench

ABREAST = 3  # maps that have room side by side


class CoverageView(QWidget):
    """One map of counts per device, side by side."""

    def __init__(self) -> None:
        super().__init__()
        self.maps: list[ImageView] = []
        self._maps = QGridLayout()
        self._maps.setSpacing(16)
        note = self.tr(
            "Points of all stations per cell of the image. Where there are none the additional parameters are "
            "extrapolated: fill edges and corners."
        )
        maps = scrolled(boxed(self._maps), across=False)  # low windows have room for one row
        self.setLayout(column((maps, 1), label(note, "muted", wrap=True), spacing=8, margins=(0, 12, 0, 0)))

    def show_coverage(self, devices: tuple[Coverage, ...]) -> None:
        emptied(self._maps)
        self.maps = []
        across = ceil(len(devices) / ceil(len(devices) / ABREAST)) if devices else 1  # rows of about equal length
        for k, device in enumerate(devices):
            view = ImageView(self.tr("Coverage of {name}").format(name=device_name(device.name)))
            self._fill(view, device)
            self.maps.append(view)
            text = self.tr("{n} points; hull {h:.0%} of the image; {c:.0%} of the cells hold points")
            said = text.format(n=len(device.uv), h=device.hull_share, c=device.filled)
            words = label(said, "muted", wrap=True)
            words.setMinimumHeight(2 * words.fontMetrics().lineSpacing())
            view.canvas.setAccessibleDescription(said)
            whole = boxed(column(label(device_name(device.name), "heading"), view, words, spacing=6))
            self._maps.addWidget(whole, k // across, k % across)

    def _fill(self, view: ImageView, device: Coverage) -> None:
        image = device.map().astype(np.float32)
        image[image == 0] = np.nan  # an empty cell stays empty
        view.set_image(image, (0.0, round_up(float(device.counts.max(initial=1)))), scale="map")
        edge = pg.PlotCurveItem(device.hull[:, 0], device.hull[:, 1], pen=pg.mkPen("#ffffff", width=2))
        around = pg.PlotCurveItem(device.hull[:, 0], device.hull[:, 1], pen=pg.mkPen(theme.LIGHT.text, width=4))
        points = pg.ScatterPlotItem(
            x=device.uv[:, 0], y=device.uv[:, 1], pxMode=True, size=2, pen=None, brush=pg.mkBrush("#ffffffa0")
        )
        for item in (points, around, edge):
            view.add_item(item)


class CalibrationResults(QWidget):
    """Tabs over one calibration; what a tab shows is computed when it comes to the front."""

    def __init__(self, bench: Workbench) -> None:
        super().__init__()
        self._bench = bench
        self._view: CalibrationView | None = None
        self._due: set[int] = set()
        self.made = label("", "muted", wrap=True)
        self.verdicts = VerdictList()
        self.warned = label("", wrap=True)
        self.tables: list[ResultTable] = []
        self._tables = column(spacing=20, margins=(0, 12, 12, 12))
        self._warnings = column(spacing=10, margins=(0, 12, 12, 12))
        self.residuals = ResidualView(bench)
        self.coverage = CoverageView()
        self.correlations = CorrelationView()
        self.points = PointMap()
        self.volume = VolumeMaps(bench, self.tr("Uncertainty over the working volume"))
        self.studies = NextPose(bench), CrossValidation(bench)
        self.tabs = tabbed(
            ("tables", self.tr("Tables"), scrolled(boxed(self._tables))),
            ("residuals", self.tr("Residuals"), self.residuals),
            ("coverage", self.tr("Coverage"), self.coverage),
            ("correlations", self.tr("Correlations"), self.correlations),
            ("points", self.tr("Object points"), self.points),
            ("volume", self.tr("Working volume"), self.volume),
            ("captures", self.tr("Captures"), scrolled(boxed(column(*self.studies, None, margins=(0, 12, 12, 12))))),
            ("warnings", self.tr("Warnings"), scrolled(boxed(self._warnings))),
            accessibleName=self.tr("Results of the calibration"),
        )
        self.tabs.tabBar().setDrawBase(False)
        self.tabs.currentChanged.connect(self._fill)
        self.setLayout(column(self.verdicts, row((self.made, 1), (self.warned, 1)), (self.tabs, 1), spacing=10))

    def show_calibration(self, view: CalibrationView) -> None:
        """Show a calibration; the same one again changes nothing."""
        before, self._view = self._view, view
        self.made.setText(view.made)
        self.made.setVisible(bool(view.made))
        self.verdicts.show_verdicts(view.verdicts)
        self._tell_warnings(view.warnings)
        for study in self.studies:
            study.refresh()
        if before is not None and before.tables == view.tables and before.adjustment is view.adjustment:
            self._fill()  # of another pair, perhaps
            return
        self._due = set(range(self.tabs.count()))
        for i in range(1, self.tabs.count() - 1):
            self.tabs.setTabEnabled(i, view.adjustment is not None)
        self._fill()

    def _fill(self) -> None:
        """Show what the tab in front has not shown yet."""
        at, view = self.tabs.currentIndex(), self._view
        if view is not None and self.tabs.currentWidget() is self.volume:
            self._look_at_volume()
        if view is None or at not in self._due:
            return
        self._due.discard(at)
        adjustment = view.adjustment
        if at == 0:
            self._fill_tables(view)
        elif adjustment is None:
            return
        elif at == 1:
            self.residuals.show_residuals(view.residuals)
        elif at == 2:
            self.coverage.show_coverage(coverage(adjustment))
        elif at == 3:
            self.correlations.show_correlations(correlations(adjustment))
        elif at == 4:
            self.points.show_points(point_sigmas(adjustment))

    def _look_at_volume(self) -> None:
        """Show what the pair that was chosen knows of the working volume."""
        session = self._bench.session
        folder, pair = session.opened, session.pair_names
        file = folder.result_file("photogrammetric.npz")
        self.volume.look((file, version(file), pair), uncertainty_view, folder.project, *pair)

    def _tell_warnings(self, warnings: tuple[str, ...]) -> None:
        """Say how many warnings there are above the tabs, and each in full on its own tab."""
        count = len(warnings)
        self.tabs.setTabText(
            self.tabs.count() - 1, self.tr("Warnings ({n})").format(n=count) if count else self.tr("Warnings")
        )
        many = self.tr("⚠ {n} warnings: what is weak and what to photograph next, see Warnings.")
        one = self.tr("⚠ One warning, see Warnings.")
        self.warned.setText(many.format(n=count) if count > 1 else one)
        self.warned.setVisible(count > 0)
        emptied(self._warnings)
        for text in warnings:
            self._warnings.addWidget(card(label(f"⚠ {sentence(text)}.", wrap=True)))
        if not warnings:
            self._warnings.addWidget(label(self.tr("Nothing speaks against this calibration."), "muted"))
        self._warnings.addStretch(1)

    def _fill_tables(self, view: CalibrationView) -> None:
        emptied(self._tables)
        self.tables = []
        for table in view.tables:
            made = ResultTable(table.title)
            made.show_table(table)
            made.fit_height()
            self.tables.append(made)
            self._tables.addWidget(made)
        if view.adjustment is not None:
            steps = " → ".join(f"{value:.6g}" for value in view.adjustment.convergence)
            text = self.tr("Convergence, weighted sum of squares: {steps}")
            self._tables.addWidget(label(text.format(steps=steps), "muted", wrap=True))
        self._tables.addStretch(1)
