"""The whole experiment in one call: the virtual bench, both calibrations, the plane-table, the report."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from core.figures import calibration_figures, evaluation_figures
from core.model import Figures
from core.patterns import SequenceSpec
from core.pipeline import (
    calibrate_project,
    check_scenario,
    load_evaluation,
    report_project,
    result_tables,
    simulate_project,
)
from core.progress import SILENT, Progress
from core.report import ReportPaths

MARK = ".stripe-demo"  # a folder with this file was made by the demo and may be made anew


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

    Raises
    ------
    InputError
        If the folder holds anything else.
    """
    check_scenario(scenario, seed)  # refuses what it does not know before the earlier demo goes
    if os.path.isfile(out / MARK):
        shutil.rmtree(out)
    project = simulate_project(out, scenario, seed, progress.part(0.0, 0.6), sequence=sequence)
    (out / MARK).touch()
    calibrations = calibrate_project(project, progress=progress.part(0.6, 0.85))
    report = report_project(project, progress=progress.part(0.85, 1.0))
    evaluations = load_evaluation(project)
    figures = {**calibration_figures(calibrations), **evaluation_figures(evaluations)}
    return Demo(result_tables(project, evaluations), figures, report)
