"""The checks of the rig before its first calibration: a sentence and a picture or curve for each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QDoubleSpinBox, QStackedWidget, QWidget

from core.capture.fitness import visibility
from core.model import Finding
from stripe_gui.jobs import Failure, Job
from stripe_gui.presenters.capturing import check_rig, stripes_at
from stripe_gui.presenters.told import sentence, told
from stripe_gui.widgets.finding_list import FindingList
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, button, column, label, make, row
from stripe_gui.widgets.plot import CurveView
from stripe_gui.wizards.capture.devices import DevicesStep
from stripe_gui.workbench import Workbench

Stripes = tuple[list[NDArray[np.float64]], float]


class ChecksStep(QWidget):
    """Runs the checks, and shows the chosen one."""

    changed = Signal()

    def __init__(self, bench: Workbench, devices: DevicesStep) -> None:
        super().__init__()
        self.bench, self.devices = bench, devices
        self._job: Job | None = None
        self._found: tuple[Finding, ...] = ()
        self._stripes: dict[float, Stripes] = {}
        self.run_button = button(self.tr("Check the rig"), self.run, "run")
        self.stop_button = button(self.tr("Cancel"), self.cancel, "stop")
        self._purpose = self.tr(
            "Worth doing once before the first calibration and after every change of the rig. Put an even, bright "
            "surface where measuring will be done."
        )
        self.words = label(self._purpose, "muted", wrap=True)
        self.findings = FindingList(self.tr("Findings"))
        self.findings.chosen.connect(self._show)
        self.z = make(QDoubleSpinBox, minimum=-10_000, maximum=10_000, suffix=" mm")
        self.z.setAccessibleName(self.tr("Where the plate stands"))
        self.depth_button = button(self.tr("Add this depth"), self.add_depth, "runall")
        self.depth_button.setToolTip(
            self.tr("Takes the finest stripes here; two positions or more show whether the whole depth can be used.")
        )
        self.heading = label("", "heading", wrap=True)
        self.view = ImageView(self.tr("Picture of the check"))
        self.curve = CurveView(self.tr("Curve of the check"))
        self.nothing = label(self.tr("Nothing to look at here."), "muted")
        self.stack = QStackedWidget()
        for widget in (self.nothing, self.view, self.curve):
            self.stack.addWidget(widget)
        depth = row(label(self.tr("Working depth: plate at")), self.z, self.depth_button, None)
        right = boxed(column(self.heading, (self.stack, 1), spacing=8))
        lower = boxed(row((self.findings, 1), (right, 1)))
        top = row(self.run_button, self.stop_button, None)
        self.setLayout(column(top, self.words, (lower, 1), boxed(depth), spacing=8))
        self._update()

    @property
    def running(self) -> bool:
        return self._job is not None

    def run(self) -> None:
        self._start(self.tr("Checks of the rig"), check_rig, self._checked)

    def add_depth(self) -> None:
        z_mm = self.z.value()
        self._start(self.tr("Stripes"), stripes_at, lambda stripes: self._measured(z_mm, stripes), z_mm)

    def cancel(self) -> None:
        if self._job is not None:
            self._job.cancel()

    def clear(self) -> None:
        """Forget what was found: another rig."""
        self._found, self._stripes = (), {}
        self._list()
        self.heading.clear()
        self.stack.setCurrentWidget(self.nothing)

    def _start(self, title: str, function: Callable[..., Any], done: Callable[[Any], None], *arguments: object) -> None:
        if self.running or self.bench.session.folder is None:
            return
        self.bench.views.cancel_all()
        self._job = self.bench.jobs.run(
            title,
            function,
            self.bench.session.folder.project,
            self.devices.rig,
            self.devices.urls,
            *arguments,
            on_done=done,
            on_failed=self._failed,
        )
        self._job.progressed.connect(lambda fraction, message: self.words.setText(f"{100 * fraction:.0f} %  {message}"))
        self._job.ended.connect(self._ended)
        self._update()

    def _checked(self, findings: tuple[Finding, ...]) -> None:
        self._found = findings
        self._list()

    def _measured(self, z_mm: float, stripes: Stripes) -> None:
        self._stripes[z_mm] = stripes
        self._list()

    def _list(self) -> None:
        found = [*self._found]
        if len(self._stripes) > 1:
            depths = sorted(self._stripes)
            stacks, noises = zip(*(self._stripes[z] for z in depths), strict=True)
            found.append(visibility(depths, stacks, max(noises)))
        self.findings.show_findings(found)
        self.words.setText(self._summary(found))

    def _summary(self, found: Sequence[Finding]) -> str:
        if len(self._stripes) == 1:
            return self.tr("Stripes taken at one depth; put the plate elsewhere and add that depth too.")
        if not found:
            return self._purpose
        good = sum(f.level == "good" for f in found)
        return self.tr("{good} of {n} checks are good; choose one to see it.").format(good=good, n=len(found))

    def _failed(self, failure: Failure) -> None:
        self.bench.report_failure(failure)
        self.words.setText(self.tr("The checks could not be done."))

    def _ended(self) -> None:
        job, self._job = self._job, None
        if job is not None and job.stopping:
            self.words.setText(self.tr("Stopped."))
        self._update()

    def _show(self, finding: Finding) -> None:
        self.heading.setText(sentence(finding.title))
        if finding.curve:
            self.curve.set_curve(finding.curve, *map(told, finding.axes))
            self.stack.setCurrentWidget(self.curve)
        elif finding.picture is not None and np.isfinite(finding.picture).any():
            low, high = float(np.nanmin(finding.picture)), float(np.nanmax(finding.picture))
            self.heading.setText(f"{sentence(finding.title)}: {told(finding.picture_label)}")
            scale = (min(low, 0.0), high if high > low else low + 1.0)
            self.view.set_image(finding.picture, scale, scale="map", digits=2)
            self.stack.setCurrentWidget(self.view)
        else:
            self.stack.setCurrentWidget(self.nothing)

    def _update(self) -> None:
        self.run_button.setEnabled(not self.running)
        self.depth_button.setEnabled(not self.running)
        self.stop_button.setVisible(self.running)
        self.changed.emit()
