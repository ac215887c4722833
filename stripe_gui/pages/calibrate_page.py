"""Calibration: options with their consequences, the run, and its results."""

from __future__ import annotations

from collections.abc import Iterator

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from core.errors import StripeError
from stripe_gui.pages.page import Page
from stripe_gui.presenters.calibrate import calibration_view, choice_of
from stripe_gui.presenters.status import State, method_name
from stripe_gui.presenters.work import CalibrateChoice, calibrate
from stripe_gui.widgets.calibrate_form import CalibrateForm
from stripe_gui.widgets.calibration_results import CalibrationResults
from stripe_gui.widgets.layout import boxed, card, column, label, row, scrolled
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
        self._chosen_in: CalibrateChoice | None = None
        self.run_button = self.add_button(self.tr("Calibrate"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Decode, measure and calibrate in the background (F5)."))
        self.form = CalibrateForm(detail=False)
        self.nothing = label("", "muted", wrap=True)
        self.nothing.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.results = CalibrationResults(bench)
        right = column(self.nothing, self.results)
        right.setStretch(1, 1)
        self.body.addLayout(row(self._options(), boxed(right), spacing=20), 1)
        self.body.itemAt(0).layout().setStretch(1, 1)

    def _options(self) -> QWidget:
        frame, layout = card(self.tr("Options"))
        frame.setFixedWidth(300)
        layout.addWidget(self.form, 1)
        scroll = scrolled(frame, across=False)
        scroll.setFixedWidth(312)
        return scroll

    def choice(self) -> CalibrateChoice:
        """Give what is chosen."""
        return self.form.choice()

    def run(self) -> None:
        """Calibrate in the background."""
        self.bench.run_stage("calibrate", calibrate, self.choice(), on_done=self._told)

    def can_run(self) -> bool:
        """Say whether there are captures to calibrate from."""
        folder = self.session.folder
        if folder is None:
            return False
        return any(e.role == "depth" or e.capture.seeds for e in folder.of_role("testfield", "depth") if e.capture)

    def parts(self) -> Iterator[str]:
        """Bring each tab to the front, and name it."""
        if self.results.isHidden():
            yield ""
            return
        yield from self.results.parts()

    def _told(self, calibrations: dict) -> None:
        names = ", ".join(map(method_name, calibrations))
        self.bench.notify("success", self.tr("Calibrated: {names}.").format(names=names))

    def refresh(self) -> None:
        """Show the calibrations the project has."""
        self.run_button.setEnabled(self.can_run())
        if not self.session.is_open:
            return
        in_use = choice_of(self.session.folder)
        if in_use != self._chosen_in:  # another project, or another run came into use
            self._chosen_in = in_use
            self.form.set_choice(in_use)
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
        self.results.setVisible(shown)
        if view is not None and shown:
            self.results.show_calibration(view)
