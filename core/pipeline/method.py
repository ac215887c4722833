"""What the program must know of a method of calibration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from core.model import (
    Capture,
    Concern,
    DeviceSpec,
    Figures,
    Interior,
    LeftOut,
    PhaseMap,
    PointCloud,
    Project,
    Role,
    TargetSet,
)
from core.pipeline.evidence import Evidence
from core.progress import Progress


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
    """A method of calibration.

    Attributes
    ----------
    title : str
        What reports call its result, such as "depth calibration".
    result : type
        A frozen dataclass with at least the fields of `core.model.Calibration`.
    roles : tuple of str
        Of the captures that it reads.
    none : tuple of str
        What is missing where there are no such captures, and the remedy.
    calibrate : callable
        ``(project, captures, options, progress) -> Calibrated``; where it reads other methods' calibrations, those by
        name come last.
    reconstruct : callable
        ``(phase, calibration, extrapolate, progress) -> cloud``, in the frame of the phase map's camera.
    figures : callable
        ``(calibration) -> dict``, for `calibrate --json`; verdict, left out and warnings are added to it.
    devices : callable
        ``(project, calibration) -> (name, in project.json, as calibrated)`` of all devices that it is of.
    camera : callable
        ``(phase, calibration) -> interior``: the camera that points are reconstructed with, None if there is no such.
    judge : callable
        ``(evidence, name, calibration) -> Judgement``; what is wrong with the captures themselves is added to it.
    usable : callable
        ``(capture) -> bool``: whether a capture of these roles can be used.
    about : str
        What it is made from and where it measures, for who has to choose.
    options : tuple of str
        Fields of `CalibrateOptions` that it reads.
    beside : mapping
        Further archives of a run, and what they hold.
    least : int
        Captures without which it waits, as long as another method has enough.
    reads : tuple of str
        Methods, earlier in `METHODS`, whose calibrations it takes into account where there are any.
    scaled : bool
        It reads the known lengths.
    reused : bool
        Its result is taken from an earlier run that was made from the same.
    one_pair : bool
        It is of one camera with one projector, those that the rig names first.
    joint : bool
        Points that several cameras saw may be intersected from the rays of all.
    outside : str
        Why a decoded pixel may have no point.
    """

    title: str
    result: type
    roles: tuple[Role, ...]
    none: tuple[str, str]
    calibrate: Callable[..., Calibrated]
    reconstruct: Callable[[PhaseMap, Any, bool, Progress], PointCloud]
    figures: Callable[[Any], Figures]
    devices: Callable[[Project, Any], Sequence[tuple[str, DeviceSpec, DeviceSpec]]]
    camera: Callable[[PhaseMap, Any], Interior | None] = lambda _phase, _calibration: None
    judge: Callable[[Evidence, str, Any], Judgement] = lambda e, name, _: Judgement(left_out=e.left_out(name))
    usable: Callable[[Capture], bool] = lambda _capture: True
    about: str = ""
    options: tuple[str, ...] = ()
    beside: Mapping[str, type] = field(default_factory=dict)
    least: int = 1
    reads: tuple[str, ...] = ()
    scaled: bool = False
    reused: bool = False
    one_pair: bool = False
    joint: bool = False
    outside: str = "no intersection in front of the rig"

    def uses(self, capture: Capture) -> bool:
        """Whether a capture is one of those that it reads."""
        return capture.role in self.roles and self.usable(capture)
