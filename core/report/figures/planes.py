"""Deviation maps and histograms of the plane-table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import ceil, floor, log10

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.patches import StepPatch
from numpy.typing import NDArray

from core.digits import fixed
from core.model import Method, PlaneEvaluation
from core.report.data import ReportData, captures_in_order, finite_deviations
from core.report.figures.canvas import (
    BAR_IN,
    FILL,
    GRID,
    INK,
    MUTED,
    NO_DATA,
    PROJECTOR,
    WIDTH_IN,
    Drawing,
    axes_below,
    colour_bar,
    drawable,
    new_figure,
    plain_axes,
    shortened,
)
from core.report.figures.strokes import DPI

COLUMNS = 4  # planes side by side in one figure
Captures = list[tuple[str, float | None]]
Evaluations = tuple[PlaneEvaluation, ...]


def maps(data: ReportData) -> list[Drawing]:
    """Maps through every camera, at most four captures in a figure, all on one scale.

    A row is of one method and, where there are several, of one of those that made points with the camera.
    """
    return _in_parts(data, _maps)


def histograms(data: ReportData) -> list[Drawing]:
    """Histograms, in the same order and on the same scale."""
    return _in_parts(data, _histograms)


def _in_parts(data: ReportData, draw: Callable[[Captures, Evaluations, float], Drawing]) -> list[Drawing]:
    mapped = tuple(e for e in data.evaluations if np.isfinite(e.deviation_mm).any())
    if not mapped:
        return []
    limit_mm = data.colour_limit_mm or colour_limit_mm(mapped)
    found: list[Drawing] = []
    for camera in dict.fromkeys(e.devices[0] for e in mapped):
        own = tuple(e for e in mapped if e.devices[0] == camera)
        of = "" if len({e.devices for e in mapped}) == 1 else f" Of {camera}."
        captures = captures_in_order(own)
        across = ceil(len(captures) / ceil(len(captures) / COLUMNS))  # rows of about equal length
        for i in range(0, len(captures), across):
            drawing = draw(captures[i : i + across], own, limit_mm)
            found.append(replace(drawing, caption=drawing.caption + of))
    return _numbered(found)


def _rows(evaluations: Evaluations) -> dict[tuple[Method, str], str]:
    """Name the rows of a camera's figure, by method and who made the points with it."""
    found = dict.fromkeys((e.method, e.devices[1]) for e in evaluations)
    several = len({by for _, by in found}) > 1
    return {(method, by): f"{method}\n{drawable(shortened(by, 22))}" if several else method for method, by in found}


def _lines(rows: Mapping[tuple[Method, str], str]) -> int:
    """Count the lines in which each row is named."""
    return 1 + max(label.count("\n") for label in rows.values())


def _numbered(figures: list[Drawing]) -> list[Drawing]:
    """Number the figures that show one thing in several parts."""
    if len(figures) == 1:
        return figures
    n = len(figures)
    return [replace(f, key=f"{f.key}-{i}", title=f"{f.title}, {i} of {n}") for i, f in enumerate(figures, 1)]


def colour_limit_mm(evaluations: Evaluations) -> float:
    """End of the common scale: three times the largest r.m.s. of a map, rounded up to a fifth of its power of ten.

    The r.m.s. is that of the map after its greatest hundredth is left aside, so that a few gross errors do not make
    every map look empty.
    """
    spreads = []
    for evaluation in evaluations:
        values = np.abs(finite_deviations(evaluation))
        spreads.append(float(np.sqrt(np.mean(values[values <= np.quantile(values, 0.99)] ** 2))))
    wanted = 3 * max(spreads)
    if not wanted > 0:
        return 1e-3
    step = 10.0 ** floor(log10(wanted)) / 5
    return round(ceil(wanted / step - 1e-9) * step, 12)


def _maps(captures: Captures, evaluations: Evaluations, limit_mm: float) -> Drawing:
    rows = _rows(evaluations)
    height, width = max(e.deviation_mm.shape for e in evaluations)
    named_in, title_in = 0.15 + 0.15 * _lines(rows), 0.3
    cell_in = (WIDTH_IN - named_in) / max(len(captures), 2) - 0.1
    figure, axes = new_figure(
        min(len(rows) * (cell_in * height / width + title_in) + 0.15 + BAR_IN, 11.0),
        len(rows),
        len(captures),
        left=named_in,
        right=0.1,
        top=0.15 + title_in,
        bottom=BAR_IN,
        across=0.1,
        down=title_in,
    )
    colours = colormaps["RdBu_r"].with_extremes(bad=NO_DATA)
    scale = Normalize(-limit_mm, limit_mm)
    for row, (of, label) in enumerate(rows.items()):
        for column, capture in enumerate(captures):
            _map(axes[row, column], _find(evaluations, capture[0], of), colours, scale, round(cell_in * DPI))
            if row == 0:
                axes[row, column].set_title(f"{_heading(capture)}\n{axes[row, column].get_title()}")
            axes[row, column].yaxis.set_visible(column == 0)
        axes[row, 0].set_ylabel(label)
    shown = [finite_deviations(e) for e in evaluations if e.capture in dict(captures)]
    beyond = float(np.mean(np.abs(np.concatenate(shown)) > limit_mm))
    extend = "both" if beyond else "neither"
    mappable = ScalarMappable(scale, colours)
    label = "deviation from the fitted plane in mm (+ towards the camera)"
    colour_bar(mappable, axes_below(figure), label, orientation="horizontal", extend=extend)
    caption = (
        f"Deviations from the fitted plane, every panel a view through the camera, on one scale of ±{limit_mm:g} mm "
        f"({beyond:.2%} of the pixels lie beyond it). Even grain is noise of the phases; patches, waves and bent edges "
        "are systematic errors of the calibration. Grey: no measurement."
    )
    panels = ", ".join(_heading(c).replace("\n", " ") for c in captures)
    return Drawing(
        "deviations",
        "Deviation maps of the plane-table",
        caption,
        f"Colour maps of the deviations, rows {_in_a_line(rows)}, columns {panels}; figures in Table 3.",
        figure,
    )


def _map(axes: Axes, evaluation: PlaneEvaluation | None, colours: Colormap, scale: Normalize, most: int) -> None:
    axes.xaxis.set_visible(False)  # neither drawn nor asked for its place
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_edgecolor(GRID)
    if evaluation is None:
        axes.text(0.5, 0.5, "not evaluated", ha="center", va="center", color=MUTED, transform=axes.transAxes)
        return
    axes.imshow(_printed(evaluation.deviation_mm, most), cmap=colours, norm=scale, interpolation="none")
    axes.set_title(f"r.m.s. {fixed(evaluation.rms_mm, 3)} mm")


def _printed(values: NDArray[np.float32], most: int) -> NDArray[np.float32]:
    """Give the pixels that are printed of an image: `most` in a row."""
    height, width = values.shape
    if width <= most:
        return values
    rows, columns = (np.arange(n * most // width) * width // most for n in (height, width))
    return values[np.ix_(rows, columns)]


def _histograms(captures: Captures, evaluations: Evaluations, limit_mm: float) -> Drawing:
    rows = _rows(evaluations)
    figure, axes = new_figure(
        min(len(rows) * 1.75 + 0.9, 11.0),
        len(rows),
        len(captures),
        left=0.5 + 0.15 * _lines(rows),
        top=0.55,
        bottom=0.5,
        across=0.12,
        down=0.15,
        sharex=True,
        sharey=True,
    )
    edges = np.linspace(-limit_mm, limit_mm, 62)
    for row, (of, label) in enumerate(rows.items()):
        for column, capture in enumerate(captures):
            _histogram(axes[row, column], _find(evaluations, capture[0], of), edges)
            if row == 0:
                axes[row, column].set_title(_heading(capture))
        axes[row, 0].set_ylabel(f"{label}\n% of pixels")
    top = max(a.get_ylim()[1] for a in axes.flat)
    axes[0, 0].set_ylim(0, top * 1.28)  # room for the figures above the bars
    axes[0, 0].set_xlim(-limit_mm, limit_mm)
    figure.supxlabel("deviation in mm", fontsize=8.5)
    handles = {label: h for a in axes.flat for h, label in zip(*a.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="upper center", ncols=3)
    caption = (
        "How the deviations are distributed (bars), and the normal distribution that the noise of the phases predicts "
        "(dashed). Bars wider than the curve mean errors beyond noise; a shoulder or a second peak means that part of "
        "the plane is bent. Deviations beyond the ends of the axis are counted in the panel."
    )
    return Drawing(
        "histograms",
        "Distribution of the deviations",
        caption,
        f"Histograms of the deviations, rows {_in_a_line(rows)}; r.m.s. and predicted r.m.s. are in Table 3.",
        figure,
    )


def _histogram(axes: Axes, evaluation: PlaneEvaluation | None, edges: NDArray[np.float64]) -> None:
    plain_axes(axes)
    axes.locator_params(axis="x", nbins=5, prune="both")  # the next panel begins at its end
    if evaluation is None:
        axes.text(0.5, 0.5, "not evaluated", ha="center", va="center", color=MUTED, transform=axes.transAxes)
        return
    values = finite_deviations(evaluation)
    counts, _ = np.histogram(values, len(edges) - 1, (edges[0], edges[-1]))  # evenly wide, it sorts nothing
    heights = 100 * counts / len(values)
    axes.add_artist(StepPatch(heights, edges, fill=True, color=FILL, linewidth=0, label="measured"))
    axes.update_datalim([(edges[0], 0.0), (edges[-1], heights.max())])  # which stairs look for edge by edge
    axes.autoscale_view()
    lines = [f"r.m.s. {fixed(evaluation.rms_mm, 3)}"]
    if evaluation.predicted_rms_mm:
        s, step = evaluation.predicted_rms_mm, edges[1] - edges[0]
        x = np.linspace(edges[0], edges[-1], 241)
        density = 100 * step / (s * np.sqrt(2 * np.pi)) * np.exp(-0.5 * (x / s) ** 2)
        axes.plot(x, density, color=PROJECTOR, lw=1.4, dashes=(4, 2), label="normal, with the predicted r.m.s.")
        lines.append(f"predicted {fixed(s, 3)}")
    beyond = len(values) - int(counts.sum())
    if beyond:
        lines.append(f"{beyond} beyond")
    axes.text(0.03, 0.98, "\n".join(lines), va="top", fontsize=7, color=INK, transform=axes.transAxes)


def _find(evaluations: Evaluations, capture: str, of: tuple[Method, str]) -> PlaneEvaluation | None:
    return next((e for e in evaluations if e.capture == capture and (e.method, e.devices[1]) == of), None)


def _in_a_line(rows: Mapping[tuple[Method, str], str]) -> str:
    return " and ".join(label.replace("\n", " by ") for label in rows.values())


def _heading(capture: tuple[str, float | None]) -> str:
    name, angle = capture
    return drawable(shortened(name, 22)) + ("" if angle is None else f", {angle:g}°")
