"""Calibrating, on one page: what is chosen, which captures take part, the run, its results, kept runs side by side."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

from core.errors import StripeError
from core.geometry import lens_of
from core.model import Method
from core.pipeline import METHODS, calibrate_project
from stripe_gui.pages.calibrate.captures import CaptureChoice
from stripe_gui.pages.calibrate.run import RunPart
from stripe_gui.pages.calibrate.runs import RunsPart
from stripe_gui.pages.parts_page import Part, PartsPage
from stripe_gui.presenters.calibrate import calibration_view, choice_of, exclude_targets, restore_targets
from stripe_gui.presenters.contributions import Contribution, contributions
from stripe_gui.presenters.runs import options_words
from stripe_gui.presenters.stages import State
from stripe_gui.presenters.status import methods_of
from stripe_gui.presenters.told import told
from stripe_gui.presenters.work import CalibrateChoice, chosen_methods
from stripe_gui.widgets.calibrate_form import CalibrateForm
from stripe_gui.widgets.calibration_results import CalibrationResults
from stripe_gui.widgets.layout import boxed, button, card, column, label, row, scrolled, tab_parts
from stripe_gui.workbench import Workbench

ROOM_FOR_TWO = 1000  # the two halves of the first step stand side by side from this width on


class CalibratePage(PartsPage):
    """Method, captures, run, results, runs."""

    id = stage = "calibrate"
    by_pair = True

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Calibrate"),
            self.tr("Interior and relative orientation of camera and projector, and how well they are known."),
        )
        self._project: Path | None = None
        self._excluded: list[tuple[str, tuple[int, int]]] = []  # since the last run
        self.run_button = self.add_button(self.tr("Calibrate"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Decode, measure and calibrate in the background (F5)."))
        self.state = label("", "muted", wrap=True)
        self.body.insertWidget(0, self.state)
        self.form = CalibrateForm()
        self.captures = CaptureChoice()
        self.run_part = RunPart()
        self.results = CalibrationResults(bench)
        self.runs = RunsPart(bench)
        self.add_step("method", self.tr("Method"), scrolled(card((self.form, 1)), across=False))
        self.add_step("captures", self.tr("Captures"), self.captures, enter=self._look_at_captures)
        self.add_step("run", self.tr("Run"), self.run_part, enter=self._plan)
        self.add_step("results", self.tr("Results"), self._results_body(), enter=self._show_results)
        self.add_step("runs", self.tr("Runs"), self.runs, enter=self.runs.show_runs)
        self.form.changed.connect(self._chosen)
        self.captures.changed.connect(self._chosen)
        self.captures.restore_wanted.connect(self._restore_all)
        self.results.residuals.target_unwanted.connect(self.exclude)
        self.results.residuals.capture_unwanted.connect(self.leave_out)
        self.start()

    def _results_body(self) -> QWidget:
        self.pending = label("", wrap=True)
        self.take_back_button = button(self.tr("Take back"), self.take_back, "back", flat=True)
        self.again_button = button(self.tr("Run again"), self.run, "run")
        pending = row((self.pending, 1), self.take_back_button, self.again_button)
        self._pending = card(pending, margins=(12, 8, 8, 8))
        self._pending.hide()
        return boxed(column(self._pending, (self.results, 1), spacing=10))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self.form.set_narrow(self.width() < ROOM_FOR_TWO)

    # ---------------------------------------------------------------------------------------------------------- choices

    def choice(self) -> CalibrateChoice:
        """Give what is chosen on the first two steps."""
        choice = self.form.choice()
        return replace(choice, options=replace(choice.options, without=self.captures.without))

    def refresh(self) -> None:
        """Show the project as it is now; another project begins at the first step."""
        folder = self.session.folder
        if folder is None:
            return
        if folder.path != self._project:
            self._project, self._excluded = folder.path, []
            choice = choice_of(folder)
            devices = folder.project.rig.devices.items()
            self.form.show_devices({name: lens_of(spec).names for name, spec in devices if not spec.labels_only})
            self.form.set_choice(choice)
            rig = folder.project.rig
            self.form.show_pairs(rig.pairs, rig.pair(choice.options.camera, choice.options.projector))
            self.captures.show_captures(())
            self.captures.set_without(choice.options.without)
            self.go_to("results" if self._calibrated() else "method")
        self._look_at_captures()
        self.step.enter()
        self._chosen()

    def _chosen(self) -> None:
        """Say where the stage stands, or what a run would lack."""
        self.run_button.setEnabled(self.can_run())
        status, missing = self.session.statuses.get("calibrate"), self.captures.missing(self.choice().method)
        if missing or status is None or status.state is State.DONE:
            self.state.setText(missing)
        elif self._calibrated():
            self.state.setText(self.tr("This calibration is out of date: {reason}.").format(reason=status.reason))
        else:
            self.state.setText(self.tr("No calibration yet: {reason}.").format(reason=status.reason))
        self.state.setVisible(bool(self.state.text()))

    def _look_at_captures(self) -> None:
        folder = self.session.folder
        if folder is not None:
            failed = self.bench.report_failure
            self.bench.views.run("captures", contributions, folder, on_done=self._captures_known, on_failed=failed)

    def _captures_known(self, found: tuple[Contribution, ...]) -> None:
        self.captures.show_captures(found)
        self._plan()
        self._chosen()

    def _restore_all(self, name: str) -> None:
        entry = self.session.opened.entry(name)
        if entry is not None and entry.capture is not None:
            self.bench.guarded(restore_targets, entry.capture, *entry.capture.excluded)
            self._excluded = [(capture, target) for capture, target in self._excluded if capture != name]
            self.bench.refresh()

    # ---------------------------------------------------------------------------------------------------------- running

    def can_run(self) -> bool:
        folder = self.session.folder
        if folder is None or self.run_part.running:
            return False
        return any(method.uses(e.capture) for e in folder.captures() if e.capture for method in METHODS.values())

    def run(self) -> None:
        """Calibrate in the background, with the convergence in front; where too little is chosen, show that step."""
        if not self.can_run():
            return
        if self.captures.missing(self.form.method.currentData()):
            self.go_to("captures")
            return
        choice = self.choice()
        job = self.bench.run_stage("calibrate", calibrate_project, choice.method, choice.options, on_done=self._done)
        if job is not None:
            self.run_part.follow(job)
            job.ended.connect(self._chosen)
            self.go_to("run")

    def _done(self, _calibrations: dict[Method, Any]) -> None:
        self._excluded = []
        self._tell_pending()
        if self.step.name == "run":
            self.go_to("results")

    def _plan(self) -> None:
        choice = self.choice()
        used = {m: len(self.captures.used(*METHODS[m].roles)) for m in chosen_methods(choice.method)}
        methods = [m for m, count in used.items() if count]
        count = self.tr("{method} ({n} captures)")
        parts = [count.format(method=told(m), n=used[m]) for m in methods]
        text = self.tr("{what}; {options}. Unchanged captures are not measured again.")
        words = text.format(what=" + ".join(parts), options=options_words(choice.options, methods))
        self.run_part.show_plan(words[0].upper() + words[1:] if parts else "")

    def _calibrated(self) -> bool:
        return self.session.is_open and bool(methods_of(self.session.opened))

    # ---------------------------------------------------------------------------------------------------------- results

    def _show_results(self) -> None:
        folder = self.session.folder
        if folder is None:
            return
        try:
            view = calibration_view(folder)
        except StripeError as error:
            self.bench.report_error(error)
            return
        self.results.setVisible(bool(view.tables))
        if view.tables:
            self.results.show_calibration(view)
        self._tell_pending()

    def exclude(self, capture: str, row_: int, col: int) -> None:
        """Leave a target of a capture out; it counts from the next run on."""
        entry = self.session.opened.entry(capture)
        if entry is None or entry.capture is None or (row_, col) in entry.capture.excluded:
            return
        self.bench.guarded(exclude_targets, entry.capture, (row_, col))
        self._excluded.append((capture, (row_, col)))
        self.bench.refresh()

    def leave_out(self, capture: str) -> None:
        """Leave a whole capture out; it counts from the next run on."""
        self.captures.leave_out(capture)
        self._tell_pending()

    def take_back(self) -> None:
        """Undo everything that was excluded since the last run."""
        for capture, target in self._excluded:
            entry = self.session.opened.entry(capture)
            if entry is not None and entry.capture is not None:
                self.bench.guarded(restore_targets, entry.capture, target)
        self._excluded = []
        for name in self._newly_without():
            self.captures.leave_out(name, out=False)
        self.bench.refresh()
        self._tell_pending()

    def _newly_without(self) -> list[str]:
        before = choice_of(self.session.opened).options.without
        return [name for name in self.captures.without if name not in before]

    def _tell_pending(self) -> None:
        """Say what was excluded since the run that is shown."""
        targets = [f"{capture} {row_}/{col}" for capture, (row_, col) in self._excluded]
        captures = self._newly_without() if self.session.is_open else []
        words = []
        if targets:
            words.append(self.tr("Excluded: {names}.").format(names=", ".join(targets)))
        if captures:
            words.append(self.tr("Left out: {names}.").format(names=", ".join(captures)))
        if words:
            words.append(self.tr("Run again to see what that changes."))
        self.pending.setText(" ".join(words))
        self._pending.setVisible(bool(words))
        self.again_button.setEnabled(self.can_run())

    def inner_parts(self, part: Part) -> Iterator[str]:
        """Bring the tabs of results and runs to the front."""
        if part.name == "results" and not self.results.isHidden():
            yield from tab_parts(self.results.tabs)
        else:
            yield from self.runs.parts() if part.name == "runs" else ("",)
