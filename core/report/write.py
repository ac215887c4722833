"""Both files of the report, written whole or not at all."""

from __future__ import annotations

from pathlib import Path

from core.atomic import write_together
from core.progress import SILENT, Progress
from core.report.data import ReportData, ReportPaths
from core.report.seal import sealed


def write_report(data: ReportData, out: Path, *, progress: Progress = SILENT) -> ReportPaths:
    """Write `report.html` and `report.pdf` into a folder, in place of those that are there."""
    # only now: drawing and typesetting take a second to import, and tables alone need neither
    from core.report.document import compose

    document = compose(data, progress=progress.part(0.0, 0.8), meanwhile=_typesetting)
    from core.report.html import html_text
    from core.report.pdf import pdf_bytes

    html = html_text(document, progress=progress.part(0.8, 0.85)).encode("utf-8")
    pdf = pdf_bytes(document, progress=progress.part(0.85, 0.95))
    progress.check()
    paths = ReportPaths(Path(out) / "report.html", Path(out) / "report.pdf", data.outdated)
    contents = {paths.html: html, paths.pdf: pdf}
    write_together({path: sealed(content, path.suffix, data.sign_off) for path, content in contents.items()})
    progress(1.0, "report written")
    return paths


def _typesetting() -> None:
    """Load what sets the pages."""
    from core.report import html  # noqa: F401
    from core.report.pdf import register_fonts

    register_fonts()
