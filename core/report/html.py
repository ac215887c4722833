"""The report as one HTML file that needs nothing else: no network, no script, figures and style within."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from core.progress import SILENT, Progress
from core.report.document import Document
from core.report.figures import Drawing, svg_text
from core.report.table import cell_text, numeric_columns
from core.resources import resource


def html_text(document: Document, *, progress: Progress = SILENT) -> str:
    """Set the report in HTML: light and dark as the reader's system is, and fit to print."""
    shown = [drawing for section in document.sections for drawing in section.drawings]
    return set_page("report.html.j2", shown, progress, document=document)


def set_page(template: str, drawings: Sequence[Drawing], progress: Progress = SILENT, **values: Any) -> str:
    """Fill a template of `resources/report`: style and drawings within, light and dark as the reader's system is."""
    environment = Environment(
        loader=FunctionLoader(_template),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        cell=cell_text,
        numeric=numeric_columns,
        heading=_heading,
        slug=lambda table: re.sub(r"[^a-z0-9]+", "-", table.title.split(".")[0].lower()),
    )
    svg = {drawing.key: _inline(drawing) for drawing in progress.over(drawings, "setting figures")}
    alternatives = {drawing.key: drawing.alternative for drawing in drawings}
    page = environment.get_template(template)
    return page.render(svg=svg, alternatives=alternatives, style=Markup(_template("report.css")), **values)


def _inline(drawing: Drawing) -> Markup:
    """Give the drawing as an inline SVG that scales with the page and is announced by its text alternative."""
    text = svg_text(drawing)
    head, rest = text[: text.index(">")], text[text.index(">") :]
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    # the text alternative is the figure's, given by the template; readers must not walk through the paths
    return Markup(f'{head} aria-hidden="true" focusable="false"{rest}')


def _heading(column: str) -> tuple[str, str]:
    name, _, unit = column.partition(" [")
    return name, unit.rstrip("]")


def _template(name: str) -> str:
    return resource("report", name).read_text(encoding="utf-8")
