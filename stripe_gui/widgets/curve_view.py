"""One measured curve: few points joined by a line, both axes named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stripe_gui.widgets.plot import Curve, Plot


class CurveView(Plot):
    """A plot of one curve, whose axes change with what was measured."""

    def __init__(self, name: str) -> None:
        super().__init__(name, "", "")
        self.legend.hide()

    def set_curve(self, curve: Sequence[tuple[float, float]], x_label: str, y_label: str) -> None:
        """Show a curve of (x, y), the y axis from zero."""
        x, y = np.array(curve, np.float64).T
        self.axes["bottom"].setLabel(x_label)
        self.axes["left"].setLabel(y_label)
        margin = 0.04 * (float(np.ptp(x)) or 1.0)
        top = float(y.max()) if y.max() > 0 else 1.0
        said = "; ".join(f"{a:g}: {b:.3g}" for a, b in curve)
        limits = (x.min() - margin, x.max() + margin), (min(0.0, y.min()), 1.08 * top)
        self.set_curves([Curve("", x, y, marked=True)], *limits, said)
