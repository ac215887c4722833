"""The whole experiment in one call: the virtual bench, both calibrations, the plane-table, the report."""

from __future__ import annotations

from pathlib import Path

from core import pipeline
from core.figures import evaluation_figures
from core.lazy import dataclass
from core.model import Figures
from core.patterns import SequenceSpec
from core.progress import SILENT, Progress
from core.project import read_project
from core.project.made import note_made, read_made
from core.report import ReportPaths


@dataclass(frozen=True)
class Demo:
    """What the demo found: Tables 1 to 3 as text, the figures, the report's files."""

    text: str
    figures: Figures
    report: ReportPaths


def run_demo(
    out: Path,
    scenario: str = "paper",
    seed: int = 0,
    progress: Progress = SILENT,
    *,
    sequence: SequenceSpec | None = None,
) -> Demo:
    """Simulate, calibrate both ways, evaluate and report, in a new folder or that of an earlier demo.

    What an earlier demo wrote is replaced; one that was stopped goes on where it was. What somebody added or changed is
    an InputError that names it; nothing has been touched then.
    """
    pipeline.capture.check_scenario(scenario, seed)  # refuses what it does not know before the earlier demo goes
    made = read_made(out)
    if made.get("demo") == "simulated" and (made.get("scenario"), made.get("seed"), made.get("sequence")) == (
        scenario,
        seed,
        str(sequence),
    ):
        project = read_project(out)
    else:
        project = pipeline.simulate_project(out, scenario, seed, progress.part(0.0, 0.6), sequence=sequence)
        note_made(out, {**_facts(out), "demo": "simulated"})
    pipeline.update_project(project, progress.part(0.6, 1.0))
    note_made(out, {**_facts(out), "demo": "complete"})
    calibrations, evaluations = pipeline.load_calibrations(project), pipeline.evaluate.load_evaluation(project)
    folder = pipeline.folders.result_path(project, "report")
    report = ReportPaths(folder / "report.html", folder / "report.pdf")
    figures = {**pipeline.methods.calibration_figures(calibrations), **evaluation_figures(evaluations)}
    return Demo(pipeline.report.result_tables(project, evaluations), figures, report)


def _facts(out: Path) -> Figures:
    made = read_made(out)
    return {key: made[key] for key in ("scenario", "seed", "sequence", "captures")}
