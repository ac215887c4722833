"""The chapters of the report, in their order: a registry, so that a program may add one of its own.

Examples
--------
A chapter that lists the captures; it comes last, and is left out of reports that have nothing for it:

>>> from core.report import CHAPTERS, Chapter, Table
>>> def list_captures(data):
...     rows = tuple((folder.name,) for folder in data.project.captures)
...     return [Table("Captures", ("capture",), rows)] if rows else []
>>> CHAPTERS["captures"] = Chapter("Captures", list_captures)
>>> del CHAPTERS["captures"]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from core.progress import SILENT, Progress
from core.report.data import ReportData
from core.report.numbers import adjustment_table, depth_table, interior_tables, plane_table, published_of
from core.report.sign_off import sign_off_table
from core.report.table import Table

if TYPE_CHECKING:
    from core.report.figures import Drawing


def _no_drawings(data: ReportData) -> Sequence[Drawing]:
    return ()


@dataclass(frozen=True)
class Chapter:
    """A chapter: its title, its tables, and its drawings, drawn inside `core.report.figures.canvas.drawing_style`.

    A report that has neither tables nor drawings for it leaves it out.
    """

    title: str
    tables: Callable[[ReportData], Sequence[Table]]
    drawings: Callable[[ReportData], Sequence[Drawing]] = _no_drawings


def _adjustment_tables(data: ReportData) -> list[Table]:
    published = published_of(data)
    found = [*interior_tables(data, published)]
    if data.adjustment is not None or data.photogrammetric is not None:
        found.append(adjustment_table(data, published))
    return found


def _adjustment_drawings(data: ReportData) -> list[Drawing]:
    from core.report.figures.images import image_drawings  # drawing takes a second to import
    from core.report.figures.network import network_drawings

    return [] if data.adjustment is None else [*image_drawings(data.adjustment), *network_drawings(data.adjustment)]


def _plane_tables(data: ReportData) -> list[Table]:
    return [plane_table(data.evaluations, published_of(data))] if data.evaluations else []


def _plane_drawings(data: ReportData) -> Sequence[Drawing]:
    from core.report.figures.planes import plane_drawings

    return plane_drawings(data) if data.evaluations else ()


def _depth_tables(data: ReportData) -> list[Table]:
    return [depth_table(data.depth)] if data.depth is not None else []


def _signed(data: ReportData) -> list[Table]:
    return [sign_off_table(data.sign_off, data.evaluations)] if data.sign_off is not None else []


CHAPTERS: dict[str, Chapter] = {
    "adjustment": Chapter("Photogrammetric calibration", _adjustment_tables, _adjustment_drawings),
    "depth": Chapter("Depth calibration", _depth_tables),
    "planes": Chapter("Plane-table", _plane_tables, _plane_drawings),
    "sign-off": Chapter("Sign-off", _signed),
}


def tables(data: ReportData) -> list[Table]:
    """Give the tables of all chapters: Tables 1 (one per device) to 3, the depth calibration, those of added chapters.

    Raises
    ------
    InputError
        If the project names published results that are not known.
    """
    return [table for key, chapter in CHAPTERS.items() if key != "sign-off" for table in chapter.tables(data)]


def drawings(data: ReportData, *, progress: Progress = SILENT) -> dict[str, tuple[Drawing, ...]]:
    """Draw everything for which there are data, by the key of its chapter."""
    from core.report.figures.canvas import drawing_style

    found = {}
    with drawing_style():
        for i, (key, chapter) in enumerate(CHAPTERS.items()):
            progress(i / len(CHAPTERS), f"drawing: {chapter.title}")
            found[key] = tuple(chapter.drawings(data))
    progress(1.0, "figures drawn")
    return found
