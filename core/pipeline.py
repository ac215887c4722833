"""The seven stages in order, each on a project folder: what the command line, the window and a script call.

    capture -> decode -> measure -> calibrate -> reconstruct -> evaluate -> report

A stage takes what it needs from the captures and from ``results/`` in the project, and writes its own result there.
Nothing is written before a stage has succeeded.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from core.errors import InputError
from core.figures import evaluation_figures, targets_figures
from core.model import (
    Adjustment,
    Calibration,
    Capture,
    DepthCalibration,
    Method,
    PhaseMap,
    PhotogrammetricCalibration,
    PlaneEvaluation,
    PointCloud,
    Project,
    Role,
    TargetSet,
    Testfield,
)
from core.progress import SILENT, Progress
from core.project import (
    add_capture,
    atomic_write,
    find_project,
    iterate_images,
    load_archive,
    read_capture,
    read_network,
    read_project,
    save_archive,
    write_json,
)

if TYPE_CHECKING:
    from core.bench import Rig
    from core.capture import CaptureReport
    from core.report import ReportData, ReportPaths

Side = Literal["front", "back"]
BOARDS: tuple[Role, ...] = ("testfield", "depth")
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


def result_path(project: Project, name: str) -> Path:
    """Where the program keeps a result of a project."""
    return project.path / "results" / name


# ------------------------------------------------------------------------------------------------------------ capture


def simulate_project(out: Path, scenario: str = "paper", seed: int = 0, progress: Progress = SILENT) -> Project:
    """Let the virtual bench record a project in a new folder, as a rig would."""
    from core.bench import simulate

    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(out, "there is something already", "give a new or empty folder")
    return read_project(simulate(out, scenario, seed, progress))


def capture_into(
    folder: Path,
    name: str,
    role: Role,
    *,
    projector: str | None = None,
    camera: str | None = None,
    testfield: str | None = None,
    z_mm: float | None = None,
    angle_deg: float | None = None,
    progress: Progress = SILENT,
) -> CaptureReport:
    """Record one capture with a projector and a camera and add it to a project.

    Without a URL of either, the virtual bench's rig of the project's sizes is taken.
    """
    from core.capture import run_capture

    project = read_project(folder)
    if projector is None or camera is None:
        virtual = _virtual_rig(project)
        projector, camera = projector or virtual, camera or virtual
    report = run_capture(
        project,
        name,
        role,
        projector,
        camera,
        testfield=testfield,
        z_mm=z_mm,
        angle_deg=angle_deg,
        progress=progress,
    )
    add_capture(project.path, report.folder.resolve().relative_to(project.path.resolve()).as_posix())
    return report


def _virtual_rig(project: Project) -> str:
    from core.bench import experiment, scenarios

    def sizes(owner: Project | Rig) -> tuple[int, int, int, int]:
        return owner.camera.width, owner.camera.height, owner.projector.width, owner.projector.height

    for name in scenarios():
        if sizes(experiment(name).rig) == sizes(project):
            return f"virtual:{name}"
    raise InputError(
        project.path,
        "no virtual rig has this camera and projector",
        "name the devices with --projector URL and --camera URL",
    )


# ------------------------------------------------------------------------------------------------------------- decode


def decode_capture(folder: Path, progress: Progress = SILENT) -> PhaseMap:
    """Decode the frames of one capture, in a project or on its own."""
    root = find_project(folder)
    project = read_project(root) if root else None
    capture = read_capture(folder, project)
    return _decode(capture, list(iterate_images(capture, project.camera if project else None)), project, progress)


def _decode(capture: Capture, images: list, project: Project | None, progress: Progress) -> PhaseMap:
    from core.decode import decode

    lines = (project.projector.width, project.projector.height) if project else None
    patterns = [frame.pattern for frame in capture.frames]
    return decode(patterns, images, lines=lines, where=str(capture.path), progress=progress)


def phase_maps(
    project: Project, captures: Iterable[Capture], progress: Progress = SILENT
) -> Iterator[tuple[Capture, PhaseMap]]:
    """Decode captures one after the other; the next one loads while this one decodes, so memory stays flat."""
    waiting = list(captures)
    with ThreadPoolExecutor(1) as pool:

        def load(capture: Capture) -> list:
            return list(iterate_images(capture, project.camera))

        ahead = [pool.submit(load, waiting[0])] if waiting else []
        for i, capture in enumerate(waiting):
            progress(i / len(waiting), f"decoding {capture.name}")
            images = ahead.pop().result()
            if i + 1 < len(waiting):
                ahead.append(pool.submit(load, waiting[i + 1]))
            yield capture, _decode(capture, images, project, SILENT)


def write_phase(out: Path, phase: PhaseMap) -> None:
    """Write a phase map as NPZ, one array for each of its fields."""
    with atomic_write(out) as file:
        np.savez(file, **{f.name: getattr(phase, f.name) for f in fields(PhaseMap)})


def read_phase(path: Path) -> PhaseMap:
    """Read what `write_phase` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        return PhaseMap(**{f.name: stored[f.name] for f in fields(PhaseMap)})


def captures_of(project: Project, role: Role) -> list[Capture]:
    """Read all captures of one role, in the project's order."""
    return [c for c in (read_capture(folder, project) for folder in project.captures) if c.role == role]


# ------------------------------------------------------------------------------------------------------------ measure


def measure_project(project: Project, progress: Progress = SILENT) -> tuple[TargetSet, ...]:
    """Measure the targets of all captures that have picks, and keep them in the project."""
    captures = [c for role in BOARDS for c in captures_of(project, role) if c.seeds]
    if not captures:
        raise InputError(project.path, "no capture has picks.json", "pick 4 targets in each testfield capture")
    side = {role: _side_seen([c for c in captures if c.role == role]) for role in BOARDS}
    maps = phase_maps(project, captures, progress)
    targets = tuple(_measure(capture, phase, project, side[capture.role]) for capture, phase in maps)
    _save_targets(project, targets)
    return targets


def _save_targets(project: Project, targets: Sequence[TargetSet]) -> None:
    save_archive(result_path(project, "targets.npz"), tuple(targets))
    write_json(result_path(project, "targets.json"), targets_figures(targets))


def _side_seen(captures: list[Capture]) -> Side:
    """From which side of its nominal frame most picks show a board; picks that show the other are then refused.

    The nominal frame may have its Z axis towards the viewer (y up) or away from him (y down): both are in use.
    """
    from core.measure import side_seen

    votes = 0
    for capture in captures:
        if capture.testfield is not None and len(capture.seeds) >= 4:
            known = capture.testfield.index()
            if all((seed.row, seed.col) in known for seed in capture.seeds):
                votes += 1 if side_seen(capture.testfield, capture.seeds) == "front" else -1
    return "front" if votes >= 0 else "back"


def _measure(capture: Capture, phase: PhaseMap, project: Project, side: Side) -> TargetSet:
    from core.measure import MeasureOptions, measure_targets

    if capture.testfield is None:
        raise InputError(capture.path / "capture.json", "picks, but no testfield", 'name the board in "testfield"')
    targets = measure_targets(
        phase,
        capture.testfield,
        capture.seeds,
        project.camera,
        capture=str(capture.path),
        options=MeasureOptions(side=side),
    )
    return replace(targets, capture=capture.name)


# ---------------------------------------------------------------------------------------------------------- calibrate


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
        _save_targets(project, targets)
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
    side = _side_seen(captures)
    targets = []
    for capture, phase in phase_maps(project, captures, progress.part(0.0, 0.9)):
        targets.append(_measure(capture, phase, project, side))
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
    side = _side_seen(captures)
    planes = []
    for capture, phase in phase_maps(project, captures, progress.part(0.0, 0.7)):
        targets = _measure(capture, phase, project, side) if capture.seeds else None
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


# -------------------------------------------------------------------------------------------------------- reconstruct


def reconstruct_capture(
    project: Project, name: str, method: Method | None = None, extrapolate: bool = False, progress: Progress = SILENT
) -> tuple[PhaseMap, PointCloud]:
    """Reconstruct one capture (by its name or its folder) with one calibration, the photogrammetric one by default."""
    from core.reconstruct import reconstruct

    calibrations = load_calibrations(project)
    chosen = method or next(iter(calibrations))
    if chosen not in calibrations:
        raise InputError(
            project.path, f"no {chosen} calibration", f"run `stripe-core calibrate --method {chosen}` first"
        )
    capture = find_capture(project, name)
    images = list(iterate_images(capture, project.camera))
    phase = _decode(capture, images, project, progress.part(0.0, 0.5))
    cloud = reconstruct(phase, calibrations[chosen], extrapolate=extrapolate, progress=progress.part(0.5, 1.0))
    return phase, cloud


def write_cloud(out: Path, phase: PhaseMap, cloud: PointCloud) -> int:
    """Write a point cloud as NPZ or PLY, by the name's ending; give the number of valid points."""
    from core.reconstruct import write_npz, write_ply

    with atomic_write(out) as file:
        if out.suffix.lower() == ".ply":
            write_ply(file, cloud, phase.image)
        else:
            write_npz(file, cloud)
    return int(np.isfinite(cloud.xyz_mm[..., 2]).sum())


def find_capture(project: Project, name: str) -> Capture:
    """Read the capture that a user named: the folder's name, its path from the project, or its path."""
    for folder in (*(f for f in project.captures if f.name == name), project.path / name, Path(name)):
        if (folder / "capture.json").is_file():
            return read_capture(folder, project)
    names = ", ".join(folder.name for folder in project.captures) or "no captures"
    raise InputError(project.path, f"no capture {name!r}", f"choose among {names}")


# ----------------------------------------------------------------------------------------------------------- evaluate


def evaluate_project(project: Project, progress: Progress = SILENT) -> tuple[PlaneEvaluation, ...]:
    """Judge every plane capture by every calibration; keep the deviations in the project."""
    from core.evaluate import evaluate_plane
    from core.reconstruct import reconstruct

    calibrations = load_calibrations(project)
    planes = captures_of(project, "plane")
    if not planes:
        raise InputError(
            project.path, "no capture of role plane", "capture the plane-table and list it in project.json"
        )
    evaluations = []
    for capture, phase in phase_maps(project, planes, progress):
        for method, calibration in calibrations.items():
            cloud = reconstruct(phase, calibration)
            evaluations.append(
                evaluate_plane(phase, cloud, capture=capture.name, angle_deg=capture.angle_deg, method=method)
            )
    result = tuple(sorted(evaluations, key=lambda e: METHODS.index(e.method)))
    save_archive(result_path(project, "evaluation.npz"), result)
    write_json(result_path(project, "evaluation.json"), evaluation_figures(result))
    return result


def load_evaluation(project: Project) -> tuple[PlaneEvaluation, ...]:
    """Read the evaluation that the project has."""
    return load_archive(result_path(project, "evaluation.npz"), tuple)


# ------------------------------------------------------------------------------------------------------------- report


def report_data(project: Project, evaluations: tuple[PlaneEvaluation, ...]) -> ReportData:
    """Gather what a report tells of, from the project's results."""
    from core.report import ReportData

    calibrations = load_calibrations(project)
    adjustment = None
    if "photogrammetric" in calibrations:
        adjustment = load_archive(result_path(project, "adjustment.npz"), Adjustment)
    truth = project.path / "truth.json"
    return ReportData(
        project=project,
        adjustment=adjustment,
        photogrammetric=calibrations.get("photogrammetric"),  # type: ignore[arg-type]
        depth=calibrations.get("polynomial"),  # type: ignore[arg-type]
        evaluations=evaluations,
        truth=json.loads(truth.read_text()) if truth.exists() else None,
        made_on=f"{date.today():%Y-%m-%d}",
        made_by=f"stripe-core {version('stripe-workbench')}",
    )


def report_project(project: Project, out: Path | None = None, progress: Progress = SILENT) -> ReportPaths:
    """Write the HTML and PDF report from the project's calibrations; its planes are evaluated by them first."""
    from core.report import write_report

    evaluations: tuple[PlaneEvaluation, ...] = ()
    if captures_of(project, "plane"):
        evaluations = evaluate_project(project, progress.part(0.0, 0.5))
    data = report_data(project, evaluations)
    return write_report(data, out or result_path(project, "report"), progress=progress.part(0.5, 1.0))


def result_tables(project: Project, evaluations: tuple[PlaneEvaluation, ...] = ()) -> str:
    """Tables 1 to 3 of a project's results as text."""
    from core.report import tables, text_table

    return "\n\n".join(text_table(table) for table in tables(report_data(project, evaluations)))
