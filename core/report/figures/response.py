"""The projector's response: how much light it makes of a level, as the fringes of every capture show it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from core.report.figures.canvas import FILL, MUTED, PROJECTOR, Drawing, new_figure, plain_axes

Curves = Mapping[str, NDArray[np.float64]]
HEIGHT_IN = 3.2


def response_drawing(projector: str, curves: Curves) -> Drawing:
    """Draw the curves of all captures, their median, and a straight line."""
    figure = new_figure(HEIGHT_IN)
    axes = figure.add_subplot()
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
    return Drawing(f"response-{projector}", "response", "Response of the projector", caption, alternative, figure)
