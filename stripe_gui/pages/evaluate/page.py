"""The plane-table on one page: what is judged, signed deviation maps, profiles, histograms, Table 3."""

from __future__ import annotations

from core.pipeline import evaluate_project
from stripe_gui.pages.evaluate.parts import BELOW, CheckList, HistogramPart, ProfilePart
from stripe_gui.pages.parts_page import PartsPage
from stripe_gui.presenters.evaluate import (
    EvaluationView,
    calibration_choices,
    is_evaluated,
    load_evaluation,
    plane_choices,
)
from stripe_gui.presenters.stages import State
from stripe_gui.widgets.deviation_maps import DeviationMaps
from stripe_gui.widgets.layout import boxed, column, label, row
from stripe_gui.widgets.result_table import EMPTY, ResultTable
from stripe_gui.widgets.verdict import VerdictList
from stripe_gui.workbench import Workbench


class EvaluatePage(PartsPage):
    """Planes and calibrations to tick, then maps, profile, histogram and Table 3 of the evaluation there is."""

    id = stage = "evaluate"
    by_pair = True

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Evaluate"),
            self.tr("How far the points of the plane-table lie from the plane fitted to them."),
        )
        self._view: EvaluationView | None = None
        self.run_button = self.add_button(self.tr("Evaluate"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Judge the ticked planes by the ticked calibrations (F5)."))
        self.state = label("", "muted", wrap=True)
        self.verdicts = VerdictList()
        self.body.insertWidget(0, self.state)
        self.body.insertWidget(1, self.verdicts)
        self.planes = CheckList(self.tr("Planes"))
        self.calibrations = CheckList(self.tr("Calibrations"))
        for found in (self.planes, self.calibrations):
            found.ticked.connect(self._choice_changed)
        self.chosen = label("", "muted", wrap=True)
        self.deviations = DeviationMaps()
        maps = boxed(column(self.deviations, margins=BELOW))
        self.profile = ProfilePart()
        self.profile.line_changed.connect(bench.session.keep_line)
        self.deviations.limit.valueChanged.connect(self.profile.maps.limit.setValue)
        self.profile.maps.limit.valueChanged.connect(self.deviations.limit.setValue)
        self.histogram = HistogramPart()
        self.table = ResultTable(self.tr("Deviations from the plane-table"))
        table = boxed(column(self.table, margins=BELOW))
        lists = [
            boxed(column(label(found.accessibleName(), "heading"), found, spacing=8))
            for found in (self.planes, self.calibrations)
        ]
        body = boxed(column(row(*lists, spacing=20), self.chosen, margins=BELOW))
        self.add_step("choose", self.tr("Choose"), body, missing=self._missing)
        self.add_step("maps", self.tr("Maps"), maps)
        self.add_step("profile", self.tr("Profile"), self.profile)
        self.add_step("histogram", self.tr("Histogram"), self.histogram)
        self.add_step("table", self.tr("Table 3"), table)
        bench.session.project_changed.connect(self._forget)

    def refresh(self) -> None:
        if not self.session.is_open:
            return
        planes = self.bench.guarded(plane_choices, self.session.folder)
        self.planes.show_choices(planes or [])
        self.calibrations.show_choices(calibration_choices(self.session.opened, self.session.statuses))
        self._choice_changed()
        asked, failed = (self.session.folder, self.session.pair), self.bench.report_failure
        self.bench.views.run("evaluation", load_evaluation, *asked, on_done=self._take, on_failed=failed)

    def run(self) -> None:
        if self.can_run():
            self.bench.run_stage(
                "evaluate",
                evaluate_project,
                captures=self.planes.chosen(),
                methods=self.calibrations.chosen(),
                on_done=self._told,
            )

    def can_run(self) -> bool:
        return self.session.is_open and bool(self.planes.chosen() and self.calibrations.chosen())

    def _told(self, evaluations: tuple) -> None:
        captures = len({e.capture for e in evaluations})
        if self.step.name == "choose" and self._view is not None:
            self.go_to("maps")
        self.bench.notify("success", self.tr("Planes evaluated: {n}.").format(n=captures))

    def _take(self, view: EvaluationView | None) -> None:
        before = self._view
        if view is not None and not (before and before.every is view.every and before.pair == view.pair):
            first, self._view = self._view is None, view
            for part in (self.deviations, self.profile, self.histogram):
                part.show_view(view)
            self.table.show_table(view.table)
            self.verdicts.show_verdicts(view.verdicts)
            if first and self.step.name == "choose":
                self.go_to("maps")
        elif view is None:
            self._view = None
            self.table.show_table(EMPTY)
            self.verdicts.show_verdicts({})
            self.start()
        self._choice_changed()

    def _forget(self) -> None:
        """Another project: begin anew."""
        self._view = None
        self.planes.clear()
        self.calibrations.clear()
        self.verdicts.show_verdicts({})
        self.start()

    def _choice_changed(self) -> None:
        """Say what is ticked, and where the stage stands."""
        planes, methods = len(self.planes.chosen()), len(self.calibrations.chosen())
        text = self._missing()
        if planes and methods:
            text = self.tr("{n} planes by {m} calibrations: ").format(n=planes, m=methods)
            text += self.tr("evaluated.") if self._evaluated() else self.tr("not evaluated yet.")
        self.chosen.setText(text)
        status = self.session.statuses.get("evaluate")
        told = self.tr("Not evaluated yet: {reason}.")
        if self._view is not None:
            told = self.tr("This evaluation is out of date: {reason}.")
        self.state.setText(told.format(reason=status.reason if status else ""))
        self.state.setVisible(status is not None and status.state is not State.DONE)
        self.run_button.setEnabled(self.can_run())
        self.update_steps()

    def _evaluated(self) -> bool:
        folder = self.session.folder
        return folder is not None and is_evaluated(folder, self._view, self.planes.chosen(), self.calibrations.chosen())

    def _missing(self) -> str:
        if not self.planes.count():
            return self.tr("Capture planes first: captures of the role plane-table.")
        if not self.calibrations.count():
            return self.tr("Calibrate first.")
        if not self.planes.chosen():
            return self.tr("Tick a plane.")
        return "" if self.calibrations.chosen() else self.tr("Tick a calibration.")

    def _reach(self) -> int:
        return len(self.steps) - 1 if self._view is not None else 0
