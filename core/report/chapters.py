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
from dataclasses import fields
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

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


def _figures(module: str, *names: str) -> list[Callable[[ReportData], Sequence[Drawing]]]:
    """Give functions of a module of `core.report.figures`, imported when one is called: drawing takes a second to."""

    def draw(name: str, data: ReportData) -> Any:
        return getattr(import_module(f"core.report.figures.{module}"), name)(data)

    return [partial(draw, name) for name in names]


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
        "Photogrammetric calibration",
        _adjustment_tables,
        [
            *_figures("images", "residuals", "coverage"),
            *_figures("network", "network", "convergence", "correlated"),
            *_figures("rig", "volume"),
        ],
    ),
    "depth": Chapter("Depth calibration", lambda data: [depth_table(data.depth)] if data.depth is not None else []),
    "others": Chapter("Further calibrations", _other_tables),
    "planes": Chapter(
        "Plane-table",
        lambda data: [plane_table(data.evaluations, published_of(data))] if data.evaluations else [],
        _figures("planes", "maps", "histograms"),
    ),
    "response": Chapter(
        "Response of the projector",
        lambda data: [response_table(name, curves) for name, curves in data.responses.items()],
        _figures("rig", "responses"),
    ),
    "drift": Chapter(
        "Drift of the rig", lambda data: [drift_table(chart) for chart in data.drift], _figures("rig", "drift")
    ),
    "merged": Chapter("Merged captures", lambda data: [merged_table(*data.merged)] if data.merged is not None else []),
    "sign-off": Chapter(
        "Sign-off", lambda data: [sign_off_table(data.sign_off, data.evaluations)] if data.sign_off is not None else []
    ),
}


def tables(data: ReportData) -> list[Table]:
    """Give the tables of all chapters: Tables 1 (one per device) to 3, depth calibration, those of added chapters."""
    return [table for key, chapter in CHAPTERS.items() if key != "sign-off" for table in chapter.tables(data)]


def drawings(
    data: ReportData, *, progress: Progress = SILENT, meanwhile: Callable[[], object] = lambda: None
) -> dict[str, tuple[Drawing, ...]]:
    """Draw everything for which there are data, by the key of its chapter; several at once where that is safe.

    `meanwhile` is called where other processes draw.
    """
    from core.report.figures import images, network, planes, rig  # noqa: F401  once, not by every process
    from core.report.figures.canvas import drawing_style, drawn

    # the last ones, of all pixels of the planes, take the longest: begun first, they keep nobody waiting at the end
    pieces = [(key, draw) for key, chapter in reversed(CHAPTERS.items()) for draw in reversed(chapter.drawings)]

    def work(k: int, said: Progress) -> tuple[Drawing, ...]:
        key, draw = pieces[k]
        said(0.0, f"drawing: {CHAPTERS[key].title}")
        return tuple(drawn(drawing) for drawing in draw(data))

    found: dict[str, tuple[Drawing, ...]] = dict.fromkeys(CHAPTERS, ())
    with drawing_style():  # which processes take over
        for (key, _), more in zip(pieces, on_processes(work, len(pieces), progress, meanwhile=meanwhile), strict=True):
            found[key] = (*more, *found[key])
    progress(1.0, "figures drawn")
    return found
