"""What the program must know of a method of calibration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any

from core.lazy import dataclass
from core.model import (
    Capture,
    Concern,
    DeviceSpec,
    Figures,
    Interior,
    LeftOut,
    PhaseMap,
    PhotogrammetricCalibration,
    PointCloud,
    Project,
    Role,
    TargetSet,
)
from core.pipeline.decode import Look
from core.pipeline.evidence import Evidence
from core.pipeline.options import CalibrateOptions
from core.progress import Progress

ADJUSTMENT = "adjustment.npz"  # beside a calibration of the devices: the network that it was adjusted from


@dataclass(frozen=True)
class Calibrated:
    """What calibrating gave: the calibration, the targets measured on the way, and further archives by file name."""

    calibration: Any
    targets: Sequence[TargetSet] = ()
    beside: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Judgement:
    """What speaks against a calibration, what to say of it where nothing does, and what was left out of it."""

    concerns: Sequence[Concern] = ()
    sound: Sequence[str] = ()
    left_out: tuple[LeftOut, ...] = ()


def intersected(phase: PhaseMap, calibration: Any, extrapolate: bool, progress: Progress) -> PointCloud:
    """Give the points by `core.reconstruct`, for calibrations that it knows."""
    from core.reconstruct import reconstruct

    return reconstruct(phase, calibration, extrapolate=extrapolate, progress=progress)


@dataclass(frozen=True)
class CalibrationMethod:
    """A method of calibration."""

    title: str  #: what reports call its result, such as "depth calibration"
    result: type  #: a frozen dataclass with at least the fields of `core.model.Calibration`
    roles: tuple[Role, ...]  #: of the captures that it reads
    none: tuple[str, str]  #: what is missing where there are no such captures, and the remedy
    #: ``(project, captures, options, progress) -> Calibrated``; where it has looks, a function that gives what came of
    #: them comes next, and where it reads other methods' calibrations, those by name come last
    calibrate: Callable[..., Calibrated]
    #: ``(phase, calibration, extrapolate, progress) -> cloud``, in the frame of the phase map's camera
    reconstruct: Callable[[PhaseMap, Any, bool, Progress], PointCloud]
    #: ``(calibration) -> dict``, for `calibrate --json`; verdict, left out and warnings are added to it
    figures: Callable[[Any], Figures]
    #: ``(project, calibration) -> (name, in project.json, as calibrated)`` of all devices that it is of
    devices: Callable[[Project, Any], Sequence[tuple[str, DeviceSpec, DeviceSpec]]]
    #: ``(phase, calibration) -> interior``: the camera that points are reconstructed with, None if there is no such
    camera: Callable[[PhaseMap, Any], Interior | None] = lambda _phase, _calibration: None
    #: ``(evidence, name, calibration) -> Judgement``; what is wrong with the captures themselves is added to it
    judge: Callable[[Evidence, str, Any], Judgement] = lambda e, name, _: Judgement(left_out=e.left_out(name))
    #: ``(capture) -> bool``: whether a capture of these roles can be used
    usable: Callable[[Capture], bool] = lambda _capture: True
    about: str = ""  #: what it is made from and where it measures, for who has to choose
    options: tuple[str, ...] = ()  #: fields of `CalibrateOptions` that it reads
    beside: Mapping[str, type] = field(default_factory=dict)  #: further archives of a run, and what they hold
    least: int = 1  #: captures without which it waits, as long as another method has enough
    #: methods, earlier in `METHODS`, whose calibrations it takes into account where there are any
    reads: tuple[str, ...] = ()
    scaled: bool = False  #: it reads the known lengths
    #: ``(project, captures, options) -> Look``: what it wants decoded, which goes on while other methods are at work
    looks: Callable[[Project, list[Capture], CalibrateOptions], Look] | None = None
    reused: bool = False  #: its result is taken from an earlier run that was made from the same
    one_pair: bool = False  #: it is of one camera with one projector, those that its field `devices` names
    joint: bool = False  #: points that several cameras saw may be intersected from the rays of all
    outside: str = "no intersection in front of the rig"  #: why a decoded pixel may have no point

    def uses(self, capture: Capture) -> bool:
        """Whether a capture is one of those that it reads."""
        return capture.role in self.roles and self.usable(capture)

    def is_of(self, project: Project, calibration: Any, camera: str, projector: str) -> bool:
        """Whether a calibration is of these devices: only the one of a rig may have another name there."""
        if self.one_pair:
            return self.pair(project, calibration) == (camera, projector)
        return not strangers(project, calibration, camera, projector)

    def pair(self, project: Project, calibration: Any) -> tuple[str, str]:
        """Name the camera and the projector that a calibration of one pair is of."""
        return project.rig.pair(*getattr(calibration, "devices", ()))


def strangers(project: Project, calibration: Any, camera: str, projector: str) -> list[str]:
    """Name those of two devices that a calibration of devices lacks; of cameras alone, the projector is none."""
    if not isinstance(calibration, PhotogrammetricCalibration):
        return []
    rig = project.rig
    kinds = (camera, calibration.cameras, rig.cameras), (projector, calibration.projectors, rig.projectors)
    return [name for name, known, of_rig in kinds if known and name not in known and len(of_rig) > 1]
