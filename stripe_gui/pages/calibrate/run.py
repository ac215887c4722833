"""The run of a calibration: what will be done, how far it is, where the iterations are going."""

from __future__ import annotations

from PySide6.QtWidgets import QProgressBar, QWidget

from stripe_gui.jobs import Job, JobState
from stripe_gui.presenters.failures import describe
from stripe_gui.widgets.convergence_plot import ConvergencePlot
from stripe_gui.widgets.layout import button, card, column, label, make, row


class RunPart(QWidget):
    """Progress, convergence, cancel."""

    def __init__(self) -> None:
        super().__init__()
        self._job: Job | None = None
        self.plan = label("", wrap=True)
        self.cancel_button = button(self.tr("Cancel"), self._cancel, "stop")
        said = self.tr("Progress of the calibration")
        self.bar = make(QProgressBar, maximum=1000, textVisible=False, accessibleName=said)
        self.state = label(" ", "muted", wrap=True)
        self.convergence = ConvergencePlot()
        frame, inside = card()
        inside.addLayout(column(row((self.plan, 1), self.cancel_button), self.bar, self.state))
        curve, around = card()
        around.addWidget(self.convergence, 1)
        self.setLayout(column(frame, (curve, 1)))
        self._show()

    @property
    def running(self) -> bool:
        return self._job is not None and self._job.active

    def show_plan(self, words: str) -> None:
        self.plan.setText(words)

    def follow(self, job: Job) -> None:
        """Show a run from its start to its end."""
        self._job = job
        self.convergence.clear()
        job.progressed.connect(lambda *_: self._show())
        job.told.connect(self.convergence.tell)
        job.ended.connect(self._show)
        self._show()

    def _cancel(self) -> None:
        if self._job is not None:
            self._job.cancel()
            self._show()

    def _show(self) -> None:
        job = self._job
        running = job is not None and job.active
        self.cancel_button.setEnabled(job is not None and running and not job.stopping)
        self.bar.setValue(round(1000 * job.fraction) if job is not None and running else 0)
        self.state.setText(self._words(job))

    def _words(self, job: Job | None) -> str:
        if job is None:
            return self.tr("Not started yet. The window stays usable while it runs.")
        if job.active:
            return self.tr("Stopping…") if job.stopping else job.message or self.tr("Waiting…")
        if job.state is JobState.CANCELLED:
            return self.tr("Cancelled; the project is as it was.")
        if job.failure is not None:
            told = describe(job.failure.error)
            remedy = told.remedy[:1].upper() + told.remedy[1:]
            return self.tr("Failed: {what}. {remedy}.").format(what=told.happened, remedy=remedy)
        return self.tr("Done; the run is kept.")
