"""The report as one HTML file without network or script, figures and style within; the checks of a rig too."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from core.atomic import atomic_write
from core.model import Finding
from core.progress import SILENT, Progress
from core.report.document import Document
from core.report.figures import Drawing, svg_text
from core.report.figures.canvas import CAMERA, colour_bar, drawing_style, new_figure, plain_axes
from core.report.table import cell_text, numeric_columns
from core.resources import resource

HEIGHT_IN = 3.0


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


def write_checks(checks: Sequence[Finding], title: str, out: Path) -> Path:
    """Write ``preflight.html`` into a folder, whole or not at all; give its path."""
    drawings = [drawing for i, check in enumerate(checks) if (drawing := _drawing(f"check-{i}", check)) is not None]
    text = set_page("checks.html.j2", drawings, title=title, checks=list(enumerate(checks)))
    path = Path(out) / "preflight.html"
    with atomic_write(path) as file:
        file.write(text.encode())
    return path


def _drawing(key: str, check: Finding) -> Drawing | None:
    with drawing_style():
        if check.curve:
            figure, seen = _curve(check), f"{check.axes[1]} against {check.axes[0]}"
        elif check.picture is not None and np.isfinite(check.picture).any():
            figure, seen = _picture(check), f"{check.picture_label} over the camera's image"
        else:
            return None
    title = check.title.capitalize()
    return Drawing(key, title, seen, f"{title}: {seen}.", figure)


def _curve(check: Finding) -> Figure:
    figure, ((axes,),) = new_figure(HEIGHT_IN, left=0.9)
    x, y = np.array(check.curve).T
    axes.plot(x, y, color=CAMERA, marker="o", markersize=3.5, linewidth=1.2)
    axes.set_xlabel(check.axes[0])
    axes.set_ylabel(check.axes[1])
    axes.set_ylim(min(0.0, float(y.min())), max(float(y.max()) * 1.05, 1e-9))
    plain_axes(axes)
    return figure


def _picture(check: Finding) -> Figure:
    assert check.picture is not None
    figure, ((axes,),) = new_figure(HEIGHT_IN, left=0.1, right=1.0, bottom=0.15)
    image = axes.imshow(check.picture, cmap="viridis", interpolation="nearest")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_anchor("W")  # where the sentence begins, the scale right beside it
    colour_bar(image, axes.inset_axes((1.03, 0.0, 0.04, 1.0)), check.picture_label)
    return figure
