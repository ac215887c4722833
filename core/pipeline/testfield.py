"""Before stage 1: a testfield to print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from core.errors import InputError
from core.model import Testfield
from core.progress import SILENT, Progress
from core.project import atomic_write, read_project, read_testfield

if TYPE_CHECKING:
    from core.report.board import Sheet


def sheet_of(testfield: Testfield, name: str = "") -> Sheet:
    """Lay out a testfield for printing as its kind of target is drawn."""
    from core.measure import kind_of
    from core.report.board import board_sheet

    kind = kind_of(testfield)
    patches = [] if kind.drawn is None else [(patch.outline_mm, patch.ink) for patch in kind.drawn(testfield)]
    return board_sheet(testfield, name, patches, dots=kind.round)


def print_testfield(source: Path | Testfield, out: Path, progress: Progress = SILENT, *, name: str = "") -> Sheet:
    """Write a testfield as a sheet to print at true size.

    Parameters
    ----------
    source : Path or Testfield
        A project (its testfield.csv), a CSV file with targets, or the targets.
    out : Path
        Ends in .pdf or .svg.
    name : str
        Printed on the sheet; a project's own name if empty.
    """
    from core.report.board import sheet_pdf, sheet_svg

    out = Path(out)
    if out.suffix.lower() not in (".pdf", ".svg"):
        raise InputError(out, f"ends in {out.suffix!r}", "give a file name ending in .pdf or .svg")
    where = "testfield"
    if isinstance(source, Testfield):
        testfield = source
    else:
        path = Path(source)
        if path.is_dir():
            name = name or read_project(path).name
            path = path / "testfield.csv"
        testfield, where = read_testfield(path), str(path)
    try:
        sheet = sheet_of(testfield, name)
    except InputError as error:
        raise InputError(where, error.seen, error.remedy) from error
    content = sheet_pdf(sheet) if out.suffix.lower() == ".pdf" else sheet_svg(sheet).encode()
    progress.check()
    with atomic_write(out) as file:
        file.write(content)
    progress(1.0, f"{out.name} written")
    return sheet
