"""Histograms of deviations, one step line per plane and method."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stripe_gui.widgets.plot import STYLES, Curve, Plot


class Histogram(Plot):
    """Step lines over common bins, and beside each, if wanted, the normal distribution of a given sigma."""

    def __init__(self, name: str, unit: str) -> None:
        super().__init__(name, "", "")
        self._unit = unit
        self.axes["left"].setLabel(self.tr("share of pixels [%]"))

    def set_values(
        self,
        series: Sequence[tuple[str, NDArray]],
        limit: float,
        bins: int = 101,
        *,
        normal: Sequence[tuple[str, float | None]] = (),
    ) -> None:
        """Show named series of values between ±limit; what lies outside counts in the outermost bins.

        Parameters
        ----------
        normal : sequence of (str, float or None)
            Name and sigma of the normal distribution beside each series; None for none.
        """
        edges = np.linspace(-limit, limit, bins + 1)
        x = np.linspace(-limit, limit, 401)
        curves, highest, beyond = [], 0.0, False
        for i, (name, values) in enumerate(series):
            finite = values[np.isfinite(values)]
            if not len(finite):
                continue
            share = np.histogram(np.clip(finite, -limit, limit), edges)[0] / len(finite) * 100
            highest, beyond = max(highest, float(share.max())), beyond or float(np.abs(finite).max()) > limit
            style = "line" if normal else list(STYLES)[i // 2 % len(STYLES)]
            curves.append(Curve(name, edges, share, i % 2, style))
            if normal and (sigma := normal[i][1]):
                density = 100 * (edges[1] - edges[0]) / (sigma * np.sqrt(2 * np.pi)) * np.exp(-0.5 * (x / sigma) ** 2)
                highest = max(highest, float(density.max()))
                curves.append(Curve(normal[i][0], x, density, i % 2, "dash"))
        text = (
            self.tr("deviation [{unit}]; the outermost steps hold all beyond")
            if beyond
            else self.tr("deviation [{unit}]")
        )
        self.axes["bottom"].setLabel(text.format(unit=self._unit))
        self.set_curves(curves, (-limit, limit), (0, highest * 1.05 or 1.0))
