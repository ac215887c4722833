"""The seven stages of a project: done, out of date, to do, or failed with the reason.

Nothing here is stored: a result counts as done while it is newer than everything it was computed from. A later stage
that has a current result speaks for the stages before it that it runs itself (calibrating decodes and measures).
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from PySide6.QtCore import QCoreApplication

from core.errors import StripeError
from core.model import Adjustment, DeviceSpec, Method, PhotogrammetricCalibration
from core.pipeline.options import METHODS
from core.pipeline.runs import current_run
from stripe_gui.presenters.failures import StageFailure, read_failures
from stripe_gui.presenters.folder import CaptureEntry, ProjectFolder, written_ns

STAGES = ("capture", "decode", "measure", "calibrate", "reconstruct", "evaluate", "report")
translate = QCoreApplication.translate


class State(Enum):
    """Where a stage stands."""

    DONE = "done"
    STALE = "stale"
    TODO = "todo"
    FAILED = "failed"


@dataclass(frozen=True)
class StageStatus:
    """One stage: its state and why, in a sentence."""

    stage: str
    state: State
    reason: str
    failure: StageFailure | None = None


def stage_name(stage: str) -> str:
    """Give the stage's word in the operator's language."""
    return {
        "capture": translate("Stages", "Capture"),
        "decode": translate("Stages", "Decode"),
        "measure": translate("Stages", "Measure"),
        "calibrate": translate("Stages", "Calibrate"),
        "reconstruct": translate("Stages", "Reconstruct"),
        "evaluate": translate("Stages", "Evaluate"),
        "report": translate("Stages", "Report"),
    }[stage]


def state_word(state: State) -> str:
    """Give the state's word in the operator's language."""
    return {
        State.DONE: translate("Stages", "done"),
        State.STALE: translate("Stages", "out of date"),
        State.TODO: translate("Stages", "to do"),
        State.FAILED: translate("Stages", "failed"),
    }[state]


def stage_statuses(folder: ProjectFolder) -> dict[str, StageStatus]:
    """Compute the state of every stage from the files."""
    facts = _Facts(folder)
    states = {
        "capture": _capture(facts),
        "decode": _decode(facts),
        "calibrate": _calibrate(facts),
    }
    states["evaluate"] = _evaluate(facts, states["calibrate"])
    states["measure"] = _measure(facts, states["calibrate"])
    states["reconstruct"] = _reconstruct(facts, states)
    states["report"] = _report(facts, states)
    failures = read_failures(folder.path)
    return {stage: _with_failure(states[stage], failures.get(stage), facts) for stage in STAGES}


class _Facts:
    """What the folder holds, looked up once."""

    def __init__(self, folder: ProjectFolder) -> None:
        self.folder = folder
        self.entries = folder.captures()
        self.readable = [e for e in self.entries if e.capture]
        self.boards = [e for e in self.readable if e.role in ("testfield", "depth") and e.capture.testfield]
        self.fields = [e for e in self.readable if e.role == "testfield"]
        self.picked = [e for e in self.fields if e.capture.seeds]
        self.plates = [e for e in self.readable if e.role == "depth"]
        self.planes = [e for e in self.readable if e.role == "plane"]
        names = ("targets", "photogrammetric", "polynomial", "evaluation")
        self.written = {name: written_ns(folder.result_file(f"{name}.npz")) for name in names}
        self.runs = {method: current_run(folder.project, method) for method in METHODS}
        self.report = written_ns(folder.result_file("report/report.html"))
        self.signed = written_ns(folder.result_file("sign-off.json"))
        self.newest = newest(self.readable)
        self.measured = _measured_captures(folder)

    def read_ns(self, method: Method) -> int | None:
        """When the calibration in use began to read its captures; where that is not known, when it was written."""
        run, written = self.runs[method], self.written[method]
        return run.read_ns if run is not None and written is not None else written

    def used(self, method: Method, entries: list[CaptureEntry]) -> list[CaptureEntry]:
        """Leave out the captures that took no part on purpose."""
        run = self.runs[method]
        return [e for e in entries if run is None or e.name not in run.options.without]


def newest(entries: Iterable[CaptureEntry]) -> int:
    """When the last of these captures' files was written."""
    return max((e.changed_ns for e in entries), default=0)


def _capture(facts: _Facts) -> StageStatus:
    unreadable = [e for e in facts.entries if e.error]
    if unreadable:
        error = unreadable[0].error
        failure = StageFailure(f"{error.where}: {error.seen}", error.remedy, "", 0)
        return StageStatus("capture", State.FAILED, str(error), failure)
    if not facts.entries:
        return StageStatus("capture", State.TODO, translate("Stages", "no captures yet"))
    return StageStatus("capture", State.DONE, translate("Stages", "{n} captures").format(n=len(facts.entries)))


def _decode(facts: _Facts) -> StageStatus:
    if not facts.readable:
        return StageStatus("decode", State.TODO, translate("Stages", "needs captures"))
    decoded = _decoded_ns(facts)
    needed = [e for e in facts.readable if e.role != "object"] or facts.readable
    covered = [e for e in needed if e.name in decoded]
    count = sum(e.recorded_ns <= decoded[e.name] for e in covered)
    if count == len(needed):
        return StageStatus("decode", State.DONE, translate("Stages", "{n} captures decoded").format(n=count))
    if count < len(covered):
        return StageStatus("decode", State.STALE, translate("Stages", "captures changed after decoding"))
    text = translate("Stages", "{n} of {m} captures decoded").format(n=count, m=len(needed))
    return StageStatus("decode", State.TODO, text)


def _decoded_ns(facts: _Facts) -> dict[str, int]:
    """When captures were decoded last, by name: measuring, calibrating and evaluating decode what they need."""
    kept = decoded_captures(facts.folder.path)
    found = {name: int(entry.get("recorded_ns", 0)) for name, entry in kept.items() if not entry.get("error")}
    for at, names in (
        (facts.written["targets"], facts.measured),
        (facts.read_ns("photogrammetric"), [e.name for e in facts.used("photogrammetric", facts.picked)]),
        (facts.read_ns("polynomial"), [e.name for e in facts.used("polynomial", facts.plates)]),
        (facts.written["evaluation"], _evaluated(facts.folder.path)),
    ):
        found |= {name: max(at or 0, found.get(name, 0)) for name in names if at is not None}
    return found


def _measure(facts: _Facts, calibrate: StageStatus) -> StageStatus:
    if not facts.fields:
        return StageStatus("measure", State.TODO, translate("Stages", "needs testfield captures"))
    unpicked = len(facts.fields) - len(facts.picked)
    if unpicked:
        text = translate("Stages", "targets to pick in {n} of {m} captures")
        return StageStatus("measure", State.TODO, text.format(n=unpicked, m=len(facts.fields)))
    written = facts.written["targets"]
    left = {e.name for e in facts.picked} - facts.measured
    if written is not None and written >= newest(facts.boards) and not left:
        return StageStatus(
            "measure", State.DONE, translate("Stages", "targets of {n} captures").format(n=len(facts.fields))
        )
    if calibrate.state is State.DONE and facts.written["photogrammetric"]:
        return StageStatus("measure", State.DONE, translate("Stages", "measured while calibrating"))
    if written is not None and left:
        text = translate("Stages", "{n} of {m} captures measured")
        return StageStatus("measure", State.TODO, text.format(n=len(facts.picked) - len(left), m=len(facts.picked)))
    if written is not None:
        return StageStatus("measure", State.STALE, translate("Stages", "captures or picks changed after measuring"))
    return StageStatus("measure", State.TODO, translate("Stages", "picked, not measured yet"))


def _measured_captures(folder: ProjectFolder) -> set[str]:
    """Name the captures whose targets are kept."""
    try:
        return {targets.capture for targets in folder.result("targets.npz", tuple) or ()}
    except StripeError:
        return set()


def _calibrate(facts: _Facts) -> StageStatus:
    inputs: dict[Method, list[CaptureEntry]] = {"photogrammetric": facts.picked, "polynomial": facts.plates}
    wanted = [m for m, entries in inputs.items() if entries]
    if not wanted and not any(facts.written[m] for m in inputs):
        text = translate("Stages", "needs picked testfields or plates at known depths")
        return StageStatus("calibrate", State.TODO, text)
    absent = [m for m in wanted if facts.written[m] is None]
    if absent:
        return StageStatus("calibrate", State.TODO, translate("Stages", "ready to run"))
    for method, entries in inputs.items():
        read = facts.read_ns(method)
        if read is not None and read < newest(facts.used(method, entries)):
            return StageStatus("calibrate", State.STALE, translate("Stages", "captures or picks changed since"))
    if _rig_changed(facts):
        return StageStatus("calibrate", State.STALE, translate("Stages", "the rig or its scale changed since"))
    done = [m for m in inputs if facts.written[m]]
    text = translate("Stages", "both methods") if len(done) == 2 else method_name(done[0])
    return StageStatus("calibrate", State.DONE, text)


def _reconstruct(facts: _Facts, states: dict[str, StageStatus]) -> StageStatus:
    calibrated = _last_calibration(facts)
    if calibrated is None:
        return StageStatus("reconstruct", State.TODO, translate("Stages", "needs a calibration"))
    clouds = sorted(facts.folder.result_file("points").glob("*.*"))
    stale = states["calibrate"].state is State.STALE or any((written_ns(c) or 0) < calibrated for c in clouds)
    if clouds and stale:
        return StageStatus("reconstruct", State.STALE, translate("Stages", "calibrated anew since"))
    if clouds:
        return StageStatus("reconstruct", State.DONE, translate("Stages", "{n} point clouds").format(n=len(clouds)))
    if states["evaluate"].state is State.DONE:
        return StageStatus("reconstruct", State.DONE, translate("Stages", "planes, while evaluating"))
    return StageStatus("reconstruct", State.TODO, translate("Stages", "ready to run"))


def _evaluate(facts: _Facts, calibrate: StageStatus) -> StageStatus:
    written, calibrated = facts.written["evaluation"], _last_calibration(facts)
    if written is None:
        if not facts.planes:
            return StageStatus("evaluate", State.TODO, translate("Stages", "needs plane captures"))
        ready = calibrated is not None
        text = translate("Stages", "ready to run") if ready else translate("Stages", "needs a calibration")
        return StageStatus("evaluate", State.TODO, text)
    if calibrate.state is State.STALE:
        return StageStatus("evaluate", State.STALE, translate("Stages", "the calibration is out of date"))
    if calibrated is not None and calibrated > written:
        return StageStatus("evaluate", State.STALE, translate("Stages", "calibrated anew since"))
    if newest(facts.planes) > written:
        return StageStatus("evaluate", State.STALE, translate("Stages", "plane captures changed since"))
    done, there = len(_evaluated(facts.folder.path)), len(facts.planes)
    text = translate("Stages", "{n} planes") if done == there else translate("Stages", "{n} of {m} planes")
    return StageStatus("evaluate", State.DONE, text.format(n=done, m=there))


def _report(facts: _Facts, states: dict[str, StageStatus]) -> StageStatus:
    calibrated = _last_calibration(facts)
    if facts.report is None:
        ready = calibrated is not None
        text = translate("Stages", "ready to run") if ready else translate("Stages", "needs a calibration")
        return StageStatus("report", State.TODO, text)
    if State.STALE in (states["calibrate"].state, states["evaluate"].state):
        return StageStatus("report", State.STALE, translate("Stages", "a stage before it is out of date"))
    if max(calibrated or 0, facts.written["evaluation"] or 0, facts.signed or 0) > facts.report:
        return StageStatus("report", State.STALE, translate("Stages", "results changed since"))
    return StageStatus("report", State.DONE, translate("Stages", "HTML and PDF"))


def _with_failure(status: StageStatus, failure: StageFailure | None, facts: _Facts) -> StageStatus:
    """Tell a failure of the last run, unless what the stage reads has changed since or its result is there."""
    if failure is None or status.state is State.DONE or failure.at_ns < facts.newest:
        return status
    return StageStatus(status.stage, State.FAILED, failure.happened, failure)


def _last_calibration(facts: _Facts) -> int | None:
    times = [t for t in (facts.written["photogrammetric"], facts.written["polynomial"]) if t is not None]
    return max(times) if times else None


def _rig_changed(facts: _Facts) -> bool:
    """Whether project.json now describes another rig than the one that was calibrated."""
    folder, read = facts.folder, facts.read_ns("photogrammetric")
    if read is None or (written_ns(folder.path / "project.json") or 0) <= read:
        return False
    try:
        calibration = folder.result("photogrammetric.npz", PhotogrammetricCalibration)
        adjustment = folder.result("adjustment.npz", Adjustment)
    except StripeError:
        return True
    project = folder.project
    pairs = [(calibration.camera.spec, project.camera), (calibration.projector.spec, project.projector)]
    if any(_raster(a) != _raster(b) for a, b in pairs):
        return True
    used = adjustment.network.scale if adjustment else None
    lengths = [bar and (bar.length_mm, bar.sigma_mm) for bar in (used, project.scale)]
    return adjustment is not None and lengths[0] != lengths[1]


def _raster(spec: DeviceSpec) -> tuple[float, ...]:
    return (spec.width, spec.height, *spec.pitch_mm, spec.nominal_c_mm)


def method_name(method: str) -> str:
    """Give the calibration method's name in the operator's language."""
    names = {
        "photogrammetric": translate("Stages", "photogrammetric"),
        "polynomial": translate("Stages", "polynomial"),
    }
    return names.get(method, method)


def device_name(device: str) -> str:
    """Give a device's name in the operator's language, as a heading."""
    names = {"camera": translate("Stages", "Camera"), "projector": translate("Stages", "Projector")}
    return names.get(device, device)


def decoded_captures(folder: Path) -> dict[str, dict]:
    """Read which captures were decoded and what came out, by name."""
    try:
        stored = json.loads((folder / "results" / "decode.json").read_text(encoding="utf-8"))
        return {str(name): dict(entry) for name, entry in stored["captures"].items()}
    except (OSError, ValueError, KeyError, AttributeError, TypeError):
        return {}


def _evaluated(folder: Path) -> set[str]:
    """Read which plane captures the evaluation holds."""
    try:
        stored = json.loads((folder / "results" / "evaluation.json").read_text(encoding="utf-8"))
        return {str(plane["capture"]) for plane in stored["planes"]}
    except (OSError, ValueError, KeyError, TypeError):
        return set()
