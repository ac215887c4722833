"""Everything a calibration found: warnings, tables, residuals, coverage, correlations, object points."""

from __future__ import annotations

from collections.abc import Iterator

from PySide6.QtWidgets import QFrame, QScrollArea, QTabWidget, QVBoxLayout, QWidget

from stripe_gui.presenters.adjusted import correlations, coverage, point_sigmas
from stripe_gui.presenters.calibrate import CalibrationView
from stripe_gui.widgets.correlation_view import CorrelationView
from stripe_gui.widgets.coverage_view import CoverageView
from stripe_gui.widgets.layout import label
from stripe_gui.widgets.point_map import PointMap
from stripe_gui.widgets.residual_view import ResidualView
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.workbench import Workbench


class CalibrationResults(QWidget):
    """Tabs over one calibration; what a tab shows is computed when it comes to the front."""

    def __init__(self, bench: Workbench, *, excluding: bool = False) -> None:
        super().__init__()
        self._view: CalibrationView | None = None
        self._due: set[int] = set()
        self.made = label("", "muted", wrap=True)
        self.warnings = label("", "", wrap=True)
        self.tables: list[ResultTable] = []
        self._tables = QVBoxLayout()
        self._tables.setSpacing(20)
        self._tables.setContentsMargins(0, 12, 12, 12)
        inner = QWidget()
        inner.setLayout(self._tables)
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setWidget(inner)
        self.residuals = ResidualView(bench, excluding=excluding)
        self.coverage = CoverageView()
        self.correlations = CorrelationView()
        self.points = PointMap()
        self.tabs = QTabWidget()
        self.tabs.setAccessibleName(self.tr("Results of the calibration"))
        self.tabs.setDocumentMode(True)
        self.tabs.tabBar().setDrawBase(False)
        for name, title, widget in (
            ("tables", self.tr("Tables"), scroll),
            ("residuals", self.tr("Residuals"), self.residuals),
            ("coverage", self.tr("Coverage"), self.coverage),
            ("correlations", self.tr("Correlations"), self.correlations),
            ("points", self.tr("Object points"), self.points),
        ):
            widget.setObjectName(name)
            self.tabs.addTab(widget, title)
        self.tabs.currentChanged.connect(self._fill)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(10)
        layout.addWidget(self.made)
        layout.addWidget(self.warnings)
        layout.addWidget(self.tabs, 1)

    def show_calibration(self, view: CalibrationView) -> None:
        """Show a calibration; the same one again changes nothing."""
        before, self._view = self._view, view
        self.made.setText(view.made)
        self.made.setVisible(bool(view.made))
        self.warnings.setText("\n".join(f"⚠ {text}" for text in view.warnings))
        self.warnings.setVisible(bool(view.warnings))
        if before is not None and before.tables == view.tables and before.adjustment is view.adjustment:
            return
        self._due = set(range(self.tabs.count()))
        for i in range(1, self.tabs.count()):
            self.tabs.setTabEnabled(i, view.adjustment is not None)
        self._fill()

    def parts(self) -> Iterator[str]:
        """Bring each tab to the front, and name it."""
        for i in range(self.tabs.count()):
            if self.tabs.isTabEnabled(i):
                self.tabs.setCurrentIndex(i)
                yield f"-{self.tabs.widget(i).objectName()}"
        self.tabs.setCurrentIndex(0)

    def _fill(self) -> None:
        """Show what the tab in front has not shown yet."""
        at, view = self.tabs.currentIndex(), self._view
        if view is None or at not in self._due:
            return
        self._due.discard(at)
        adjustment = view.adjustment
        if at == 0:
            self._fill_tables(view)
        elif adjustment is None:
            return
        elif at == 1:
            self.residuals.show_residuals(view.residuals, adjustment.convergence)
        elif at == 2:
            self.coverage.show_coverage(coverage(adjustment))
        elif at == 3:
            self.correlations.show_correlations(correlations(adjustment))
        else:
            self.points.show_points(point_sigmas(adjustment))

    def _fill_tables(self, view: CalibrationView) -> None:
        while self._tables.count():
            item = self._tables.takeAt(0)
            if item.widget() is not None:
                item.widget().hide()
                item.widget().deleteLater()
        self.tables = []
        for table in view.tables:
            made = ResultTable(table.title)
            made.show_table(table)
            made.fit_height()
            self.tables.append(made)
            self._tables.addWidget(made)
        self._tables.addStretch(1)
