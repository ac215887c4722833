"""The report: sign-off, writing it, what it says, opening it and handing it over."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QCheckBox, QWidget

from stripe_gui.pages.page import Page
from stripe_gui.presenters.report import ReportView, Wishes, export_files, load_report, write_signed_report
from stripe_gui.presenters.stages import State
from stripe_gui.presenters.status import methods_of
from stripe_gui.presenters.told import told
from stripe_gui.widgets.layout import boxed, card, column, emptied, label, row, scrolled
from stripe_gui.widgets.sign_off import SignOffForm
from stripe_gui.widgets.verdict import VerdictList
from stripe_gui.workbench import Workbench

WIDTH = 432  # px of what is typed and ticked


class ReportPage(Page):
    """To the left who signs and which files are wanted; to the right what the report says."""

    id = stage = "report"

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench, self.tr("Report"), self.tr("All tables and figures in one HTML file and one PDF, ready to sign off.")
        )
        self._view: ReportView | None = None
        self._signed_in: Path | None = None  # the project whose sign-off is shown
        self.html_button = self.add_button(self.tr("Open HTML"), lambda: self._open("html"), "report")
        self.pdf_button = self.add_button(self.tr("Open PDF"), lambda: self._open("pdf"), "report")
        self.export_button = self.add_button(self.tr("Export…"), self.export, "export")
        self.export_button.setToolTip(self.tr("Choose a folder for the ticked files."))
        self.run_button = self.add_button(self.tr("Write report"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Sign if a name is given, and write HTML and PDF (F5)."))
        self.signing = SignOffForm()
        scroll = scrolled(boxed(column(self.signing, self._files_card(), None)), across=False)
        scroll.setFixedWidth(WIDTH)
        self.verdicts = VerdictList(whole=True)
        self._sentences = column(spacing=10)
        frame = card(self._sentences, title=self.tr("What it says"), spacing=10)
        self.body.addLayout(row(scroll, scrolled(boxed(column(self.verdicts, frame, None)))), 1)
        self.sentences: list[str] = []

    def _files_card(self) -> QWidget:
        self.files = label("", wrap=True)
        self.wanted = {
            "report": QCheckBox(self.tr("Report: HTML and PDF")),
            "tables": QCheckBox(self.tr("All tables as CSV")),
            "profiles": QCheckBox(self.tr("Profiles along the line as CSV")),
            "deviations": QCheckBox(self.tr("Deviations of every pixel as CSV")),
        }
        for name, box in self.wanted.items():
            box.setChecked(getattr(Wishes, name))
        return card(self.files, *self.wanted.values(), title=self.tr("Files"))

    def run(self) -> None:
        self._remember()
        self.bench.run_stage("report", write_signed_report, self.signing.sign_off(), on_done=self._told)

    def can_run(self) -> bool:
        return self.session.is_open and bool(methods_of(self.session.opened))

    def export(self) -> None:
        """Ask for a folder and write the chosen files there."""
        out = self.bench.dialogs.open_folder(self, self.tr("Export the report into a folder"), Path.home())
        if out is None:
            return
        self._remember()
        done = self.tr("{n} files written to {folder}.")
        wishes = Wishes(**{name: box.isChecked() for name, box in self.wanted.items()})
        self.bench.run_stage(
            "report",
            export_files,
            self.signing.sign_off(),
            self.session.line,
            wishes,
            out,
            on_done=lambda files: self.bench.notify("success", done.format(n=len(files), folder=out)),
        )

    def refresh(self) -> None:
        self.run_button.setEnabled(self.can_run())
        self.export_button.setEnabled(self.can_run())
        if self.session.is_open:
            failed = self.bench.report_failure
            self.bench.views.run("report", load_report, self.session.folder, on_done=self._show, on_failed=failed)

    def _show(self, view: ReportView) -> None:
        before, self._view = self._view, view
        self.html_button.setEnabled(view.html is not None)
        self.pdf_button.setEnabled(view.pdf is not None)
        failed = [name for name, found in view.summary.verdicts if found.state == "failed"]
        self.signing.show_evaluations(view.evaluations, failed)
        folder = self.session.folder
        if folder is not None and (
            before is None or folder.path != self._signed_in or view.sign_off != before.sign_off
        ):
            self._signed_in = folder.path
            self.signing.fill(view.sign_off, self.bench.settings.text("instrument"))
        status = self.session.statuses.get("report")
        if view.html is None:
            text = self.tr("Not written yet.")
        else:
            text = self.tr("Written {when} in {folder}.").format(when=view.written, folder=view.html.parent)
            if status is not None and status.state is State.STALE:
                text += " " + self.tr("Out of date: {reason}.").format(reason=status.reason)
        self.files.setText(text)
        found = view.summary
        self.verdicts.show_verdicts({name: v for name, v in found.verdicts if v.state != "passed"})
        sentences = [
            *map(told, found.findings),
            *(f"⚠ {told(text)}" for text in found.warnings),
            *(f"– {told(text)}" for text in found.missing),
        ]
        if sentences != self.sentences:
            self.sentences = sentences
            self._fill(sentences)

    def _fill(self, sentences: list[str]) -> None:
        emptied(self._sentences)
        for text in sentences or [self.tr("There are no results yet.")]:
            self._sentences.addWidget(label(text, wrap=True))

    def _remember(self) -> None:
        signed = self.signing.sign_off()
        if signed is not None:
            self.bench.settings.set("instrument", signed.instrument)

    def _open(self, kind: str) -> None:
        path: Path | None = getattr(self._view, kind, None)
        if path is not None:
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))

    def _told(self, _paths: object) -> None:
        self.bench.notify("success", self.tr("The report is written: HTML and PDF."))
