"""The plane-table wizard: from plane captures and calibrations to a report that is signed off."""

from __future__ import annotations

from pathlib import Path

from core.pipeline import load_sign_off
from stripe_gui.presenters.evaluate import EvaluationView, load_evaluation
from stripe_gui.presenters.work import evaluate
from stripe_gui.widgets.deviation_maps import DeviationMaps
from stripe_gui.widgets.job_bar import JobBar
from stripe_gui.widgets.layout import boxed, column, label
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.wizards.plane_table.model import (
    calibration_choices,
    export_files,
    is_evaluated,
    plane_choices,
    write_signed_report,
)
from stripe_gui.wizards.plane_table.steps import CheckList, HistogramStep, ProfileStep, SignOffStep, choose_body
from stripe_gui.wizards.wizard import Wizard
from stripe_gui.workbench import Workbench


class PlaneTableWizard(Wizard):
    """Six steps: choose and evaluate, maps, profile, histogram, Table 3, sign-off."""

    id = "plane-table"
    stage = "evaluate"

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Plane-table"),
            self.tr("Judge the sensor by planes: choose, evaluate, look, sign off."),
            last=self.tr("Write report"),
        )
        self._view: EvaluationView | None = None
        self.run_button = self.add_button(self.tr("Evaluate"), self.run, "run")
        self.run_button.setToolTip(self.tr("Judge the ticked planes by the ticked calibrations (F5)."))
        self.planes = CheckList(self.tr("Planes"))
        self.calibrations = CheckList(self.tr("Calibrations"))
        for found in (self.planes, self.calibrations):
            found.ticked.connect(self._choice_changed)
        self.state = label("", "muted", wrap=True)
        self.maps = DeviationMaps()
        maps = boxed(column(self.maps))
        maps.layout().setContentsMargins(0, 8, 0, 0)
        self.profile = ProfileStep()
        self.maps.limit.valueChanged.connect(self.profile.maps.limit.setValue)
        self.profile.maps.limit.valueChanged.connect(self.maps.limit.setValue)
        self.histogram = HistogramStep()
        self.table = ResultTable(self.tr("Deviations from the plane-table"))
        table = boxed(column(self.table))
        table.layout().setContentsMargins(0, 8, 0, 0)
        self.signing = SignOffStep()
        self.signing.export_wanted.connect(self.export)
        body = choose_body(self.planes, self.calibrations, self.state, JobBar(bench.jobs))
        self.add_step("choose", self.tr("Choose"), body, missing=self._missing)
        self.add_step("maps", self.tr("Maps"), maps)
        self.add_step("profile", self.tr("Profile"), self.profile)
        self.add_step("histogram", self.tr("Histogram"), self.histogram)
        self.add_step("table", self.tr("Table 3"), table)
        self.add_step("sign-off", self.tr("Sign off"), self.signing)
        bench.session.project_changed.connect(self._forget)

    def refresh(self) -> None:
        """List what there is, and show the evaluation the project has."""
        if not self.session.is_open:
            return
        planes = self.bench.guarded(plane_choices, self.session.folder)
        self.planes.show_choices(planes or [])
        self.calibrations.show_choices(calibration_choices(self.session.folder, self.session.statuses))
        self._choice_changed()
        self.bench.views.run(
            "evaluation",
            load_evaluation,
            self.session.folder,
            on_done=self._take,
            on_failed=self.bench.report_failure,
        )

    def run(self) -> None:
        """Evaluate what is ticked, in the background."""
        if self.can_run():
            self.bench.run_stage(
                "evaluate", evaluate, captures=self.planes.chosen(), methods=self.calibrations.chosen()
            )

    def can_run(self) -> bool:
        """Say whether a plane and a calibration are ticked."""
        return self.session.is_open and bool(self.planes.chosen() and self.calibrations.chosen())

    def export(self) -> None:
        """Ask for a folder and write the chosen files there."""
        out = self.bench.dialogs.open_folder(self, self.tr("Export the plane-table into a folder"), Path.home())
        if out is None or self._view is None:
            return
        self._remember()
        done = self.tr("{n} files written to {folder}.")
        self.bench.run_stage(
            "report",
            export_files,
            self._view,
            self.signing.sign_off(),
            self.profile.line,
            self.signing.wishes(),
            out,
            on_done=lambda files: self.bench.notify("success", done.format(n=len(files), folder=out)),
        )

    def finish(self) -> None:
        """Sign off, write the report and go to its page."""
        self._remember()

        def done(_: object) -> None:
            self.bench.notify("success", self.tr("The report is written: HTML and PDF."))
            self.bench.show_page("report")

        self.bench.run_stage("report", write_signed_report, self.signing.sign_off(), on_done=done)

    def _take(self, view: EvaluationView | None) -> None:
        if view is not None and (self._view is None or view.evaluations is not self._view.evaluations):
            first = self._view is None
            self._view = view
            for part in (self.maps, self.profile, self.histogram, self.signing):
                part.show_view(view)
            self.table.show_table(view.table)
            if first:
                self._fill()
        elif view is None:
            self._view = None
        self._choice_changed()

    def _fill(self) -> None:
        signed = self.bench.guarded(load_sign_off, self.session.folder.project, self._view.evaluations)
        self.signing.fill(signed, self.bench.settings.text("instrument"))

    def _remember(self) -> None:
        signed = self.signing.sign_off()
        if signed is not None:
            self.bench.settings.set("instrument", signed.instrument)

    def _forget(self) -> None:
        """Another project: begin anew."""
        self._view = None
        self.planes.clear()
        self.calibrations.clear()
        self.start()

    def _choice_changed(self) -> None:
        planes, methods = len(self.planes.chosen()), len(self.calibrations.chosen())
        if planes and methods:
            text = self.tr("{n} planes by {m} calibrations: ").format(n=planes, m=methods)
            text += self.tr("evaluated.") if self._evaluated() else self.tr("not evaluated yet.")
        else:
            text = ""
        self.state.setText(text)
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
        if not self.calibrations.chosen():
            return self.tr("Tick a calibration.")
        return "" if self._evaluated() else self.tr("Evaluate these first (F5).")
