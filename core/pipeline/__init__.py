"""The seven stages in order, each on a project folder: what the command line, the window and a script call.

    capture -> decode -> measure -> calibrate -> reconstruct -> evaluate -> report

One file for each, of the same name; `folders` says where a project keeps things, `runs` keeps calibrations
and sets them side by side, `picking`, `signing` and `tables` do what lies beside the road: guesses of picks, the
sign-off, everything as CSV. `state` alone knows what is current; `update` does what is not. A stage takes what it
needs from the captures and from ``results/`` in the project, and writes its own result there. Nothing is written before
a stage has succeeded.
"""

from typing import TYPE_CHECKING

from core.lazy import attach

if TYPE_CHECKING:
    # fmt: off
    from core.pipeline import (  # noqa: F401, I001  further modules, as pipeline.runs
        calibrate, capture, decode, evaluate, features, folders, live, merge, methods, orient, orient_known, orient_rig,
        orient_words, picking, reconstruct, report, runs, signed, signing, tables, views,
    )
    # fmt: on
    from core.capture.latency import probe_light as probe_light
    from core.capture.probe import probe_device as probe_device
    from core.pipeline.calibrate import adjust_network as adjust_network
    from core.pipeline.calibrate import calibrate_project as calibrate_project
    from core.pipeline.calibrate import load_calibrations as load_calibrations
    from core.pipeline.capture import capture_into as capture_into
    from core.pipeline.capture import simulate_project as simulate_project
    from core.pipeline.decode import decode_capture as decode_capture
    from core.pipeline.evaluate import evaluate_project as evaluate_project
    from core.pipeline.state.graph import project_states as project_states
    from core.pipeline.measure import measure_project as measure_project
    from core.pipeline.methods import METHODS as METHODS
    from core.pipeline.methods import Calibrated as Calibrated
    from core.pipeline.methods import CalibrationMethod as CalibrationMethod
    from core.pipeline.options import CalibrateOptions as CalibrateOptions
    from core.pipeline.orient import orient_capture as orient_capture
    from core.pipeline.reconstruct import reconstruct_capture as reconstruct_capture
    from core.pipeline.report import report_project as report_project
    from core.pipeline.testfield import print_testfield as print_testfield
    from core.pipeline.update import update_project as update_project

_HOMES = {
    "core.capture.latency": "probe_light",
    "core.capture.probe": "probe_device",
    "core.pipeline.calibrate": "adjust_network calibrate_project load_calibrations",
    "core.pipeline.capture": "capture_into simulate_project",
    "core.pipeline.decode": "decode_capture",
    "core.pipeline.evaluate": "evaluate_project",
    "core.pipeline.state.graph": "project_states",
    "core.pipeline.measure": "measure_project",
    "core.pipeline.methods": "METHODS Calibrated CalibrationMethod",
    "core.pipeline.options": "CalibrateOptions",
    "core.pipeline.orient": "orient_capture",
    "core.pipeline.reconstruct": "reconstruct_capture",
    "core.pipeline.report": "report_project",
    "core.pipeline.testfield": "print_testfield",
    "core.pipeline.update": "update_project",
}
if not TYPE_CHECKING:  # else every name would be right
    __getattr__, __dir__, __all__ = attach(__name__, _HOMES)
