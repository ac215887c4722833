"""The sequence run: progress, time left, cancel; what the checks said; one frame again."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any

from PySide6.QtCore import QTimer, Signal
from PySide6.QtWidgets import QProgressBar, QWidget

from core.capture import CaptureReport, capture_status
from core.errors import StripeError
from core.model import Subject
from stripe_gui.jobs import Failure, Job
from stripe_gui.presenters.capture import FrameView, load_frame
from stripe_gui.presenters.capturing import Recording, retake, take
from stripe_gui.presenters.failures import describe
from stripe_gui.presenters.told import sentence
from stripe_gui.widgets.finding_list import FindingList
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, button, column, label, make, row
from stripe_gui.widgets.pattern_strip import PatternStrip
from stripe_gui.wizards.capture.devices import DevicesStep
from stripe_gui.workbench import Workbench

LOOK_MS = 60


class TakingStep(QWidget):
    """Takes the planned sequence and shows how it goes."""

    changed = Signal()
    another_wanted = Signal()
    stored = Signal()  # a capture is stored that was none before

    def __init__(self, bench: Workbench, devices: DevicesStep) -> None:
        super().__init__()
        self.bench, self.devices = bench, devices
        self.subject = Subject()
        self.report: CaptureReport | None = None
        self._folder = Path()
        self._events: deque[dict[str, Any]] = deque()  # filled by the worker
        self._guards = 0
        self._job: Job | None = None
        self.title = label("", "heading")
        self.start_button = button(self.tr("Take the sequence"), self.take, "capture", primary=True)
        self.cancel_button = button(self.tr("Cancel"), self.cancel, "stop")
        self.retake_button = button(self.tr("Take this frame again"), self.retake, "refresh")
        self.another_button = button(self.tr("Another like this"), self.another_wanted.emit, "next")
        said = self.tr("Progress of the capture")
        self.bar = make(QProgressBar, maximum=1000, textVisible=False, accessibleName=said)
        self.words = label("", "muted", wrap=True)
        self.strip = PatternStrip(self.tr("Patterns of the capture"))
        self.strip.currentRowChanged.connect(self._show_frame)
        self.view = ImageView(self.tr("Frame"), bar=False)
        self.findings = FindingList(self.tr("What the checks said"))
        right = boxed(column(label(self.tr("What the checks said"), "heading"), self.findings, spacing=6))
        right.setMinimumWidth(250)
        lower = boxed(row((self.view, 3), (right, 2)))
        buttons = row(self.title, None, self.start_button, self.cancel_button, self.retake_button, self.another_button)
        self.setLayout(column(buttons, self.bar, self.words, self.strip, (lower, 1), spacing=8))
        self._timer = QTimer(self, interval=LOOK_MS)
        self._timer.timeout.connect(self._follow)
        self._update()

    @property
    def running(self) -> bool:
        return self._job is not None

    def missing(self) -> str:
        if self.running:
            return self.tr("The sequence is being taken.")
        return "" if self.report is not None else self.tr("Take the sequence.")

    def prepare(self, subject: Subject) -> None:
        """Get ready for a capture; one that was interrupted shows what it has."""
        connection, folder = self.devices.connection, self.bench.session.folder
        if self.running or connection is None or folder is None:
            return
        path = folder.path / "captures" / subject.name
        if subject == self.subject and self.report is not None and self._folder == path:
            return  # the capture that was just taken
        self.subject, self._folder, self.report = subject, path, None
        self.title.setText(subject.name)
        self.strip.set_patterns(connection.patterns, connection.lines)
        self.findings.show_findings([])
        self.view.set_image(None)
        self.bar.setValue(0)
        self.words.setText(self.tr("Nothing may move from now until the last image."))
        try:
            status = capture_status(path) if (path / "capture.json").is_file() else None
        except StripeError:
            status = None
        if status is not None and status.state == "taking":
            for i in set(range(status.planned)) - set(status.missing):
                self.strip.set_state(i, "taken")
            text = self.tr("Goes on where it stopped: {taken} of {planned} images are there already.")
            self.words.setText(text.format(taken=status.taken, planned=status.planned))
        self._update()

    def take(self) -> None:
        if not self.start_button.isEnabled():
            return
        self._run(self.subject.name, take, self.subject)

    def retake(self) -> None:
        frame = self.strip.currentRow()
        if self.report is None or frame < 0 or self.running:
            return
        self.strip.set_state(frame, "again")
        self._run(self.tr("Frame again"), retake, self.subject.name, frame)

    def cancel(self) -> None:
        """Stop after the image that is being taken; what is there stays."""
        if self._job is not None:
            self._job.cancel()
            self.words.setText(self.tr("Stopping …"))
            self.cancel_button.setEnabled(False)

    def _run(self, title: str, function: Any, *arguments: Any) -> None:
        self._events.clear()
        self.bench.views.cancel_all()
        self._job = self.bench.jobs.run(
            title,
            function,
            Recording(self._folder.parents[1], self.devices.rig, self.devices.urls, self._events.append),
            *arguments,
            stage="capture",
            on_done=self._done,
            on_failed=self._failed,
        )
        self._job.cancelled.connect(self._cancelled)
        self._timer.start()
        self._update()

    # -------------------------------------------------------------------------------------------------- while it runs

    def _follow(self) -> None:
        """Show what the worker has told since the last look."""
        latest = ""
        while self._events:
            event = self._events.popleft()
            if event["event"] in ("began", "resumed"):
                self._guards = int(event["guards"])
                for shot in event.get("kept", ()):
                    self.strip.set_state(shot - self._guards, "taken")
            elif event["event"] == "shot":
                self.strip.set_state(event["planned"] - self._guards, "taken")
                latest = event["file"]
                self.strip.follow(event["planned"] - self._guards)
            elif event["event"] == "rejected":
                self.strip.set_state(event["planned"] - self._guards, "again")
        if latest:
            self._load(self._folder / latest)
        job = self._job
        if job is None or job.stopping:
            return
        self.bar.setValue(round(1000 * job.fraction))
        taken, left = self.strip.states.count("taken"), job.seconds_left()
        text = self.tr("{taken} of {of} images taken").format(taken=taken, of=len(self.strip.states))
        if taken == len(self.strip.states):
            text = self.tr("All images are taken; they are being verified")
        elif left is not None:
            text += self.tr(", about {s:.0f} s left").format(s=max(left, 1.0))
        self.words.setText(text)

    def _done(self, report: CaptureReport) -> None:
        self._end()
        first, self.report = self.report is None, report
        self.strip.set_all("taken")
        self.bar.setValue(1000)
        self.findings.show_findings(report.findings)
        text = self.tr("{n} images stored in {s:.1f} s; {r} taken again.")
        self.words.setText(text.format(n=report.frames, s=report.seconds, r=report.retakes))
        self.bench.refresh()
        self.bench.session.choose_capture(self.subject.name)
        if first:
            self.stored.emit()
        self._update()

    def _cancelled(self) -> None:
        self._end()
        if self.report is None:
            text = self.tr("Stopped. The images that are there stay; take the sequence again to go on with the rest.")
        else:
            text = self.tr("Stopped. The capture is as it was.")
            self.strip.set_all("taken")
        self.words.setText(text)
        self._update()

    def _failed(self, failure: Failure) -> None:
        self._end()
        told = describe(failure.error, failure.trace)
        self.bench.notify("error", told.happened, told.remedy, told.details)
        self.words.setText(f"{sentence(told.happened)}: {told.remedy}.")
        if self.report is not None:
            self.strip.set_all("taken")
        self._update()

    def _end(self) -> None:
        self._timer.stop()
        self._follow()
        self._job = None

    # ---------------------------------------------------------------------------------------------------- what it shows

    def _show_frame(self, frame: int) -> None:
        self._update()
        entry = self.bench.session.folder.entry(self.subject.name) if self.bench.session.folder else None
        if self.running or entry is None or entry.capture is None or not 0 <= frame < len(entry.capture.frames):
            return
        self._load(entry.capture.frames[frame].path)

    def _load(self, path: Path) -> None:
        self.bench.views.run(path.name, load_frame, path, on_done=self._show)

    def _show(self, frame: FrameView) -> None:
        self.view.set_image(frame.image, (0.0, frame.white))

    def _update(self) -> None:
        done = self.report is not None
        self.start_button.setVisible(not done)
        self.start_button.setEnabled(not self.running)
        self.cancel_button.setEnabled(self.running)
        self.cancel_button.setVisible(self.running or not done)
        self.retake_button.setVisible(done)
        self.retake_button.setEnabled(done and not self.running and self.strip.currentRow() >= 0)
        self.another_button.setVisible(done)
        self.another_button.setEnabled(not self.running)
        self.changed.emit()
