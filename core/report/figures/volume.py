"""How sure a calibration is of shapes, over the image and in depth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from core.model import Array
from core.report.figures.canvas import NO_DATA, WIDTH_IN, Drawing, colour_bar, new_figure


def volume_drawing(layers: Sequence[Mapping[str, Any]], sigma_mm: Array) -> Drawing:
    """Maps of sigmas, shape (depths, rows, columns) in mm: the nearest, the middle and the farthest depth."""
    shown = [layers[k] for k in sorted({0, len(layers) // 2, len(layers) - 1})]
    _, height, width = sigma_mm.shape
    figure = new_figure((WIDTH_IN - 1.0) / 3 * height / width + 1.1)
    panels = figure.subplots(1, len(shown), squeeze=False)[0]
    scale = Normalize(0.0, 1e3 * float(np.nanpercentile(sigma_mm, 98)))
    colours = colormaps["Blues"].with_extremes(bad=NO_DATA)
    for axes, row in zip(panels, shown, strict=True):
        axes.set(xticks=[], yticks=[], title=f"{row['depth_mm']:.0f} mm away")
        axes.imshow(1e3 * sigma_mm[row["layer"]], cmap=colours, norm=scale, interpolation="nearest")
    mappable = ScalarMappable(scale, colours)
    colour_bar(figure, mappable, panels, "σ of form in µm", location="bottom", shrink=0.6, aspect=45, extend="max")
    caption = (
        "What the calibration's own uncertainty does to a shape, every panel a view through the camera: σ of a point's "
        "place after the best movement of all points as one. It does not become smaller with less noise in a capture. "
        "Strong colour towards edges and depths: no target was captured beyond. Grey: outside the projector's light."
    )
    alternative = f"Maps of the sigma of form at {len(shown)} depths; figures in the table of the working volume."
    return Drawing("volume", "adjustment", "Uncertainty over the working volume", caption, alternative, figure)
