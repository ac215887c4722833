"""What lies over the image of every device: residual vectors and coverage."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, floor, log10

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure

from core.model import Adjustment, Array, DeviceSpec
from core.report.adjusted import Coverage, covered
from core.report.data import ReportData, kind_of_device
from core.report.figures.canvas import (
    CAMERA,
    GRID,
    INK,
    MUTED,
    WIDTH_IN,
    Drawing,
    device_colour,
    drawable,
    new_figure,
    shortened,
)

VECTORS_AS_LINES = 8000  # more arrows than this are drawn as an image: lines would make the file heavy


def residuals(data: ReportData) -> list[Drawing]:
    """Residual vectors over the images of all devices of the adjustment."""
    return _of_images(data.adjustment, _residual_vectors)


def coverage(data: ReportData) -> list[Drawing]:
    """Where in these images there are points."""
    return _of_images(data.adjustment, _coverage)


def _of_images(found: Adjustment | None, draw: Callable[[Adjustment, list[str]], Drawing]) -> list[Drawing]:
    seen = [] if found is None else [name for name in found.devices if len(_observations(found, name)[0])]
    return [draw(found, seen)] if found and seen else []


def nice_step(value: float) -> float:
    """Round down to one digit.

    Examples
    --------
    >>> nice_step(370), nice_step(0.03)
    (300.0, 0.03)
    """

    step = 10.0 ** floor(log10(value))
    return float(f"{floor(value / step + 1e-9) * step:.1g}")


def magnification(residuals_um: Array, spec: DeviceSpec) -> float:
    """How many times residual vectors, shape (n, 2), are magnified: 95 % stay below 5 % of the image's width."""
    lengths = np.hypot(*residuals_um.T)
    typical = float(np.quantile(lengths, 0.95)) if len(lengths) else 0.0
    if typical <= 0:
        return 1.0
    return nice_step(0.05 * spec.width * spec.pitch_mm[0] * 1000 / typical)


def _observations(adjustment: Adjustment, name: str) -> tuple[Array, Array]:
    """Image points of a device, (n, 2) px, and residuals, (n, 2) µm; those observed in one coordinate are left out."""
    network = adjustment.network
    mine = np.array([device == name for device in network.station_device], bool)[network.observation_station]
    uv = network.observation_uv[mine]
    pitch_um = 1000 * np.array(adjustment.devices[name].spec.pitch_mm)
    residuals = adjustment.residuals[mine] * pitch_um
    whole = np.isfinite(uv).all(axis=1) & np.isfinite(residuals).all(axis=1)
    return uv[whole], residuals[whole]


def _panels(adjustment: Adjustment, names: list[str], top_in: float) -> tuple[Figure, list[Axes]]:
    """One panel per device in the shape of its image, at most two in a row, with so much room above each."""
    columns = min(len(names), 2)
    rows = ceil(len(names) / columns)
    shape = max(adjustment.devices[n].spec.height / adjustment.devices[n].spec.width for n in names)
    width = WIDTH_IN / columns - 0.75
    height = min(rows * (width * shape + top_in + 0.5), 11.0)
    figure, panels = new_figure(height, rows, columns, right=0.05, top=top_in, across=0.75, down=top_in + 0.5)
    panels = panels.ravel()
    for unused in panels[len(names) :]:
        unused.set_axis_off()
    return figure, list(panels[: len(names)])


def _image_frame(axes: Axes, spec: DeviceSpec, name: str) -> None:
    unit = "lines" if kind_of_device(name) == "projector" else "px"
    axes.set(xlim=(-0.5, spec.width - 0.5), ylim=(spec.height - 0.5, -0.5))
    axes.set(xlabel=f"u in {unit}", ylabel=f"v in {unit}")

    axes.set_aspect(spec.pitch_mm[1] / spec.pitch_mm[0], anchor="N")
    axes.locator_params(nbins=5)
    for spine in axes.spines.values():
        spine.set_edgecolor(GRID)


def _residual_vectors(adjustment: Adjustment, names: list[str]) -> Drawing:
    figure, panels = _panels(adjustment, names, 0.5)
    told = []
    for i, (axes, name) in enumerate(zip(panels, names, strict=True)):
        spec = adjustment.devices[name].spec
        uv, residuals_um = _observations(adjustment, name)
        factor = magnification(residuals_um, spec)
        ends = uv + residuals_um * factor / (1000 * np.array(spec.pitch_mm))
        line = axes.plot(*_arrows(uv, ends).T, color=device_colour(i), lw=0.5, solid_capstyle="round")[0]
        line.set_rasterized(len(uv) > VECTORS_AS_LINES)
        _image_frame(axes, spec, name)
        axes.set_title(f"{drawable(shortened(name))}: {len(uv)} image points", loc="left", pad=24)

        _scale_arrow(axes, factor, spec)
        told.append(f"{name} {factor:g} times")
    caption = (
        f"Residuals (observed minus computed) of all stations as arrows from the place in the image, magnified: "
        f"{', '.join(told)}; the arrow above each panel gives the scale. Arrows without order are measuring noise. "
        "Neighbouring arrows that point the same way, or radially, mean that the device's model lacks a term."
    )
    rms = "; ".join("{} {:.2f} and {:.2f} µm".format(n, *adjustment.devices[n].residual_rms_um) for n in names)
    alternative = f"Residual vectors over the image of {', '.join(names)}. R.m.s. in x and y: {rms}."
    return Drawing("residuals", "Residual vectors over the image", caption, alternative, figure)


def _arrows(starts: Array, ends: Array) -> Array:
    """Arrows as one broken line, shape (n · 6, 2): shaft, two barbs, and NaN where the pen is lifted."""
    back = (starts - ends) * 0.3
    side = np.stack([-back[:, 1], back[:, 0]], axis=1) * 0.6
    lifted = np.full_like(starts, np.nan)
    points = np.stack([starts, ends, ends + back + side, ends, ends + back - side, lifted], axis=1)
    return np.asarray(points.reshape(-1, 2))


def _scale_arrow(axes: Axes, factor: float, spec: DeviceSpec) -> None:
    """Draw an arrow of a round length, a tenth of the image at most, above the panel, with that length."""
    length_um = nice_step(0.1 * spec.width * spec.pitch_mm[0] * 1000 / factor)
    pixels = length_um * factor / 1000 / spec.pitch_mm[0]
    right, up = axes.get_xlim()[1], axes.transAxes
    start = right - pixels
    at = axes.get_xaxis_transform()
    axes.annotate(
        "",
        xy=(right, 1.035),
        xytext=(start, 1.035),
        xycoords=at,
        textcoords=at,
        arrowprops={"arrowstyle": "->", "color": INK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7},
        annotation_clip=False,
    )
    text = f"magnified {factor:g}×;  {length_um:g} µm"
    axes.text(1 - pixels / spec.width - 0.02, 1.035, text, ha="right", va="center", fontsize=8, transform=up)


def _coverage(adjustment: Adjustment, names: list[str]) -> Drawing:
    figure, panels = _panels(adjustment, names, 0.25)
    told = []
    for axes, name in zip(panels, names, strict=True):
        spec = adjustment.devices[name].spec
        found = covered(name, (spec.width, spec.height), _observations(adjustment, name)[0])
        _cells(axes, found)
        _image_frame(axes, spec, name)
        axes.set_title(f"{drawable(shortened(name))}: {found.filled:.0%} of the cells covered", loc="left")
        told.append(f"{name} {found.filled:.0%}")
    caption = (
        "How many image points of all stations fall into each cell of the image; strong colour means many. The "
        "additional parameters are known only where there are points: over empty cells, above all along edges and in "
        "corners, they are extrapolated."
    )
    alternative = f"Counts of image points per cell of the image. Cells with points: {', '.join(told)}."
    return Drawing("coverage", "Coverage of the image", caption, alternative, figure)


def _cells(axes: Axes, found: Coverage) -> None:
    """Cells the more opaque the more points they hold, as opacity means the same on light and dark; counts within."""
    top = max(1.0, float(found.counts.max()))
    width, height = found.size[0] / found.counts.shape[1], found.size[1] / found.counts.shape[0]
    cells, opacities = [], []
    for (i, j), count in np.ndenumerate(found.counts):
        u, v = j * width - 0.5, i * height - 0.5
        if count:
            cells.append([(u, v), (u + width, v), (u + width, v + height), (u, v + height)])
            opacities.append(0.08 + 0.5 * count / top)
        colour = INK if count else MUTED
        at = u + width / 2, v + height / 2
        axes.text(*at, f"{count}", ha="center", va="center", fontsize=6.5, color=colour, in_layout=False)
    faces = to_rgba_array([CAMERA] * len(cells), opacities)
    axes.add_artist(PolyCollection(cells, facecolors=faces, linewidths=0))  # looks for no limits: the image has them
