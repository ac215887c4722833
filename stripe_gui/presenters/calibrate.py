"""The calibrations of a project: tables, warnings, residuals per device."""

from __future__ import annotations

import numpy as np

from core.lazy import dataclass
from core.model import Adjustment, Array, Capture, PlaneEvaluation, StationId, TargetId, Verdict
from core.pipeline import METHODS
from core.pipeline.folders import known_truth
from core.pipeline.report import parts_of_report
from core.pipeline.runs import current_run
from core.pipeline.update import chosen_options
from core.project import keep_picks
from core.report import ReportData, Table, tables
from core.report.data import warnings_of
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.runs import made_at, options_words, run_title
from stripe_gui.presenters.told import sentence, told, translate
from stripe_gui.presenters.work import CalibrateChoice


@dataclass(frozen=True)
class DeviceResiduals:
    """Residuals in the image of one device, one row of every array per image point."""

    name: str
    size: tuple[int, int]
    um_per_px: tuple[float, float]
    uv: Array  # (n, 2) px or lines
    residual: Array  # (n, 2) observed minus computed, px or lines
    station: tuple[str, ...]  # of every image point
    point: tuple[str, ...]
    station_id: tuple[StationId, ...]  # the same, empty where they are none of a project's
    point_id: tuple[TargetId, ...]

    def describe(self, index: int) -> str:
        du, dv = self.residual[index]
        x, y = du * self.um_per_px[0], -dv * self.um_per_px[1]
        text = translate("Calibrate", "{station}, {point}: {x:+.2f} µm in x, {y:+.2f} µm in y")
        return text.format(station=self.station[index], point=self.point[index], x=x, y=y)

    def capture(self, index: int) -> str:
        """Give the capture that an image point was measured in."""
        return self.station_id[index].capture if self.station_id else self.station[index]

    def target(self, index: int) -> tuple[int, int] | None:
        """Give the target (row, col) that an image point shows, if its point is named so."""
        if not self.point_id:
            return None
        return self.point_id[index].row, self.point_id[index].col


@dataclass(frozen=True)
class CalibrationView:
    """Everything the calibrate page shows."""

    tables: tuple[Table, ...]
    warnings: tuple[str, ...]
    residuals: tuple[DeviceResiduals, ...]
    adjustment: Adjustment | None
    made: str  # which runs it came from, in words
    verdicts: dict[str, Verdict]  # by the method's name


def gather(folder: ProjectFolder, with_planes: bool = True) -> ReportData:
    """Gather the project's results, each read once per version of its file."""
    calibrations = {m: folder.result(f"{m}.npz", method.result) for m, method in METHODS.items()}
    planes: tuple[PlaneEvaluation, ...] = (folder.result("evaluation.npz", tuple) or ()) if with_planes else ()
    return ReportData(
        project=folder.project,
        adjustment=folder.result("adjustment.npz", Adjustment),
        **parts_of_report({m: made for m, made in calibrations.items() if made is not None}),
        evaluations=planes,
        truth=known_truth(folder.project),
    )


def calibration_view(folder: ProjectFolder) -> CalibrationView:
    """Put the calibrations into tables, words and residuals."""
    data = gather(folder, with_planes=False)
    adjustment = data.adjustment
    return CalibrationView(
        tuple(tables(data)),
        tuple(text for _, text in warnings_of(data)),
        residual_sets(adjustment) if adjustment else (),
        adjustment,
        _made(folder),
        {title: made.verdict for title, made in data.calibrations.items() if made.verdict is not None},
    )


def choice_of(folder: ProjectFolder) -> CalibrateChoice:
    """Give what was chosen for the calibrations in use, so that calibrating again begins from there."""
    return CalibrateChoice("all", chosen_options(folder.project))


def _made(folder: ProjectFolder) -> str:
    """Name the runs that the calibrations in use came from."""
    runs = {method: run for method in METHODS if (run := current_run(folder.project, method)) is not None}
    lines = []
    for run in {run.number: run for run in runs.values()}.values():
        methods = [method for method, other in runs.items() if other.number == run.number]
        names = " + ".join(map(told, methods))
        lines.append(f"{run_title(run)}, {made_at(run)}: {names}; {options_words(run.options, methods)}")
    return "\n".join(map(sentence, lines))


def exclude_targets(capture: Capture, *targets: tuple[int, int]) -> None:
    """Leave targets of a capture out of measuring; kept with its picks."""
    keep_picks(capture.path, capture.seeds, tuple(dict.fromkeys((*capture.excluded, *targets))))


def restore_targets(capture: Capture, *targets: tuple[int, int]) -> None:
    """Use targets of a capture again."""
    keep_picks(capture.path, capture.seeds, tuple(t for t in capture.excluded if t not in targets))


def residual_sets(adjustment: Adjustment) -> tuple[DeviceResiduals, ...]:
    """Sort an adjustment's residuals by device."""
    network = adjustment.network
    stations = np.array(network.station_names)[network.observation_station]
    points = np.array(network.point_names)[network.observation_point]
    found = []
    for name, own in network.made_by.items():
        rows, spec = np.flatnonzero(own), network.devices[name].spec
        found.append(
            DeviceResiduals(
                name,
                (spec.width, spec.height),
                (1000 * spec.pitch_mm[0], 1000 * spec.pitch_mm[1]),
                network.observation_uv[rows],
                adjustment.residuals[rows],
                tuple(map(str, stations[rows])),
                tuple(map(str, points[rows])),
                tuple(network.station_ids[network.observation_station[i]] for i in rows if network.station_ids),
                tuple(network.point_ids[network.observation_point[i]] for i in rows if network.point_ids),
            )
        )
    return tuple(found)
