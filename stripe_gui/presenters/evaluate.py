"""What there is to judge, and the evaluated planes: maps on one scale, readings, profiles, distributions, Table 3."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from core.digits import fixed
from core.evaluate import Profile, points_on_plane, read_profile, share_within
from core.lazy import dataclass
from core.model import DeviceSpec, PlaneEvaluation, Verdict
from core.pipeline import METHODS
from core.pipeline.runs import current_run
from core.progress import SILENT, Progress
from core.report import CHAPTERS, ReportData, Table
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.runs import made_at
from stripe_gui.presenters.stages import StageStatus, State
from stripe_gui.presenters.status import graph_of
from stripe_gui.presenters.told import signed, told, translate

Pair = tuple[float, float]
NORMAL_SHARES = (68.27, 95.45, 99.73)  # percent of a normal distribution within 1, 2 and 3 sigma


@dataclass(frozen=True)
class EvaluationView:
    """Everything that is shown of an evaluation; maps and histograms share the scale ±`limit_mm`."""

    evaluations: tuple[PlaneEvaluation, ...]  # of one camera, by one projector and by all devices together
    limit_mm: float
    table: Table
    camera: DeviceSpec
    verdicts: dict[str, Verdict]  # by plane and method, those that are not passed
    every: tuple[PlaneEvaluation, ...]  # of all

    @property
    def pair(self) -> tuple[str, str]:
        """Whose evaluations these are, the first at least."""
        return self.evaluations[0].devices

    @property
    def ways(self) -> dict[str, dict[str, PlaneEvaluation]]:
        """Every way in which points were made, by name, with its evaluations by capture."""
        found: dict[str, dict[str, PlaneEvaluation]] = {}
        for e in self.evaluations:
            found.setdefault(self.name(e), {})[e.capture] = e
        return found

    @property
    def captures(self) -> list[str]:
        return list(dict.fromkeys(e.capture for e in self.evaluations))

    def of(self, capture: str) -> list[PlaneEvaluation]:
        """Give a capture's evaluations, in the order of the ways."""
        return [e for e in self.evaluations if e.capture == capture]

    def name(self, e: PlaneEvaluation) -> str:
        """Name the way in which points were made: by the method, and by the devices where they are not the pair's."""
        by = e.devices[1]
        return told(e.method) if by == self.pair[1] else f"{told(e.method)}, {told(by)}"


def load_evaluation(folder: ProjectFolder, pair: tuple[str, str], progress: Progress = SILENT) -> EvaluationView | None:
    """Read the evaluation of what a camera and a projector saw; None where there is none."""
    from core.report.figures.planes import colour_limit_mm  # the very scale of the report

    evaluations = folder.result("evaluation.npz", tuple)
    progress.check()
    if not evaluations:
        return None
    (table,) = CHAPTERS["planes"].tables(ReportData(folder.project, evaluations=evaluations))
    of_camera = tuple(e for e in evaluations if e.devices[0] == pair[0])  # that it and others made, if no pair did
    own = tuple(e for e in of_camera if e.devices == pair)
    if own:  # and what all devices made together
        own += tuple(e for e in of_camera if e.devices[1] not in folder.project.rig.projectors)
    own = own or of_camera or evaluations
    camera = folder.project.rig.cameras[own[0].devices[0]]
    return EvaluationView(own, colour_limit_mm(evaluations), table, camera, _verdicts(evaluations), evaluations)


def _verdicts(evaluations: tuple[PlaneEvaluation, ...]) -> dict[str, Verdict]:
    several = len({e.devices for e in evaluations}) > 1
    judged = [
        (", ".join((plane_name(e), *(map(told, e.devices) if several else ()), told(e.method))), e.verdict)
        for e in evaluations
    ]
    return {name: verdict for name, verdict in judged if verdict is not None and verdict.state != "passed"}


def plane_name(evaluation: PlaneEvaluation) -> str:
    """Name a plane with its angle."""
    return f"{evaluation.capture}, {angle_text(evaluation.angle_deg)}".rstrip(", ")


def angle_text(angle_deg: float | None) -> str:
    """Give an angle with its sign, nothing where it is not known.

    Examples
    --------
    >>> angle_text(-15.0), angle_text(0.0)
    ('-15°', '0°')
    """
    return "" if angle_deg is None else signed(angle_deg, "°")


def reading(view: EvaluationView, capture: str, u: float, v: float) -> str:
    """Say what is known of a pixel: its place in the image and on the plane, and its deviation in every way."""
    column, row = round(u), round(v)
    parts = [f"u {column}   v {row} px"]
    own = view.of(capture)
    for e in own[:1]:
        if e.camera is not None:
            x, y, z = points_on_plane(e.plane, view.camera, e.camera, (column, row))
            parts.append(f"X {x:+.2f}   Y {y:+.2f}   Z {z:+.2f} mm")
    for e in own:
        height, width = e.deviation_mm.shape
        inside = 0 <= row < height and 0 <= column < width
        value = float(e.deviation_mm[row, column]) if inside else float("nan")
        text = f"{1000 * value:+.1f} µm" if np.isfinite(value) else translate("Evaluate", "no value")
        parts.append(f"{view.name(e)} {text}")
    return "     ".join(parts)


def profiles(view: EvaluationView, capture: str, start: Pair, stop: Pair) -> dict[str, Profile]:
    """Read the deviations along a line, in every way that knows the camera it was made with, by name.

    InputError if the line is shorter than a pixel.
    """
    return {view.name(e): read_profile(e, view.camera, start, stop) for e in view.of(capture) if e.camera is not None}


def profile_text(name: str, line: Profile) -> str:
    """Sum a profile up: r.m.s. and range of the deviations."""
    known = line.deviation_mm[np.isfinite(line.deviation_mm)] * 1000
    if not len(known):
        return translate("Evaluate", "{method}: no values").format(method=name)
    text = translate("Evaluate", "{method}: {rms:.1f} µm r.m.s., {low:+.0f} to {high:+.0f} µm")
    rms = float(np.sqrt(np.mean(known**2)))
    return text.format(method=name, rms=rms, low=known.min(), high=known.max())


def distribution_text(view: EvaluationView, capture: str) -> str:
    """Set the shares within one, two and three r.m.s. beside those of a normal distribution; one line per way."""
    text = translate(
        "Evaluate", "{method}: within 1, 2, 3 r.m.s. {shares} % (normal {normal} %); r.m.s. {rms} mm{predicted}"
    )
    lines = []
    for e in (e for e in view.of(capture) if e.rms_mm > 0):
        shares = ", ".join(f"{100 * share_within(e, times):.2f}" for times in (1, 2, 3))
        predicted = translate("Evaluate", ", from the noise {rms} mm").format(rms=fixed(e.predicted_rms_mm or 0, 4))
        normal = ", ".join(f"{share:.2f}" for share in NORMAL_SHARES)
        lines.append(
            text.format(
                method=view.name(e),
                shares=shares,
                normal=normal,
                rms=fixed(e.rms_mm, 4),
                predicted=predicted if e.predicted_rms_mm else "",
            )
        )
    return "\n".join(lines)


@dataclass(frozen=True)
class Choice:
    """Something to tick: its name for the program, as the operator reads it, and where it stands."""

    name: str
    title: str
    state: str


def plane_choices(folder: ProjectFolder) -> list[Choice]:
    """List the plane captures with angle and whether they are evaluated as they are now."""
    states = graph_of(folder).states().captures
    words = {
        "current": translate("PlaneTable", "evaluated"),
        "outdated": translate("PlaneTable", "changed since it was evaluated"),
    }
    found = []
    for entry in folder.of_role("plane"):
        state = words.get(states[entry.name]["evaluate"].state, translate("PlaneTable", "not evaluated"))
        found.append(Choice(entry.name, f"{entry.name}   {angle_text(entry.angle_deg)}".rstrip(), state))
    return found


def calibration_choices(folder: ProjectFolder, statuses: Mapping[str, StageStatus]) -> list[Choice]:
    """List the calibrations with date, run, and whether they are out of date."""
    status = statuses.get("calibrate")
    found = []
    for method in METHODS:
        if not folder.result_file(f"{method}.npz").is_file():
            continue
        parts = []
        if (run := current_run(folder.project, method)) is not None:
            parts.append(translate("PlaneTable", "calibrated {when}").format(when=made_at(run)))
            parts.append(translate("PlaneTable", "run {n}").format(n=run.number))
        if status is not None and status.state is State.STALE:
            parts.append(translate("PlaneTable", "out of date: {reason}").format(reason=status.reason))
        else:
            parts.append(translate("PlaneTable", "up to date"))
        found.append(Choice(method, told(method), ", ".join(parts)))
    return found


def is_evaluated(
    folder: ProjectFolder, view: EvaluationView | None, captures: Collection[str], methods: Collection[str]
) -> bool:
    """Say whether the evaluation there is holds just these planes by these methods, as they are now.

    A calibration that is out of date may be judged all the same: its line says so.
    """
    if view is None:
        return False
    made = {(e.capture, e.method) for e in view.every if e.camera is not None}
    return made == {(c, m) for c in captures for m in methods} and graph_of(folder).evaluation_fits
