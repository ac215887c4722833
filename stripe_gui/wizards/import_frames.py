"""A capture from frames that came from elsewhere: folder, what they are, the sequence, and what was recognised."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLineEdit, QWidget

from core.capture.importing import ImportReport
from core.pipeline.sequences import import_into
from stripe_gui.jobs import Failure, Job
from stripe_gui.presenters.failures import describe
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.importing import FrameFolder, look_in, order_choices, report_lines
from stripe_gui.presenters.sequences import Shown
from stripe_gui.presenters.told import sentence
from stripe_gui.widgets.finding_list import FindingList
from stripe_gui.widgets.layout import boxed, button, card, choice, column, emptied, label, make, row, scrolled
from stripe_gui.widgets.notice import Sign
from stripe_gui.widgets.sequence_form import SequenceForm
from stripe_gui.wizards.capture.subject import SubjectForm
from stripe_gui.wizards.wizard import Wizard
from stripe_gui.workbench import Workbench


class FramesStep(QWidget):
    """The folder with the images, and what it holds."""

    changed = Signal()

    def __init__(self, bench: Workbench) -> None:
        super().__init__()
        self._bench = bench
        self.found = FrameFolder()
        self.folder = make(QLineEdit, accessibleName=self.tr("Folder of the images"))
        self.folder.textChanged.connect(self.look)
        self.choose_button = button(self.tr("Choose…"), self._choose, "folder")
        self.choose_button.setAccessibleName(self.tr("Choose the folder of the images"))
        self.words = label("", wrap=True)
        folder = boxed(row(self.folder, self.choose_button, spacing=8))
        advice = self.tr(
            "All images of one sequence, of the size that the project's camera has. A capture.json beside them says "
            "what each shows. The files stay where they are; the project gets copies."
        )
        frame = card(folder, self.words, label(advice, "muted", wrap=True), title=self.tr("Images"))
        self.setLayout(column(frame, None))

    def look(self) -> None:
        if self._bench.session.is_open:
            session = self._bench.session
            self.found = look_in(self.folder.text(), session.opened.project, session.projector)
            self.words.setText(self.found.words)
        self.changed.emit()

    def _choose(self) -> None:
        here = Path(self.folder.text()).expanduser() if self.folder.text() else Path.home()
        chosen = self._bench.dialogs.open_folder(self, self.tr("Choose the folder that holds the images"), here)
        if chosen is not None:
            self.folder.setText(str(chosen))


class ImportStep(QWidget):
    """Does it, and shows what was recognised, or why it was refused."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.report: ImportReport | None = None
        self.job: Job | None = None
        self.start_button = button(self.tr("Import the frames"), lambda: None, "run", primary=True)
        self.title = label("", "heading")
        self.lines = column(spacing=8)
        frame = card(row(self.title, None, self.start_button), self.lines)
        self.findings = FindingList(self.tr("What the checks said"))
        self.findings.hide()
        self.setLayout(column(frame, (self.findings, 3), None))

    def missing(self) -> str:
        return "" if self.report else self.tr("Import the frames.")

    def say(self, sign: str, lines: list[str]) -> None:
        emptied(self.lines)
        colour = {"success": "ok", "error": "danger", "warning": "warning"}.get(sign, "muted")
        for i, text in enumerate(lines):
            mark = sign if i == 0 else "info"
            sign_ = Sign(mark, colour if i == 0 else "muted")
            self.lines.addWidget(boxed(row(sign_, (label(text, wrap=True), 1), spacing=8)))
        self.changed.emit()


class ImportWizard(Wizard):
    """From a folder of images to a capture of the project."""

    id = "import-wizard"
    stage = "capture"
    by_pair = True

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Import frames"),
            self.tr("Make a capture of images that another program has taken."),
            last=self.tr("Done"),
        )
        self.frames, self.subject, self.importing = FramesStep(bench), SubjectForm(), ImportStep()
        self.sequence = SequenceForm(bench, self.tr("As the folder says, else the project's"))
        which = self.tr("Which image shows which pattern")
        self.order = choice(which, None, *((text, order) for order, text in order_choices()))
        order_row = row(label(which), self.order, None)
        self.add_step("frames", self.tr("Images"), self.frames, missing=lambda: self.frames.found.problem)
        what = boxed(column(self.subject, None))
        self.add_step("subject", self.tr("What"), scrolled(what), missing=self.subject.missing)
        body, title = scrolled(boxed(column(self.sequence, order_row, None)), across=False), self.tr("Sequence")
        self.add_step("sequence", title, body, enter=self._enter_sequence, missing=self._sequence_missing)
        body, title = scrolled(self.importing), self.tr("Import")
        self.add_step("import", title, body, enter=self._enter_import, missing=self.importing.missing)
        for step in (self.frames, self.subject, self.sequence, self.importing):
            step.changed.connect(self.update_steps)
        self.importing.start_button.clicked.connect(self.run)

    def begin(self, folder: ProjectFolder) -> None:
        self.importing.report = None
        self.subject.name.clear()
        self.subject.offer(folder.project)
        self.frames.folder.clear()
        self.frames.look()
        self.sequence.show_spec(None)

    def look_again(self) -> None:
        self.frames.look()  # perhaps by another camera

    def run(self) -> None:
        folder, step = self.session.folder, self.importing
        if folder is None or step.job is not None or step.report is not None:
            return
        step.start_button.setEnabled(False)
        step.say("info", [self.tr("reading and checking the images …")])
        camera, projector = self.session.pair
        subject = replace(self.subject.subject, camera=camera, projector=projector)
        step.job = self.bench.jobs.run(
            subject.name,
            import_into,
            folder.path,
            Path(self.frames.folder.text().strip()).expanduser(),
            subject,
            sequence=self.sequence.spec,
            order=self.order.currentData(),
            stage="capture",
            on_done=self._done,
            on_failed=self._failed,
        )
        step.job.cancelled.connect(lambda: self._end("info", [self.tr("Stopped. Nothing was imported.")]))

    def can_run(self) -> bool:
        return self.step.name == "import" and self.importing.start_button.isEnabled()

    def _done(self, report: ImportReport) -> None:
        self.importing.report = report
        bad = any(finding.level == "bad" for finding in report.findings)
        self._end("warning" if bad else "success", report_lines(report))
        self.importing.findings.show_findings(report.findings)
        self.importing.findings.show()
        self.bench.refresh()
        self.session.choose_capture(report.folder.name)

    def _failed(self, failure: Failure) -> None:
        told = describe(failure.error, failure.trace)
        self._end("error", [f"{sentence(told.happened)}.", f"{sentence(told.remedy)}."])

    def _end(self, sign: str, lines: list[str]) -> None:
        self.importing.job = None
        self.importing.start_button.setEnabled(self.importing.report is None)
        self.importing.say(sign, lines)

    def _enter_sequence(self) -> None:
        lines = self.session.projector.width, self.session.projector.height
        self.sequence.show_projector(Shown(lines, self.frames.found.own, frame_s=0.0))
        if self.sequence.view is None:
            self.sequence.look()

    def _sequence_missing(self) -> str:
        if self.sequence.spec is None and not self.frames.found.own and not self.sequence.missing():
            return self.tr("Choose the sequence: neither the folder nor the project says which it is.")
        return self.sequence.missing()

    def _enter_import(self) -> None:
        step = self.importing
        if step.job is not None:
            return
        subject = self.subject.subject
        if step.report is None or step.report.folder.name != subject.name:
            step.report = None
            step.findings.hide()
            step.title.setText(subject.name)
            step.start_button.setEnabled(True)
            text = self.tr("{n} images become the capture {name}.")
            step.say("info", [text.format(n=self.frames.found.images, name=subject.name)])
