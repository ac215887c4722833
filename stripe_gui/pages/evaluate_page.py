"""The plane-table: signed deviation maps on one scale, histograms, Table 3."""

from __future__ import annotations

from PySide6.QtWidgets import QFrame, QGridLayout, QScrollArea, QTabWidget, QWidget

from stripe_gui.pages.page import Page
from stripe_gui.presenters.evaluate import EvaluationView, load_evaluation
from stripe_gui.presenters.status import State, method_name
from stripe_gui.presenters.work import evaluate
from stripe_gui.widgets.colour_bar import ColourBar
from stripe_gui.widgets.histogram import Histogram
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, button, column, label, row
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.workbench import Workbench


class EvaluatePage(Page):
    """One map per plane and method; they zoom together."""

    id = stage = "evaluate"
    action_ids = ("evaluate.wizard",)

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Evaluate"),
            self.tr("How far the points of the plane-table lie from the plane fitted to them."),
        )
        self._view: EvaluationView | None = None
        self.maps: list[ImageView] = []
        self.run_button = self.add_button(self.tr("Evaluate"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Judge every plane capture by every calibration (F5)."))
        self.nothing = label("", "muted", wrap=True)
        self.tabs = QTabWidget()
        self.tabs.setAccessibleName(self.tr("Results of the evaluation"))
        self.tabs.setDocumentMode(True)
        self.tabs.tabBar().setDrawBase(False)
        self._grid = QGridLayout()
        self._grid.setSpacing(12)
        self._grid.setContentsMargins(0, 0, 0, 0)
        inner = QWidget()
        inner.setLayout(self._grid)
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setWidget(inner)
        self.bar = ColourBar()
        self.scale_text = label("", "muted", wrap=True)
        fit = button(self.tr("Whole images"), self.fit, "fit", flat=True)
        maps = boxed(column(row(scroll, self.bar), row(self.scale_text, fit)))
        maps.layout().setContentsMargins(0, 12, 0, 0)
        self.histogram = Histogram(self.tr("Histograms of the deviations"), "mm")
        self.table = ResultTable(self.tr("Deviations from the plane-table"))
        table = boxed(column(self.table))
        table.layout().setContentsMargins(0, 12, 0, 0)
        maps.setObjectName("maps")
        self.histogram.setObjectName("histograms")
        table.setObjectName("table")
        self.tabs.addTab(maps, self.tr("Maps"))
        self.tabs.addTab(self.histogram, self.tr("Histograms"))
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
                on_failed=lambda failure: self.bench.report_error(failure.error, failure.trace),
            )

    def _show(self, view: EvaluationView | None) -> None:
        if view is None or (self._view is not None and view.evaluations is self._view.evaluations):
            return
        self._view = view
        self._clear_maps()
        for i, method in enumerate(view.methods):
            for j, capture in enumerate(view.captures):
                self._add_map(view, capture, method, i, j)
        self._grid.setRowStretch(len(view.methods), 0)
        levels = (-view.limit_mm, view.limit_mm)
        self.bar.show_scale("deviation", levels, "mm")
        text = self.tr(
            "One scale of ±{limit:g} mm; + is towards the camera. What lies beyond has the outermost colour."
        )
        self.scale_text.setText(text.format(limit=view.limit_mm))
        series = [
            (f"{e.capture}, {method_name(e.method)}", e.deviation_mm)
            for e in sorted(view.evaluations, key=lambda e: view.captures.index(e.capture))
        ]
        self.histogram.set_values(series, view.limit_mm)
        self.table.show_table(view.table)

    def _add_map(self, view: EvaluationView, capture: str, method: str, i: int, j: int) -> None:
        evaluation = view.of(capture, method)
        if evaluation is None:
            return
        angle = f", {evaluation.angle_deg:+g}°" if evaluation.angle_deg is not None else ""
        made = ImageView(self.tr("Deviations of {capture}, {method}").format(capture=capture, method=method), bar=False)
        made.set_image(evaluation.deviation_mm, (-view.limit_mm, view.limit_mm), scale="deviation", unit="mm", digits=4)
        made.hovered.connect(lambda u, v: self.bar.mark(made.value_at(u, v)))
        title = label(f"{capture}{angle}", "heading")
        figures = label(
            self.tr("{method}: r.m.s. {rms:.4f} mm, n {n}").format(
                method=method_name(method), rms=evaluation.rms_mm, n=evaluation.n
            ),
            "muted",
            wrap=True,
        )
        made.canvas.moved.connect(lambda: self._follow(made))
        self.maps.append(made)
        self._grid.addWidget(boxed(column(title, figures, made, spacing=4)), i, j)

    def _follow(self, moved: ImageView) -> None:
        for other in self.maps:
            if other is not moved:
                other.show_as(moved)

    def fit(self) -> None:
        """Show every map whole."""
        for made in self.maps:
            made.fit()

    def _clear_maps(self) -> None:
        self.maps = []
        while self._grid.count():
            widget = self._grid.takeAt(0).widget()
            widget.hide()
            widget.deleteLater()
