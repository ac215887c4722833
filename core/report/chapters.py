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
from dataclasses import fields, replace
from typing import TYPE_CHECKING

from core.lazy import dataclass
from core.parallel import on_processes
from core.progress import SILENT, Progress
from core.report.data import ReportData
from core.report.numbers import (
    adjustment_table,
    depth_table,
    drift_table,
    interior_tables,
    merged_table,
    plane_table,
    published_of,
    response_table,
    volume_table,
)
from core.report.sign_off import sign_off_table
from core.report.table import Number, Table

if TYPE_CHECKING:
    from core.report.figures import Drawing


@dataclass(frozen=True)
class Chapter:
    """A chapter: its title, its tables, and its drawings, in the order of the functions that draw them.

    These are called inside `core.report.figures.canvas.drawing_style`, each in a process of its own where that is safe.
    A report that has neither tables nor drawings for a chapter leaves it out.
    """

    title: str
    tables: Callable[[ReportData], Sequence[Table]]
    drawings: Sequence[Callable[[ReportData], Sequence[Drawing]]] = ()


def _adjustment_tables(data: ReportData) -> list[Table]:
    published = published_of(data)
    found = [*interior_tables(data, published)]
    if data.adjustment is not None or data.photogrammetric is not None:
        found.append(adjustment_table(data, published))
    if data.volume is not None:
        found.append(volume_table(data.volume[0]))
    return found


def _image_drawings(data: ReportData) -> Sequence[Drawing]:
    from core.report.figures.images import image_drawings  # drawing takes a second to import

    return image_drawings(data.adjustment) if data.adjustment is not None else ()


def _network_drawings(data: ReportData) -> Sequence[Drawing]:
    from core.report.figures.network import network_drawings

    return network_drawings(data.adjustment) if data.adjustment is not None else ()


def _volume_drawings(data: ReportData) -> Sequence[Drawing]:
    from core.report.figures.rig import volume_drawing

    if data.volume is None:
        return ()
    figures, maps = data.volume
    drawing = volume_drawing(figures["depths"], maps["form_sigma_mm"])
    of = " Of {camera} with {projector}.".format(**figures) if "camera" in figures else ""
    return [replace(drawing, caption=drawing.caption + of)]


def _plane_drawings(data: ReportData) -> Sequence[Drawing]:
    from core.report.figures.planes import plane_drawings

    return plane_drawings(data) if data.evaluations else ()


def _drift_drawings(data: ReportData) -> Sequence[Drawing]:
    from core.report.figures.rig import drift_drawing

    return [drift_drawing(chart) for chart in data.drift]


def _response_drawings(data: ReportData) -> Sequence[Drawing]:
    from core.report.figures.rig import response_drawing

    return [response_drawing(name, curves) for name, curves in data.responses.items()]


def _other_tables(data: ReportData) -> list[Table]:
    """What further methods tell in single numbers."""
    told = {
        title: [(f.name, getattr(made, f.name)) for f in fields(made)]  # type: ignore[arg-type]
        for title, made in data.others.items()
    }
    numbers = {title: [(k, Number(v, "g")) for k, v in of if isinstance(v, int | float)] for title, of in told.items()}
    return [Table(title.capitalize(), ("quantity", "value"), tuple(rows)) for title, rows in numbers.items() if rows]


CHAPTERS: dict[str, Chapter] = {
    "adjustment": Chapter(
        "Photogrammetric calibration", _adjustment_tables, (_image_drawings, _network_drawings, _volume_drawings)
    ),
    "depth": Chapter("Depth calibration", lambda data: [depth_table(data.depth)] if data.depth is not None else []),
    "others": Chapter("Further calibrations", _other_tables),
    "planes": Chapter(
        "Plane-table",
        lambda data: [plane_table(data.evaluations, published_of(data))] if data.evaluations else [],
        (_plane_drawings,),
    ),
    "response": Chapter(
        "Response of the projector",
        lambda data: [response_table(name, curves) for name, curves in data.responses.items()],
        (_response_drawings,),
    ),
    "drift": Chapter("Drift of the rig", lambda data: [drift_table(chart) for chart in data.drift], (_drift_drawings,)),
    "merged": Chapter("Merged captures", lambda data: [merged_table(*data.merged)] if data.merged is not None else []),
    "sign-off": Chapter(
        "Sign-off", lambda data: [sign_off_table(data.sign_off, data.evaluations)] if data.sign_off is not None else []
    ),
}


def tables(data: ReportData) -> list[Table]:
    """Give the tables of all chapters: Tables 1 (one per device) to 3, depth calibration, those of added chapters."""
    return [table for key, chapter in CHAPTERS.items() if key != "sign-off" for table in chapter.tables(data)]


def drawings(data: ReportData, *, progress: Progress = SILENT) -> dict[str, tuple[Drawing, ...]]:
    """Draw everything for which there are data, by the key of its chapter; several at once where that is safe."""
    from core.report.figures.canvas import drawing_style, drawn

    pieces = [(key, draw) for key, chapter in CHAPTERS.items() for draw in chapter.drawings]

    def work(k: int, said: Progress) -> tuple[Drawing, ...]:
        key, draw = pieces[k]
        said(0.0, f"drawing: {CHAPTERS[key].title}")
        with drawing_style():
            return tuple(drawn(drawing) for drawing in draw(data))

    found: dict[str, tuple[Drawing, ...]] = dict.fromkeys(CHAPTERS, ())
    for (key, _), more in zip(pieces, on_processes(work, len(pieces), progress), strict=True):
        found[key] += more
    progress(1.0, "figures drawn")
    return found
