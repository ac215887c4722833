"""The evaluated planes: maps on one scale, histograms, Table 3."""

from __future__ import annotations

from dataclasses import dataclass

from core.model import PlaneEvaluation
from core.progress import SILENT, Progress
from core.report import ReportData, Table, tables
from stripe_gui.presenters.folder import ProjectFolder


@dataclass(frozen=True)
class EvaluationView:
    """Everything the evaluate page shows; maps and histograms share the scale ±`limit_mm`."""

    evaluations: tuple[PlaneEvaluation, ...]
    limit_mm: float
    table: Table

    @property
    def methods(self) -> list[str]:
        """Methods in their order."""
        return list(dict.fromkeys(e.method for e in self.evaluations))

    @property
    def captures(self) -> list[str]:
        """Plane captures in their order."""
        return list(dict.fromkeys(e.capture for e in self.evaluations))

    def of(self, capture: str, method: str) -> PlaneEvaluation | None:
        """Give one evaluation."""
        return next((e for e in self.evaluations if (e.capture, e.method) == (capture, method)), None)


def load_evaluation(folder: ProjectFolder, progress: Progress = SILENT) -> EvaluationView | None:
    """Read the evaluation; None where there is none.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    from core.report.figures.planes import colour_limit_mm  # the very scale of the report

    evaluations = folder.result("evaluation.npz", tuple)
    progress.check()
    if not evaluations:
        return None
    return EvaluationView(
        evaluations, colour_limit_mm(evaluations), tables(ReportData(folder.project, evaluations=evaluations))[-1]
    )
