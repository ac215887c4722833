"""The run of a calibration: what will be done, how far it is, where the iterations are going."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QProgressBar, QWidget

from stripe_gui.jobs import Job, JobState
from stripe_gui.presenters.failures import describe
from stripe_gui.presenters.told import told
from stripe_gui.widgets.layout import button, card, column, label, make, row
from stripe_gui.widgets.plot import Curve, Plot

SERIES = ("sigma0", "correction")
LEAST = 1e-9  # a correction below this is drawn here


class ConvergencePlot(QWidget):
    """sigma0 and the length of the corrections at every iteration; a gap where a solution was begun anew."""

    def __init__(self) -> None:
        super().__init__()
        self.plot = Plot(self.tr("Convergence"), self.tr("iteration"), self.tr("σ0, correction"))
        self.plot.axes["left"].setLogMode(x=False, y=True)
        self.plot.axes["bottom"].setTickSpacing(major=5, minor=1)
        self.state = label(" ", "muted", wrap=True)
        self._course: dict[str, list[tuple[int, float]]] = {}
        self.setLayout(column((self.plot, 1), self.state, spacing=6))
        self.clear()

    def clear(self) -> None:
        self._course = {name: [] for name in SERIES}
        self._draw()

    def tell(self, name: str, step: int, value: float) -> None:
        if name in self._course and np.isfinite(value):
            self._course[name].append((step, value))
            self._draw()

    def _draw(self) -> None:
        names = {"sigma0": "σ0", "correction": self.tr("correction")}
        curves, lowest, highest, last = [], -5.0, 1.0, 10
        for tone, name in enumerate(SERIES):
            x, y = _line(self._course[name])
            if len(x):
                lowest, highest = min(lowest, float(np.nanmin(y))), max(highest, float(np.nanmax(y)))
                last = max(last, int(np.nanmax(x)))
                curves.append(Curve(names[name], x, y, tone, "line" if tone == 0 else "dash"))
        said = self.said()
        self.plot.set_curves(curves, (0, last + 0.5), (lowest - 0.3, highest + 0.3), said)
        self.state.setText(said)

    def said(self) -> str:
        if not self._course["sigma0"]:
            return self.tr("The iterations are drawn here while they run.")
        text = self.tr("After {n} iterations: σ0 {s:.4g}")
        said = text.format(n=len(self._course["sigma0"]), s=self._course["sigma0"][-1][1])
        if self._course["correction"]:
            more = self.tr("; the last correction was {c:.2g} σ, all unknowns together.")
            said += more.format(c=self._course["correction"][-1][1])
        anew = sum(step == 0 for step, _ in self._course["sigma0"]) - 1
        if anew > 0:
            again = self.tr(" Begun anew {n} times: after gross errors, for the weights, to test the rig.")
            said += again.format(n=anew)
        return said


def _line(course: list[tuple[int, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Give the curve of a course: iterations numbered through, lifted where it began anew."""
    x: list[float] = []
    y: list[float] = []
    for i, (step, value) in enumerate(course):
        if step == 0 and i > 0:
            x.append(np.nan)
            y.append(np.nan)
        x.append(float(i))
        y.append(float(np.log10(max(value, LEAST))))
    return np.array(x), np.array(y)


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
        progress = card(row((self.plan, 1), self.cancel_button), self.bar, self.state)
        self.setLayout(column(progress, (card((self.convergence, 1)), 1)))
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
            return self.tr("Stopping…") if job.stopping else told(job.message) or self.tr("Waiting…")
        if job.state is JobState.CANCELLED:
            return self.tr("Cancelled; the project is as it was.")
        if job.failure is not None:
            failure = describe(job.failure.error)
            remedy = failure.remedy[:1].upper() + failure.remedy[1:]
            return self.tr("Failed: {what}. {remedy}.").format(what=failure.happened, remedy=remedy)
        return self.tr("Done; the run is kept.")
