"""The control chart of a rig: what every capture shows of it, against what those before it led to expect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.model import DriftPoint
from core.report.figures.canvas import CAMERA, FILL, PROJECTOR, Drawing, new_figure
from core.report.numbers import DRIFT_ELEMENTS

WARNING, ACTION = 1.96, 3.29  # sigmas, passed by one in 20 and in 1000 at rest


def drift_drawing(chart: Sequence[DriftPoint]) -> Drawing:
    """Draw one pair's chart, a panel for each element."""
    figure = new_figure(1.1 * len(DRIFT_ELEMENTS) + 0.6)
    panels = figure.subplots(len(DRIFT_ELEMENTS), 1, sharex=True)
    at = np.arange(len(chart))
    offs, sigmas = (np.array(x) for x in zip(*((p.value - p.expected, p.sigma) for p in chart), strict=True))
    for k, (axes, (name, unit, scale)) in enumerate(zip(panels, DRIFT_ELEMENTS, strict=True)):
        off, sigma = scale * offs[:, k], scale * sigmas[:, k]
        axes.fill_between(at, -WARNING * sigma, WARNING * sigma, step="mid", color=FILL, alpha=0.5, linewidth=0)
        for sign in (-1, 1):
            axes.step(at, sign * ACTION * sigma, where="mid", color=PROJECTOR, linewidth=0.8)
        axes.plot(at, off, "o-", color=CAMERA, markersize=3, linewidth=0.8)
        top = 1.1 * max(ACTION * float(np.median(sigma)), float(np.abs(off[1:]).max(initial=0.0)))
        axes.set(ylabel=f"{name}\n[{unit}]", ylim=(-top, top))
    panels[-1].set_xticks(at, [p.capture for p in chart], rotation=90, fontsize=6)
    camera, projector = chart[0].camera, chart[0].projector
    caption = (
        f"What each capture shows of {projector} against {camera}, less what those before it led to expect; the first "
        "is held against the calibration. Band: warning limits, passed by one capture in 20 at rest; lines: action "
        "limits, by one in 1,000."
    )
    out = [p.capture for p in chart if p.state == "action"]
    alternative = f"{len(chart)} captures; out of control: {', '.join(out) or 'none'}."
    return Drawing(f"drift-{camera}-{projector}", "drift", "Control chart of the rig", caption, alternative, figure)
