"""The network from above and from the side, the adjustment's convergence, the correlations of its parameters."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from core.model import Adjustment, Array
from core.report.adjusted import Correlations, correlations
from core.report.data import ReportData
from core.report.figures.canvas import (
    GRID,
    MUTED,
    WIDTH_IN,
    Drawing,
    colour_bar,
    device_colour,
    drawable,
    new_figure,
    plain_axes,
    shortened,
    width_in,
)

LEGEND = 4  # entries side by side
MARKERS = ("o", "s", "^", "D", "v", "P")
SCALE_IN = 1.1  # for the colour scale beside a matrix
STRONG = 0.7  # a correlation from here on is written into its cell
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def network(data: ReportData) -> list[Drawing]:
    """Stations and object points of the adjustment."""
    found = data.adjustment
    return [_network(found)] if found and len(found.station_from_object) else []


def convergence(data: ReportData) -> list[Drawing]:
    """How the adjustment came to its end."""
    found = data.adjustment
    return [_convergence(found)] if found and np.isfinite(found.convergence).any() else []


def correlated(data: ReportData) -> list[Drawing]:
    """Which of its parameters stand in for each other."""
    found = correlations(data.adjustment) if data.adjustment else None
    return [_correlations(found)] if found and len(found.names) > 1 else []


def _network(adjustment: Adjustment) -> Drawing:
    """Two views on one scale: along Z onto X, Y and along Y onto X, Z of the object frame."""
    centres = np.array([pose.origin_mm for pose in adjustment.station_from_object])
    looking = np.array([-pose.rotation[2] for pose in adjustment.station_from_object])  # -Z of the device
    points = adjustment.points_mm[np.isfinite(adjustment.points_mm).all(axis=1)]
    middle = points.mean(axis=0) if len(points) else np.zeros(3)
    reach = float(np.median(np.linalg.norm(centres - middle, axis=1)))
    everything = np.concatenate([centres, points])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.08 * max(float((high - low).max()), 1.0)
    low, high = low - margin, high + margin
    rows = -(-(len(adjustment.devices) + 1) // LEGEND)
    top = 0.4 + 0.17 * rows
    height = 3.4 * (high - low)[1:].max() / (high - low)[0] + 0.45 + top
    figure, panels = new_figure(float(np.clip(height, 2.6, 7.0)), 1, 2, top=top, across=0.8)
    axes = panels[0]
    views = ((0, 1, "from above (along Z)"), (0, 2, "from the side (along Y)"))
    for panel, (i, j, title) in zip(axes, views, strict=True):
        _view(panel, adjustment, centres[:, [i, j]], looking[:, [i, j]] * 0.3 * reach, points[:, [i, j]])
        panel.set(xlim=(low[i], high[i]), ylim=(low[j], high[j]))
        panel.set(xlabel=f"{'XYZ'[i]} in mm", ylabel=f"{'XYZ'[j]} in mm")
        panel.set_title(title, loc="left")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=LEGEND)
    caption = (
        "Projection centres of all stations, the object points and, as a stroke from each centre, where the device "
        "looks. A strong network has centres on all sides of the field, so that rays cross at large angles; centres in "
        "one heap or one row determine the interior orientation poorly."
    )
    counts = ", ".join(
        f"{sum(d == name for d in adjustment.network.station_device)} of {name}" for name in adjustment.devices
    )
    alternative = f"Plan and side view of {len(centres)} stations ({counts}) around {len(points)} object points."
    return Drawing("network", "The network", caption, alternative, figure)


def _view(axes: Axes, adjustment: Adjustment, centres: Array, strokes: Array, points: Array) -> None:
    plain_axes(axes)
    axes.plot(*points.T, ".", color=MUTED, ms=2.0, label="object points", rasterized=len(points) > 5000)
    for index, name in enumerate(adjustment.devices):
        mine = np.array([device == name for device in adjustment.network.station_device], bool)
        colour, marker = device_colour(index), MARKERS[index % len(MARKERS)]
        ends = centres[mine] + strokes[mine]
        broken = np.stack([centres[mine], ends, np.full_like(ends, np.nan)], axis=1).reshape(-1, 2)
        axes.plot(*broken.T, color=colour, lw=0.8, alpha=0.7)
        label = drawable(shortened(name))
        axes.plot(*centres[mine].T, marker, color=colour, ms=5, mfc="none" if index % 2 else colour, ls="", label=label)
    axes.set_aspect("equal", anchor="N")
    axes.locator_params(nbins=6)


def _convergence(adjustment: Adjustment) -> Drawing:
    values = np.asarray(adjustment.convergence, dtype=np.float64)
    values = values[np.isfinite(values)]
    figure, ((axes,),) = new_figure(2.6)
    plain_axes(axes)
    steps = np.arange(len(values))
    axes.plot(steps, values, "o-", color=device_colour(0), lw=1.3, ms=4)
    if np.all(values > 0):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(
            FuncFormatter(lambda value, _: _powers(np.format_float_scientific(value, 4, trim="-")))
        )
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set(xlabel="iteration", ylabel="weighted sum of squares vᵀPv")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.margins(x=0.08, y=0.2)
    for i in sorted({0, len(values) - 1}):
        text, at = _powers(f"{values[i]:.5g}"), (steps[i], values[i])
        axes.annotate(text, at, xytext=(0, 7), textcoords="offset points", ha="center", fontsize=8)
    caption = (
        "The weighted sum of squared residuals at every iteration, on a logarithmic scale. A sound adjustment falls "
        "steeply and then stays level; steps up or a slow slope to the end tell of poor initial values or of a "
        "weak network."
    )
    told = ", ".join(f"{v:.4g}" for v in values)
    return Drawing(
        "convergence",
        "Convergence of the adjustment",
        caption,
        f"Weighted sum of squares by iteration: {told}.",
        figure,
    )


def _powers(text: str) -> str:
    """Write a number's exponent, if it has one, as a power of ten: 5.03e+09 is 5.03·10⁹, and 1e+09 is 10⁹."""
    digits, _, exponent = text.partition("e")
    power = "10" + str(int(exponent)).translate(SUPERSCRIPTS) if exponent else digits
    return power if digits == "1" or not exponent else f"{digits}·{power}"


def _correlations(found: Correlations) -> Drawing:
    correlation, names, n = found.values, found.names, len(found.names)
    labels = [drawable(shortened(name, 40)) for name in names]
    size = float(np.clip(180 / n, 3.5, 8.0))
    beside = 0.1 + max(width_in(label, size) for label in labels)
    side = min(max(2.0, 0.27 * n), WIDTH_IN - beside - SCALE_IN)
    left = (WIDTH_IN + beside - side - SCALE_IN) / 2
    figure, ((axes,),) = new_figure(
        side + beside + 0.05, left=left, right=WIDTH_IN - left - side, top=0.05, bottom=beside
    )
    image = axes.imshow(correlation, cmap=colormaps["RdBu_r"], vmin=-1, vmax=1, interpolation="none")
    axes.set_xticks(range(n), labels, rotation=90, fontsize=size)
    axes.set_yticks(range(n), labels, fontsize=size)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_edgecolor(GRID)
    lower = np.tril(np.ones((n, n), bool), -1) & (np.abs(correlation) >= STRONG)
    for i, j in zip(*np.nonzero(lower), strict=True):
        text = f"{100 * correlation[i, j]:.0f}"

        axes.text(j, i, text, ha="center", va="center", fontsize=size * 0.85, color="#ffffff", in_layout=False)
    colour_bar(image, axes.inset_axes((1.05, 0.15, 0.023, 0.7)), "correlation")

    strong = [(abs(correlation[i, j]), i, j) for i, j in zip(*np.nonzero(lower), strict=True)]
    told = "; ".join(f"{names[j]} with {names[i]} {correlation[i, j]:+.2f}" for _, i, j in sorted(strong)[:-6:-1])
    caption = (
        "Correlation of every pair of parameters of interior and relative orientation; below the diagonal those of "
        f"{STRONG:.0%} and more are written in, in per cent. Strongly correlated parameters stand in for each other: "
        "their single values mean little, though together they fit."
    )
    alternative = f"Correlation matrix of {n} parameters. Strongest: {told or f'none reaches {STRONG:g}'}."
    return Drawing("correlations", "Correlations of the parameters", caption, alternative, figure)
