"""What a report is made of, and where it is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from core.lazy import dataclass
from core.model import (
    AdjustedDevice,
    Adjustment,
    Array,
    Calibration,
    DepthCalibration,
    DriftPoint,
    Method,
    PhotogrammetricCalibration,
    PlaneEvaluation,
    Project,
    Registration,
    Verdict,
)

Kind = Literal["camera", "projector"]


@dataclass(frozen=True)
class Tolerance:
    """What an operator allows the deviations of every plane: their r.m.s. or the largest of them."""

    limit_mm: float
    of: Literal["rms", "max"] = "rms"


@dataclass(frozen=True)
class SignOff:
    """Who answers for the figures; only `operator` must be given. `date` is ISO 8601.

    `despite` says why he signs although a verdict failed."""

    operator: str
    instrument: str = ""
    remark: str = ""
    date: str = ""
    tolerance: Tolerance | None = None
    despite: str = ""


@dataclass(frozen=True)
class ReportData:
    """Everything the report tells of; a part that is None or empty is left out and the report says so."""

    project: Project  #: `project.reference` names the published results to print beside the own ones
    adjustment: Adjustment | None = None
    photogrammetric: PhotogrammetricCalibration | None = None
    depth: DepthCalibration | None = None
    evaluations: tuple[PlaneEvaluation, ...] = ()
    #: true interior orientations of a simulated rig by device, "camera" and "projector" (or the name of the network's
    #: device): ``{"c_mm": …, "x0_mm": …, "y0_mm": …, "A1": … "A6": …, "r0_mm": …}``. Other keys are ignored.
    truth: Mapping[str, Any] | None = None
    #: made_on, made_by: date and program for the title block. The report never reads the clock, so equal data give
    #: equal files.
    made_on: str = ""
    made_by: str = ""
    #: end of the deviation maps' common colour scale; by default it follows from the deviations
    colour_limit_mm: float | None = None
    sign_off: SignOff | None = None  #: who signed for `evaluations`
    #: which of these results do not follow from the project as it is, and because of what
    outdated: tuple[str, ...] = ()
    others: Mapping[str, Calibration] = field(default_factory=dict)  #: calibrations by further methods, by their titles
    #: figures and maps of the photogrammetric calibration's uncertainty over the working volume
    volume: tuple[Mapping[str, Any], Mapping[str, Array]] | None = None
    #: the control charts of the pairs of devices whose captures `orient` has looked at
    drift: tuple[tuple[DriftPoint, ...], ...] = ()
    #: by projector and capture, the curves (k, 2) of level and light (0 to 1) that measuring has found
    responses: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    #: poses by which captures of one object were merged last, and their sigmas (n-1, 6) in rad and mm
    merged: tuple[Registration, Array] | None = None

    @property
    def name(self) -> str:
        """The project's name, or its folder's where it has none."""
        return self.project.name or self.project.path.name

    @property
    def calibrations(self) -> dict[str, Calibration]:
        """Every calibration by its title."""
        own = {"photogrammetric calibration": self.photogrammetric, "depth calibration": self.depth}
        return {**{title: c for title, c in own.items() if c is not None}, **self.others}


@dataclass(frozen=True)
class ReportPaths:
    """The files of a report; `outdated` as `ReportData` says it."""

    html: Path
    pdf: Path
    outdated: tuple[str, ...] = ()


@dataclass(frozen=True)
class CalibratedDevice:
    """A device with its name in the network and what it is, if that is known."""

    name: str
    kind: Kind | None
    device: AdjustedDevice

    @property
    def phrase(self) -> str:
        """What sentences call the device."""
        return f"the {self.kind}" if self.kind else self.name


def calibrated_devices(data: ReportData) -> list[CalibratedDevice]:
    """All devices with an interior orientation, the camera first.

    Those of the photogrammetric calibration if there is one, else those of the adjustment.
    """
    if data.photogrammetric is not None:
        found = data.photogrammetric
        kinds: dict[str, Kind] = {}  # of devices that are the only one of theirs
        if len(found.cameras) == 1:
            kinds[found.cameras[0]] = "camera"
        if len(found.projectors) == 1:
            kinds[found.projectors[0]] = "projector"
        return [CalibratedDevice(name, kinds.get(name), device) for name, device in found.devices.items()]
    devices = data.adjustment.devices if data.adjustment is not None else {}
    return [CalibratedDevice(name, kind_of_device(name), device) for name, device in devices.items()]


def kind_of_device(name: str) -> Kind | None:
    """Tell camera from projector by the name of a network's device; None for any other name.

    Examples
    --------
    >>> kind_of_device("cam"), kind_of_device("Projector"), kind_of_device("left")
    ('camera', 'projector', None)
    """
    lower = name.lower()
    if lower in ("cam", "camera"):
        return "camera"
    return "projector" if lower in ("proj", "projector") else None


def captures_in_order(evaluations: tuple[PlaneEvaluation, ...]) -> list[tuple[str, float | None]]:
    """Every evaluated capture once, with its angle in degrees, in the order given."""
    seen: dict[str, float | None] = {}
    for evaluation in evaluations:
        seen.setdefault(evaluation.capture, evaluation.angle_deg)
    return list(seen.items())


def methods_in_order(evaluations: tuple[PlaneEvaluation, ...]) -> list[Method]:
    """Every method used, in the order given."""
    return list(dict.fromkeys(e.method for e in evaluations))


def side_by_side(evaluations: tuple[PlaneEvaluation, ...]) -> list[PlaneEvaluation]:
    """Sort the evaluations so that the methods stand together at every capture."""
    captures = [name for name, _ in captures_in_order(evaluations)]
    methods = methods_in_order(evaluations)
    return sorted(evaluations, key=lambda e: (captures.index(e.capture), methods.index(e.method)))


def plane_name(evaluation: PlaneEvaluation, evaluations: tuple[PlaneEvaluation, ...]) -> str:
    """Name a plane's capture, and who saw it if the evaluations are of several."""
    several = len({e.devices for e in evaluations}) > 1
    return f"{evaluation.capture}, {' and '.join(evaluation.devices)}" if several else evaluation.capture


def warnings_of(data: ReportData) -> list[tuple[str, str]]:
    """What the calibrations warn of, each once: (which calibration, warning)."""
    sources = [("network", data.adjustment.warnings)] if data.adjustment is not None else []
    sources += [(title, calibration.warnings) for title, calibration in data.calibrations.items()]
    seen: dict[str, str] = {}
    for source, texts in sources:
        for text in texts:
            seen.setdefault(text, source)
    return [(source, text) for text, source in seen.items()]


def verdicts_of(data: ReportData) -> list[tuple[str, Verdict]]:
    """Give the verdicts on calibrations and planes, the worst first."""
    found = [(title, calibration.verdict) for title, calibration in data.calibrations.items()]
    if data.photogrammetric is None and data.adjustment is not None:
        found.append(("network", data.adjustment.verdict))
    told = [(name, verdict) for name, verdict in found if verdict is not None]
    told += [
        (f"{plane_name(e, data.evaluations)}, {e.method}", e.verdict) for e in data.evaluations if e.verdict is not None
    ]
    return sorted(told, key=lambda entry: ("failed", "doubtful", "passed").index(entry[1].state))


def finite_deviations(evaluation: PlaneEvaluation) -> np.ndarray:
    """Give the deviations in mm, shape (k,), of the pixels that have one."""
    values = np.asarray(evaluation.deviation_mm, dtype=np.float64).ravel()
    return values[np.isfinite(values)]
