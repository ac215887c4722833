"""Stage 4: both calibrations of a project, and the adjustment of a network alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from core.errors import InputError
from core.model import (
    Adjustment,
    Calibration,
    Capture,
    DepthCalibration,
    Method,
    PhotogrammetricCalibration,
    Project,
    TargetSet,
    Testfield,
)
from core.pipeline.decode import phase_maps
from core.pipeline.folders import captures_of, result_path
from core.pipeline.measure import measure_capture, save_targets, side_of
from core.progress import SILENT, Progress
from core.project import load_archive, read_network, save_archive

METHODS: tuple[Method, ...] = ("photogrammetric", "polynomial")


@dataclass(frozen=True)
class CalibrateOptions:
    """What the operator may choose for both calibrations.

    Attributes
    ----------
    rigid : bool
        One relative orientation of camera and projector for all poses; otherwise every station is free.
    degree : int or None
        Degree of the depth polynomial; None for the piecewise-linear table.
    low_pass_px : float
        Standard deviation of the Gaussian that smooths the depth calibration; 0 for none.
    """

    rigid: bool = True
    degree: int | None = 3
    low_pass_px: float = 2.0


def calibrate_project(
    project: Project,
    method: Method | Literal["all"] = "all",
    options: CalibrateOptions | None = None,
    progress: Progress = SILENT,
) -> dict[Method, Calibration]:
    """Calibrate the sensor by one method, or by every method the project has captures for; keep the results."""
    options = options or CalibrateOptions()
    fields = [c for c in captures_of(project, "testfield") if c.seeds]
    plates = captures_of(project, "depth")
    wanted = [m for m, found in zip(METHODS, (fields, plates), strict=True) if found or m == method]
    wanted = [m for m in wanted if method in (m, "all")]
    if not wanted:
        raise InputError(
            project.path,
            "neither testfield captures with picks nor depth captures",
            "capture a moved testfield and pick 4 targets in each image, or a plate at known depths",
        )
    done: dict[Method, Calibration] = {}
    targets: list[TargetSet] = []
    adjustment: Adjustment | None = None
    for i, name in enumerate(wanted):
        part = progress.part(i / len(wanted), (i + 1) / len(wanted))
        if name == "photogrammetric":
            done[name], adjustment = _calibrate_photogrammetric(project, fields, options, targets, part)
        else:
            done[name] = _calibrate_depth(project, plates, options, targets, part)
    for name, calibration in done.items():
        save_archive(result_path(project, f"{name}.npz"), calibration)
    if adjustment is not None:
        save_archive(result_path(project, "adjustment.npz"), adjustment)
    if method == "all":
        save_targets(project, targets)
    return done


def _calibrate_photogrammetric(
    project: Project,
    captures: list[Capture],
    options: CalibrateOptions,
    measured: list[TargetSet],
    progress: Progress,
) -> tuple[PhotogrammetricCalibration, Adjustment]:
    from core.calibrate import calibrate_photogrammetric

    if not captures:
        raise InputError(project.path, "no testfield capture has picks", "pick 4 targets in each testfield capture")
    testfield = _common_testfield(captures)
    side = side_of(captures)
    targets = []
    for capture, phase in phase_maps(project, captures, progress.part(0.0, 0.9)):
        targets.append(measure_capture(capture, phase, project, side))
    measured += targets
    return calibrate_photogrammetric(
        project.camera,
        project.projector,
        testfield,
        targets,
        scale=project.scale,
        rigid=options.rigid,
        progress=progress.part(0.9, 1.0),
    )


def _calibrate_depth(
    project: Project,
    captures: list[Capture],
    options: CalibrateOptions,
    measured: list[TargetSet],
    progress: Progress,
) -> DepthCalibration:
    from core.calibrate import DepthOptions, DepthPlane, calibrate_depth

    if not captures:
        raise InputError(project.path, "no capture of role depth", "capture a plate at known depths")
    side = side_of(captures)
    planes = []
    for capture, phase in phase_maps(project, captures, progress.part(0.0, 0.7)):
        targets = measure_capture(capture, phase, project, side) if capture.seeds else None
        assert capture.z_mm is not None
        planes.append(DepthPlane(capture.z_mm, phase, targets))
        measured += [targets] if targets else []
    fields = [c.testfield for c in captures if c.seeds]
    return calibrate_depth(
        project.camera,
        fields[0] if fields else None,
        planes,
        options=DepthOptions(degree=options.degree, low_pass_px=options.low_pass_px),
        progress=progress.part(0.7, 1.0),
    )


def adjust_network(folder: Path, progress: Progress = SILENT) -> Adjustment:
    """Adjust a network of targets that were measured elsewhere."""
    from core.calibrate import adjust

    return adjust(read_network(folder), progress=progress)


def _common_testfield(captures: list[Capture]) -> Testfield:
    common: Testfield | None = None
    for capture in captures:
        if capture.testfield is None:
            raise InputError(capture.path / "capture.json", "no testfield", 'name the board in "testfield"')
        if common is not None and capture.testfield.index() != common.index():
            seen = f"another testfield than {captures[0].name}"
            raise InputError(capture.path / "capture.json", seen, "calibrate with one board in all testfield captures")
        common = common or capture.testfield
    assert common is not None
    return common


def load_calibrations(project: Project) -> dict[Method, Calibration]:
    """Read the calibrations that the project has.

    Raises
    ------
    InputError
        If there is none.
    """
    kinds: dict[Method, type] = {"photogrammetric": PhotogrammetricCalibration, "polynomial": DepthCalibration}
    found: dict[Method, Calibration] = {}
    for method, kind in kinds.items():
        if (path := result_path(project, f"{method}.npz")).exists():
            found[method] = load_archive(path, kind)
    if not found:
        raise InputError(project.path, "the project has no calibration", "run `stripe-core calibrate` on it first")
    return found
