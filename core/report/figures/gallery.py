"""All drawings of a report in their order."""

from __future__ import annotations

from core.progress import SILENT, Progress
from core.report.data import ReportData
from core.report.figures.canvas import Drawing, drawing_style
from core.report.figures.images import image_drawings
from core.report.figures.network import network_drawings
from core.report.figures.planes import plane_drawings


def drawings(data: ReportData, *, progress: Progress = SILENT) -> list[Drawing]:
    """Draw everything for which there are data: first the adjustment's figures, then the plane-table's."""
    result: list[Drawing] = []
    with drawing_style():
        if data.adjustment is not None:
            progress(0.0, "drawing the network")
            result += image_drawings(data.adjustment)
            result += network_drawings(data.adjustment)
        progress(0.5, "drawing the planes")
        result += plane_drawings(data)
    progress(1.0, "figures drawn")
    return result
