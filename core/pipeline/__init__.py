"""The seven stages in order, each on a project folder: what the command line, the window and a script call.

    capture -> decode -> measure -> calibrate -> reconstruct -> evaluate -> report

One file for each, of the same name; `folders` says where a project keeps things, `runs` keeps calibrations
and sets them side by side, `picking`, `signing` and `tables` do what lies beside the road: guesses of picks, the
sign-off, everything as CSV. `graph` alone knows what is current: every result carries the record of what it was made
from (`inputs`), set beside what is there now; `update` does what is not current. A stage takes what it needs from the
captures and from ``results/`` in the project, and writes its own result there. Nothing is written before a stage has
succeeded.
"""

from typing import TYPE_CHECKING

from core.lazy import attach

if TYPE_CHECKING:
    from core.capture.latency import probe_light as probe_light
    from core.capture.probe import probe_device as probe_device
    from core.pipeline.calibrate import adjust_network as adjust_network
    from core.pipeline.calibrate import calibrate_project as calibrate_project
    from core.pipeline.calibrate import load_calibrations as load_calibrations
    from core.pipeline.calibrate import methods_in_use as methods_in_use
    from core.pipeline.capture import capture_into as capture_into
    from core.pipeline.capture import check_scenario as check_scenario
    from core.pipeline.capture import preflight_rig as preflight_rig
    from core.pipeline.capture import simulate_project as simulate_project
    from core.pipeline.decode import decode_capture as decode_capture
    from core.pipeline.decode import phase_maps as phase_maps
    from core.pipeline.decode import read_phase as read_phase
    from core.pipeline.decode import write_phase as write_phase
    from core.pipeline.evaluate import evaluate_project as evaluate_project
    from core.pipeline.evaluate import load_evaluation as load_evaluation
    from core.pipeline.features import feature_figures as feature_figures
    from core.pipeline.features import feature_words as feature_words
    from core.pipeline.features import measure_features as measure_features
    from core.pipeline.folders import captures_of as captures_of
    from core.pipeline.folders import find_capture as find_capture
    from core.pipeline.folders import points_file as points_file
    from core.pipeline.folders import result_path as result_path
    from core.pipeline.graph import project_states as project_states
    from core.pipeline.live import live_cycles as live_cycles
    from core.pipeline.measure import measure_project as measure_project
    from core.pipeline.merge import Merged as Merged
    from core.pipeline.merge import merge_captures as merge_captures
    from core.pipeline.merge import merge_figures as merge_figures
    from core.pipeline.merge import merge_words as merge_words
    from core.pipeline.methods import METHODS as METHODS
    from core.pipeline.methods import Calibrated as Calibrated
    from core.pipeline.methods import CalibrationMethod as CalibrationMethod
    from core.pipeline.methods import calibration_figures as calibration_figures
    from core.pipeline.options import CalibrateOptions as CalibrateOptions
    from core.pipeline.orient import drift_of as drift_of
    from core.pipeline.orient import orient_capture as orient_capture
    from core.pipeline.orient import orient_pairs as orient_pairs
    from core.pipeline.orient_known import parse_length as parse_length
    from core.pipeline.orient_rig import are_together as are_together
    from core.pipeline.orient_rig import correct_together as correct_together
    from core.pipeline.orient_rig import together_figures as together_figures
    from core.pipeline.orient_rig import together_words as together_words
    from core.pipeline.orient_words import drift_figures as drift_figures
    from core.pipeline.orient_words import drift_words as drift_words
    from core.pipeline.orient_words import motion_words as motion_words
    from core.pipeline.orient_words import motions_figures as motions_figures
    from core.pipeline.picking import accept_guesses as accept_guesses
    from core.pipeline.picking import guess_picks as guess_picks
    from core.pipeline.reconstruct import check_cloud as check_cloud
    from core.pipeline.reconstruct import reconstruct_capture as reconstruct_capture
    from core.pipeline.reconstruct import write_cloud as write_cloud
    from core.pipeline.report import outdated_words as outdated_words
    from core.pipeline.report import report_project as report_project
    from core.pipeline.report import result_tables as result_tables
    from core.pipeline.report import table_of_planes as table_of_planes
    from core.pipeline.runs import Difference as Difference
    from core.pipeline.runs import Run as Run
    from core.pipeline.runs import compare_runs as compare_runs
    from core.pipeline.runs import current_run as current_run
    from core.pipeline.runs import current_runs as current_runs
    from core.pipeline.runs import delete_run as delete_run
    from core.pipeline.runs import list_runs as list_runs
    from core.pipeline.runs import make_current as make_current
    from core.pipeline.runs import rename_run as rename_run
    from core.pipeline.signed import load_sign_off as load_sign_off
    from core.pipeline.signing import save_sign_off as save_sign_off
    from core.pipeline.signing import sign_evaluation as sign_evaluation
    from core.pipeline.signing import sign_project as sign_project
    from core.pipeline.states import ProjectStates as ProjectStates
    from core.pipeline.states import State as State
    from core.pipeline.tables import export_deviations as export_deviations
    from core.pipeline.tables import export_profiles as export_profiles
    from core.pipeline.tables import export_report as export_report
    from core.pipeline.tables import export_tables as export_tables
    from core.pipeline.tables import kept_evaluation as kept_evaluation
    from core.pipeline.tables import read_profiles as read_profiles
    from core.pipeline.testfield import print_testfield as print_testfield
    from core.pipeline.update import Update as Update
    from core.pipeline.update import decode_project as decode_project
    from core.pipeline.update import keep_points as keep_points
    from core.pipeline.update import update_project as update_project
    from core.pipeline.views import coverage as coverage
    from core.pipeline.views import reconstruct_views as reconstruct_views
    from core.pipeline.views import seen_by_several as seen_by_several

_HOMES = {
    "core.capture.latency": "probe_light",
    "core.capture.probe": "probe_device",
    "core.pipeline.calibrate": "adjust_network calibrate_project load_calibrations methods_in_use",
    "core.pipeline.capture": "capture_into check_scenario preflight_rig simulate_project",
    "core.pipeline.decode": "decode_capture phase_maps read_phase write_phase",
    "core.pipeline.evaluate": "evaluate_project load_evaluation",
    "core.pipeline.features": "feature_figures feature_words measure_features",
    "core.pipeline.folders": "captures_of find_capture points_file result_path",
    "core.pipeline.graph": "project_states",
    "core.pipeline.live": "live_cycles",
    "core.pipeline.measure": "measure_project",
    "core.pipeline.merge": "Merged merge_captures merge_figures merge_words",
    "core.pipeline.methods": "METHODS Calibrated CalibrationMethod calibration_figures",
    "core.pipeline.options": "CalibrateOptions",
    "core.pipeline.orient": "drift_of orient_capture orient_pairs",
    "core.pipeline.orient_known": "parse_length",
    "core.pipeline.orient_rig": "are_together correct_together together_figures together_words",
    "core.pipeline.orient_words": "drift_figures drift_words motion_words motions_figures",
    "core.pipeline.picking": "accept_guesses guess_picks",
    "core.pipeline.reconstruct": "check_cloud reconstruct_capture write_cloud",
    "core.pipeline.report": "outdated_words report_project result_tables table_of_planes",
    "core.pipeline.runs": "Difference Run compare_runs current_run current_runs delete_run list_runs make_current"
    " rename_run",
    "core.pipeline.signed": "load_sign_off",
    "core.pipeline.signing": "save_sign_off sign_evaluation sign_project",
    "core.pipeline.states": "ProjectStates State",
    "core.pipeline.tables": "export_deviations export_profiles export_report export_tables kept_evaluation"
    " read_profiles",
    "core.pipeline.testfield": "print_testfield",
    "core.pipeline.update": "Update decode_project keep_points update_project",
    "core.pipeline.views": "coverage reconstruct_views seen_by_several",
}
if not TYPE_CHECKING:  # else every name would be right
    __getattr__, __dir__, __all__ = attach(__name__, _HOMES)
