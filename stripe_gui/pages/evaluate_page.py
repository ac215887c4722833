"""The plane-table: signed deviation maps on one scale, histograms, Table 3."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QTabWidget

from stripe_gui.pages.page import Page
from stripe_gui.presenters.evaluate import EvaluationView, load_evaluation
from stripe_gui.presenters.status import State, method_name
from stripe_gui.presenters.work import evaluate
from stripe_gui.widgets.deviation_maps import DeviationMaps
from stripe_gui.widgets.histogram import Histogram
from stripe_gui.widgets.layout import boxed, column, label
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.workbench import Workbench


class EvaluatePage(Page):
    """Maps, histograms and Table 3 of the evaluation the project has."""

    id = stage = "evaluate"
    action_ids = ("evaluate.wizard",)

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Evaluate"),
            self.tr("How far the points of the plane-table lie from the plane fitted to them."),
        )
        self._view: EvaluationView | None = None
        self.run_button = self.add_button(self.tr("Evaluate"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Judge every plane capture by every calibration (F5)."))
        self.nothing = label("", "muted", wrap=True)
        self.nothing.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.tabs = QTabWidget()
        self.tabs.setAccessibleName(self.tr("Results of the evaluation"))
        self.tabs.setDocumentMode(True)
        self.tabs.tabBar().setDrawBase(False)
        self.deviations = DeviationMaps()
        maps = boxed(column(self.deviations))
        maps.layout().setContentsMargins(0, 12, 0, 0)
        self.histogram = Histogram(self.tr("Histograms of the deviations"), "mm")
        histograms = boxed(column(self.histogram))
        histograms.layout().setContentsMargins(0, 12, 0, 0)
        self.table = ResultTable(self.tr("Deviations from the plane-table"))
        table = boxed(column(self.table))
        table.layout().setContentsMargins(0, 12, 0, 0)
        maps.setObjectName("maps")
        histograms.setObjectName("histograms")
        table.setObjectName("table")
        self.tabs.addTab(maps, self.tr("Maps"))
        self.tabs.addTab(histograms, self.tr("Histograms"))
        self.tabs.addTab(table, self.tr("Table 3"))
        self.body.addWidget(self.nothing)
        self.body.addWidget(self.tabs, 1)

    def run(self) -> None:
        """Evaluate in the background."""
        self.bench.run_stage("evaluate", evaluate, on_done=self._told)

    def can_run(self) -> bool:
        """Say whether there are planes and a calibration."""
        folder = self.session.folder
        if folder is None or not folder.of_role("plane"):
            return False
        return any(folder.result_file(f"{m}.npz").exists() for m in ("photogrammetric", "polynomial"))

    def _told(self, evaluations: tuple) -> None:
        captures = len({e.capture for e in evaluations})
        self.bench.notify("success", self.tr("{n} planes evaluated.").format(n=captures))

    def refresh(self) -> None:
        """Show the evaluation the project has."""
        self.run_button.setEnabled(self.can_run())
        if not self.session.is_open:
            return
        status = self.session.statuses.get("evaluate")
        reason = status.reason if status else ""
        exists = self.session.folder.result_file("evaluation.npz").exists()
        stale = status is not None and status.state is State.STALE
        text = (
            self.tr("This evaluation is out of date: {reason}.") if exists else self.tr("Not evaluated yet: {reason}.")
        )
        self.nothing.setText(text.format(reason=reason))
        self.nothing.setVisible(stale or not exists)
        self.tabs.setVisible(exists)
        if exists:
            self.bench.views.run(
                "evaluation",
                load_evaluation,
                self.session.folder,
                on_done=self._show,
                on_failed=self.bench.report_failure,
            )

    def _show(self, view: EvaluationView | None) -> None:
        if view is None or (self._view is not None and view.evaluations is self._view.evaluations):
            return
        self._view = view
        self.deviations.show_view(view)
        series = [
            (f"{e.capture}, {method_name(e.method)}", e.deviation_mm)
            for e in sorted(view.evaluations, key=lambda e: view.captures.index(e.capture))
        ]
        self.histogram.set_values(series, view.limit_mm)
        self.table.show_table(view.table)
