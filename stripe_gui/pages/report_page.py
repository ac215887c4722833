"""The report: what it says, writing it, opening and exporting it."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QVBoxLayout, QWidget

from core.pipeline import export_report
from stripe_gui.pages.page import Page
from stripe_gui.presenters.report import ReportView, load_report
from stripe_gui.presenters.status import State
from stripe_gui.presenters.work import write_report
from stripe_gui.widgets.layout import button, card, label, row, scrolled
from stripe_gui.workbench import Workbench


class ReportPage(Page):
    """The summary of the results, and the files made of them."""

    id = stage = "report"

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench, self.tr("Report"), self.tr("All tables and figures in one HTML file and one PDF, ready to sign off.")
        )
        self._view: ReportView | None = None
        self.run_button = self.add_button(self.tr("Write report"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Evaluate the planes and write HTML and PDF (F5)."))
        files, layout = card(self.tr("Files"))
        self.files = label("", wrap=True)
        self.html_button = button(self.tr("Open HTML"), lambda: self._open(self._view.html), "report")
        self.pdf_button = button(self.tr("Open PDF"), lambda: self._open(self._view.pdf), "report")
        self.export_button = button(self.tr("Export…"), self.export, "export")
        self.export_button.setToolTip(self.tr("Copy HTML and PDF, and the tables as CSV, into a folder."))
        layout.addWidget(self.files)
        layout.addLayout(row(self.html_button, self.pdf_button, self.export_button, None))
        self.body.addWidget(files)
        frame, self._sentences = card(self.tr("What it says"))
        frame.layout().setSpacing(10)
        inner = QWidget()
        outer = QVBoxLayout(inner)
        outer.setContentsMargins(0, 0, 0, 0)
        outer.addWidget(frame)
        outer.addStretch(1)
        self.body.addWidget(scrolled(inner), 1)
        self.sentences: list[str] = []

    def run(self) -> None:
        """Write the report in the background."""
        self.bench.run_stage("report", write_report, on_done=self._told)

    def can_run(self) -> bool:
        """Say whether there is anything to report."""
        folder = self.session.folder
        if folder is None:
            return False
        return any(folder.result_file(f"{m}.npz").exists() for m in ("photogrammetric", "polynomial"))

    def export(self) -> None:
        """Ask for a folder and copy the report there, with its tables."""
        out = self.bench.dialogs.open_folder(self, self.tr("Export the report into a folder"), Path.home())
        if out is None:
            return
        files = self.bench.guarded(export_report, self.session.folder.project, out)
        if files is not None:
            self.bench.notify("success", self.tr("{n} files written to {folder}.").format(n=len(files), folder=out))

    def refresh(self) -> None:
        """Sum up the results there are."""
        self.run_button.setEnabled(self.can_run())
        if self.session.is_open:
            self.bench.views.run(
                "report",
                load_report,
                self.session.folder,
                on_done=self._show,
                on_failed=self.bench.report_failure,
            )

    def _show(self, view: ReportView) -> None:
        self._view = view
        self.html_button.setEnabled(view.html is not None)
        self.pdf_button.setEnabled(view.pdf is not None)
        self.export_button.setEnabled(view.html is not None and view.pdf is not None)
        status = self.session.statuses.get("report")
        if view.html is None:
            text = self.tr("Not written yet.")
        else:
            text = self.tr("Written {when} in {folder}.").format(when=view.written, folder=view.html.parent)
            if status is not None and status.state is State.STALE:
                text += " " + self.tr("Out of date: {reason}.").format(reason=status.reason)
        self.files.setText(text)
        found = view.summary
        sentences = [
            *found.findings,
            *(f"⚠ {text}" for text in found.warnings),
            *(f"– {text}" for text in found.missing),
        ]
        if sentences != self.sentences:
            self.sentences = sentences
            self._fill(sentences)

    def _fill(self, sentences: list[str]) -> None:
        while self._sentences.count() > 1:  # the heading stays
            widget = self._sentences.takeAt(1).widget()
            widget.hide()
            widget.deleteLater()
        for text in sentences or [self.tr("There are no results yet.")]:
            self._sentences.addWidget(label(text, wrap=True))

    def _open(self, path: Path | None) -> None:
        if path is not None:
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))

    def _told(self, _paths: object) -> None:
        self.bench.notify("success", self.tr("The report is written: HTML and PDF."))
