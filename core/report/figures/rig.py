"""Figures of the rig: its control chart, the response of a projector, the uncertainty over the working volume."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from core.digits import fixed
from core.model import DriftPoint
from core.report.data import ReportData
from core.report.figures.canvas import (
    BAR_IN,
    CAMERA,
    FILL,
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
    width_in,
)
from core.report.numbers import DRIFT_ELEMENTS

WARNING, ACTION = 1.96, 3.29  # sigmas, passed by one in 20 and in 1000 at rest
Curves = Mapping[str, NDArray[np.float64]]
HEIGHT_IN = 3.2
NAME_PT = 6


def drift(data: ReportData) -> list[Drawing]:
    """Draw each pair's chart, a panel for each element."""
    return [_drift(chart) for chart in data.drift]


def _drift(chart: Sequence[DriftPoint]) -> Drawing:
    n, names = len(DRIFT_ELEMENTS), [drawable(shortened(p.capture)) for p in chart]
    named_in = 0.15 + max(width_in(name, NAME_PT) for name in names)
    figure, panels = new_figure(1.1 * n + named_in + 0.1, n, left=1.05, top=0.1, bottom=named_in, down=0.1, sharex=True)
    at = np.arange(len(chart))
    offs, sigmas = (np.array(x) for x in zip(*((p.value - p.expected, p.sigma) for p in chart), strict=True))
    for k, (axes, (name, unit, scale)) in enumerate(zip(panels[:, 0], DRIFT_ELEMENTS, strict=True)):
        off, sigma = scale * offs[:, k], scale * sigmas[:, k]
        axes.fill_between(at, -WARNING * sigma, WARNING * sigma, step="mid", color=FILL, alpha=0.5, linewidth=0)
        for sign in (-1, 1):
            axes.step(at, sign * ACTION * sigma, where="mid", color=PROJECTOR, linewidth=0.8)
        axes.plot(at, off, "o-", color=CAMERA, markersize=3, linewidth=0.8)
        top = 1.1 * max(ACTION * float(np.median(sigma)), float(np.abs(off[1:]).max(initial=0.0)))
        axes.set(ylabel=f"{name}\n[{unit}]", ylim=(-top, top))
    axes.set_xticks(at, names, rotation=90, fontsize=NAME_PT)
    camera, projector = chart[0].camera, chart[0].projector
    caption = (
        f"What each capture shows of {projector} against {camera}, less what those before it led to expect; the first "
        "is held against the calibration. Band: warning limits, passed by one capture in 20 at rest; lines: action "
        "limits, by one in 1,000."
    )
    out = [p.capture for p in chart if p.state == "action"]
    alternative = f"{len(chart)} captures; out of control: {', '.join(out) or 'none'}."
    return Drawing(f"drift-{camera}-{projector}", "Control chart of the rig", caption, alternative, figure)


def responses(data: ReportData) -> list[Drawing]:
    """Draw for each projector the curves of all captures, their median, and a straight line."""
    return [_response(projector, curves) for projector, curves in data.responses.items()]


def _response(projector: str, curves: Curves) -> Drawing:
    figure, ((axes,),) = new_figure(HEIGHT_IN)
    level = next(iter(curves.values()))[:, 0]
    each = np.array([np.interp(level, *curve.T) for curve in curves.values()])
    middle = np.median(each, axis=0)
    axes.plot(level, each.T, color=FILL, linewidth=0.8)
    axes.plot([0, 1], [0, 1], color=MUTED, linewidth=0.8, linestyle="--")
    axes.plot(level, middle, color=PROJECTOR, linewidth=1.6)
    axes.set(xlabel="level", ylabel="light", xlim=(0, 1), ylim=(0, 1))
    plain_axes(axes)
    caption = (
        f"How much light {projector} makes of a level, as parts of the greatest, by the fringes of {len(curves)} "
        "captures (thin) and in the median (thick). Dashed: a projector whose light is proportional to the level."
    )
    apart = float(np.abs(each - middle).max())
    alternative = f"Light at half level {np.interp(0.5, level, middle):.3f}; captures differ by up to {apart:.3f}."
    return Drawing(f"response-{projector}", "Response of the projector", caption, alternative, figure)


def volume(data: ReportData) -> list[Drawing]:
    """Maps of sigmas over the working volume: the nearest, the middle and the farthest depth."""
    if data.volume is None:
        return []
    figures, maps = data.volume
    layers, sigma_mm = figures["depths"], maps["form_sigma_mm"]  # (depths, rows, columns)
    shown = [layers[k] for k in sorted({0, len(layers) // 2, len(layers) - 1})]
    _, height, width = sigma_mm.shape
    high = (WIDTH_IN / 3 - 0.1) * height / width + 0.3 + BAR_IN
    figure, panels = new_figure(high, 1, len(shown), left=0.1, right=0.1, top=0.3, bottom=BAR_IN, across=0.1)
    scale = Normalize(0.0, 1e3 * float(np.nanpercentile(sigma_mm, 98)))
    colours = colormaps["Blues"].with_extremes(bad=NO_DATA)
    for axes, row in zip(panels[0], shown, strict=True):
        axes.set_title(f"{fixed(row['depth_mm'], 0)} mm away")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_visible(False)
        axes.imshow(1e3 * sigma_mm[row["layer"]], cmap=colours, norm=scale, interpolation="none")
    mappable = ScalarMappable(scale, colours)
    colour_bar(mappable, axes_below(figure), "σ of form in µm", orientation="horizontal", extend="max")
    caption = (
        "What the calibration's own uncertainty does to a shape, every panel a view through the camera: σ of a point's "
        "place after the best movement of all points as one. It does not become smaller with less noise in a capture. "
        "Strong colour towards edges and depths: no target was captured beyond. Grey: outside the projector's light."
    )
    caption += " Of {camera} with {projector}.".format(**figures) if "camera" in figures else ""
    alternative = f"Maps of the sigma of form at {len(shown)} depths; figures in the table of the working volume."
    return [Drawing("volume", "Uncertainty over the working volume", caption, alternative, figure)]
