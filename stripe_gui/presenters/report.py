"""What the report will say, and the files of the one that is written."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from core.pipeline import load_sign_off
from core.progress import SILENT, Progress
from core.report import Summary, summary
from stripe_gui.presenters.calibrate import gather
from stripe_gui.presenters.folder import ProjectFolder, written_ns


@dataclass(frozen=True)
class ReportView:
    """The summary of the results there are, and the report's files; a file is None where it is not written."""

    summary: Summary
    html: Path | None
    pdf: Path | None
    written: str


def load_report(folder: ProjectFolder, progress: Progress = SILENT) -> ReportView:
    """Sum the results up and look for the files.

    Raises
    ------
    InputError
        If a result is damaged.
    """
    data = gather(folder)
    data = replace(data, sign_off=load_sign_off(folder.project, data.evaluations))
    progress.check()
    files = [folder.result_file(f"report/report.{kind}") for kind in ("html", "pdf")]
    html, pdf = (file if file.is_file() else None for file in files)
    at = written_ns(html) if html else None
    written = f"{datetime.fromtimestamp(at / 1e9):%Y-%m-%d %H:%M}" if at else ""
    return ReportView(summary(data), html, pdf, written)
