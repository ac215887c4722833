"""The seven stages in order, each on a project folder: what the command line, the window and a script call.

    capture -> decode -> measure -> calibrate -> reconstruct -> evaluate -> report

One file for each, of the same name; `folders` says where a project keeps things, `freshness` whether a result is
current, `runs` and `compare` keep calibrations and set them side by side, `guessing`, `signing` and `tables` do what
lies beside the road: guesses of picks, the sign-off, everything as CSV. A stage takes what it needs from the
captures and from ``results/`` in the project, and writes its own result there. Nothing is written before a stage has
succeeded.
"""

from core.pipeline.calibrate import adjust_network, calibrate_project, load_calibrations
from core.pipeline.capture import capture_into, check_scenario, simulate_project
from core.pipeline.compare import Difference, compare_runs
from core.pipeline.decode import decode_capture, phase_maps, read_phase, write_phase
from core.pipeline.evaluate import evaluate_project, load_evaluation
from core.pipeline.folders import captures_of, find_capture, result_path
from core.pipeline.guessing import accept_guesses, guess_picks
from core.pipeline.measure import measure_project
from core.pipeline.options import METHODS, CalibrateOptions
from core.pipeline.orient import motion_figures, motion_words, orient_capture
from core.pipeline.preflight import preflight_rig
from core.pipeline.reconstruct import check_cloud, reconstruct_capture, write_cloud
from core.pipeline.report import (
    failed_verdicts,
    load_sign_off,
    report_data,
    report_project,
    result_tables,
    save_sign_off,
)
from core.pipeline.runs import Run, current_runs, delete_run, list_runs, make_current, rename_run
from core.pipeline.signing import sign_evaluation, sign_project
from core.pipeline.tables import (
    export_deviations,
    export_profiles,
    export_report,
    export_tables,
    kept_evaluation,
    read_profiles,
)
from core.pipeline.testfield import print_testfield

__all__ = [
    "METHODS",
    "CalibrateOptions",
    "Difference",
    "Run",
    "accept_guesses",
    "adjust_network",
    "calibrate_project",
    "capture_into",
    "captures_of",
    "check_cloud",
    "check_scenario",
    "compare_runs",
    "current_runs",
    "decode_capture",
    "delete_run",
    "evaluate_project",
    "export_deviations",
    "export_profiles",
    "export_report",
    "export_tables",
    "failed_verdicts",
    "find_capture",
    "guess_picks",
    "kept_evaluation",
    "list_runs",
    "load_calibrations",
    "load_evaluation",
    "load_sign_off",
    "make_current",
    "measure_project",
    "motion_figures",
    "motion_words",
    "orient_capture",
    "phase_maps",
    "preflight_rig",
    "print_testfield",
    "read_phase",
    "read_profiles",
    "reconstruct_capture",
    "rename_run",
    "report_data",
    "report_project",
    "result_path",
    "result_tables",
    "save_sign_off",
    "sign_evaluation",
    "sign_project",
    "simulate_project",
    "write_cloud",
    "write_phase",
]
