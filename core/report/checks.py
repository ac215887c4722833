"""The checks of a rig before its first calibration as one HTML file: a sentence and a picture or curve each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from core.atomic import atomic_write
from core.model import Finding
from core.report.figures import Drawing
from core.report.figures.canvas import CAMERA, colour_bar, drawing_style, new_figure, plain_axes
from core.report.html import set_page

HEIGHT_IN = 3.0


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
    return Drawing(key, "checks", title, seen, f"{title}: {seen}.", figure)


def _curve(check: Finding) -> Figure:
    figure = new_figure(HEIGHT_IN)
    axes = figure.add_subplot()
    x, y = np.array(check.curve).T
    axes.plot(x, y, color=CAMERA, marker="o", markersize=3.5, linewidth=1.2)
    axes.set_xlabel(check.axes[0])
    axes.set_ylabel(check.axes[1])
    axes.set_ylim(min(0.0, float(y.min())), max(float(y.max()) * 1.05, 1e-9))
    plain_axes(axes)
    return figure


def _picture(check: Finding) -> Figure:
    assert check.picture is not None
    figure = new_figure(HEIGHT_IN)
    axes = figure.add_subplot()
    image = axes.imshow(check.picture, cmap="viridis", interpolation="nearest")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_anchor("W")  # where the sentence begins, the scale right beside it
    colour_bar(figure, image, axes, check.picture_label, cax=axes.inset_axes((1.03, 0.0, 0.04, 1.0)))
    return figure
