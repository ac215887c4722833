"""What the report will say, and the files of the one that is written."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from core.errors import InputError
from core.pipeline import load_sign_off
from core.progress import SILENT, Progress
from core.report import Summary, summary, tables, write_table_csv
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


def export_report(folder: ProjectFolder, out: Path, progress: Progress = SILENT) -> list[Path]:
    """Copy the report and write its tables as CSV into a folder; give the files.

    Raises
    ------
    InputError
        If the report is not written yet, or the folder cannot be written to.
    """
    view = load_report(folder, progress)
    if view.html is None or view.pdf is None:
        raise InputError(folder.path, "the report is not written yet", "write it first")
    written = []
    try:
        out.mkdir(parents=True, exist_ok=True)
        for file in (view.html, view.pdf):
            progress.check()
            written.append(Path(shutil.copy2(file, out / file.name)))
    except OSError as error:
        raise InputError(out, f"cannot be written ({error.strerror})", "choose a folder you may write to") from error
    for table in tables(gather(folder)):
        written.append(out / f"{_file_name(table.title)}.csv")
        write_table_csv(written[-1], table)
    return written


def _file_name(title: str) -> str:
    words = title.partition(".")[0] if title.startswith("Table") else title.partition(",")[0]
    return "".join(c if c.isalnum() else "-" for c in words.lower()).strip("-")
