"""Stage 4: both calibrations of a project, and the adjustment of a network alone."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from core.errors import InputError
from core.figures import calibration_figures
from core.model import (
    Adjustment,
    Calibration,
    Capture,
    DepthCalibration,
    DeviceSpec,
    Method,
    PhotogrammetricCalibration,
    Project,
    TargetSet,
    Testfield,
)
from core.pipeline.decode import phase_maps
from core.pipeline.folders import captures_of
from core.pipeline.inputs import Record, calibrated_from
from core.pipeline.judge import judge_adjustment, judge_calibrations
from core.pipeline.measure import (
    boards_of,
    measured_or_why,
    measured_targets,
    save_targets,
    side_of,
    signs_of,
    turned_together,
)
from core.pipeline.options import CalibrateOptions, check_options
from core.pipeline.picking import current_target_sets
from core.pipeline.runs import Run, calibration_file, current_run, keep_run, now
from core.progress import SILENT, Progress
from core.project import load_archive, read_network
from core.project.lock import writing_results


def calibrate_project(
    project: Project,
    method: Method | Literal["all"] = "all",
    options: CalibrateOptions | None = None,
    progress: Progress = SILENT,
) -> dict[Method, Calibration]:
    """Calibrate the sensor by one method, or by every method the project has captures for; keep the run.

    What follows from the same captures, picks and rig as before is not computed again: the targets of each capture,
    and the depth calibration.

    Raises
    ------
    InputError
        If there are no captures for it, or an option names something unknown.
    AdjustmentError
        If they do not determine the calibration.
    """
    options = options or CalibrateOptions()
    check_options(project, options)
    captures = captures_for(project, method, options)
    with writing_results(project.path, "calibrate"):
        return _calibrate(project, captures, options, progress)


def _calibrate(
    project: Project, captures: dict[Method, list[Capture]], options: CalibrateOptions, progress: Progress
) -> dict[Method, Calibration]:
    done: dict[Method, Calibration] = {}
    archives: dict[str, object] = {}
    held_by: dict[Method, int] = {}
    targets: list[TargetSet] = []
    # of what is there before it is read: what is changed meanwhile is seen to have changed
    records = {m: calibrated_from(project, m, used, options, side_of(used)) for m, used in captures.items()}
    for i, (name, used) in enumerate(captures.items()):
        part = progress.part(i / len(captures), (i + 1) / len(captures))
        if name == "photogrammetric":
            done[name], adjustment = _calibrate_photogrammetric(project, used, options, targets, part)
            archives |= {"photogrammetric.npz": done[name], "adjustment.npz": adjustment}
            continue
        kept = _kept_depth(project, records[name])
        if kept is None:
            done[name] = archives["polynomial.npz"] = _calibrate_depth(project, used, options, targets, part)
        else:
            done[name], held_by[name] = kept
    progress.check()
    _keep_targets(project, targets)
    for name, judged in judge_calibrations(project, done, archives.get("adjustment.npz"), captures, options).items():
        before, done[name] = done[name], judged
        if (before.verdict, before.left_out) != (judged.verdict, judged.left_out):
            archives[f"{name}.npz"] = judged
            held_by.pop(name, None)
    run = Run(
        number=0,
        made_at=now(),
        options=options,
        captures={m: tuple(dict.fromkeys(c.name for c in used)) for m, used in captures.items()},
        excluded={c.name: c.excluded for used in captures.values() for c in used if c.excluded},
        made_from=records,
        figures=calibration_figures(done),
        held_by=held_by,
    )
    keep_run(project, run, archives)
    return done


def captures_for(
    project: Project, method: Method | Literal["all"], options: CalibrateOptions
) -> dict[Method, list[Capture]]:
    """Captures of every method asked for; of "all" those methods that there are captures for."""
    fields = [c for c in boards_of(project) if c.role == "testfield" and c.name not in options.without]
    plates = [c for c in captures_of(project, "depth") if c.name not in options.without]
    found: dict[Method, list[Capture]] = {"photogrammetric": fields, "polynomial": plates}
    if method != "all":
        return {method: found[method]}
    if not fields and not plates:
        raise InputError(
            project.path,
            "neither captures of a testfield nor depth captures",
            "capture a moved testfield, or a plate at known depths",
        )
    if fields and len(plates) == 1:
        del found["polynomial"]  # a single position tells no depth
    return {m: captures for m, captures in found.items() if captures}


def _keep_targets(project: Project, targets: list[TargetSet]) -> None:
    """Keep what was measured, and what was measured before in captures that had no part, as far as it is current."""
    if not targets:
        return
    names = {t.capture for t in targets}
    save_targets(project, [*targets, *(t for t in current_target_sets(project) if t.capture not in names)])


def _calibrate_photogrammetric(
    project: Project,
    captures: list[Capture],
    options: CalibrateOptions,
    measured: list[TargetSet],
    progress: Progress,
) -> tuple[PhotogrammetricCalibration, Adjustment]:
    from core.calibrate import CALIBRATION_OPTIONS, calibrate_photogrammetric

    if not captures:
        raise InputError(project.path, "no capture of a testfield", "capture a moved testfield, named in capture.json")
    testfield = _common_testfield(captures)
    targets = measured_targets(project, captures, progress.part(0.0, 0.9))
    measured += targets
    used: Sequence[TargetSet] = targets
    for start, end in ((0.9, 0.95), (0.95, 1.0)):  # the second time with the eccentricity of the adjusted camera
        calibration, adjustment = calibrate_photogrammetric(
            project.rig,
            testfield,
            used,
            scale=project.scale,
            lengths=project.lengths,
            rigid=options.rigid,
            hold=options.hold,
            options=replace(CALIBRATION_OPTIONS, reject_beyond=options.reject_beyond),
            progress=progress.part(start, end),
        )
        used = _recentred(targets, testfield, adjustment)
    return replace(calibration, warnings=(*_notes(targets), *calibration.warnings)), adjustment


def _recentred(targets: Sequence[TargetSet], testfield: Testfield, adjustment: Adjustment) -> list[TargetSet]:
    """Take what a target's shape adds to its centre from the adjusted camera and poses."""
    from core.measure import kind_of

    recentred = kind_of(testfield).recentred
    if recentred is None:
        return list(targets)
    poses = dict(zip(adjustment.network.station_names, adjustment.station_from_object, strict=True))
    result = []
    for t in targets:
        device, pose = adjustment.devices.get(t.camera), poses.get(f"{t.capture}/{t.camera}")
        if device is not None and pose is not None:
            t = recentred(t, testfield, device.spec, device.interior, pose)
        result.append(t)
    return result


def _kept_depth(project: Project, record: Record) -> tuple[DepthCalibration, int] | None:
    """Give the depth calibration in use if it follows from just this, and the number of the run that holds it."""
    run, path = current_run(project, "polynomial"), calibration_file(project, "polynomial.npz")
    if run is None or path is None or run.made_from.get("polynomial") != record:
        return None
    try:
        return load_archive(path, DepthCalibration), run.holder("polynomial")
    except InputError as error:
        logging.getLogger(__name__).warning("%s: %s; calibrated anew", error.where, error.seen)
        return None


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
    signs = signs_of(project, [c for c in captures if c.testfield is not None or c.seeds], {"depth": side})
    # depth per pixel is a matter of one camera with one projector
    meant = project.rig.camera_name, project.rig.projector_name
    captures = [s for c in captures for s in c.series if len(c.series) == 1 or (s.camera, s.projector) == meant]
    boards = [c for c in captures if c.testfield is not None or c.seeds]
    phases, seen, ways, notes = [], {}, [], []
    for capture, phase in phase_maps(project, captures, progress.part(0.0, 0.7)):
        phases.append(phase)
        if capture.testfield is None:
            notes += [f"{capture.name}: {note}" for note in phase.notes]
        if capture in boards:
            targets, allowed, _ = measured_or_why(capture, phase, project, side)
            ways.append(allowed)
            seen[capture.path] = replace(targets, made_from=signs[capture.path])
    told = dict(zip(seen, turned_together(boards, list(seen.values()), ways), strict=True))
    measured += told.values()
    planes = []
    for capture, phase in zip(captures, phases, strict=True):
        assert capture.z_mm is not None
        found = told.get(capture.path)
        planes.append(DepthPlane(capture.z_mm, phase, found if found is not None and len(found.row) else None))
    fields = [c.testfield for c in boards]
    degree, warnings = _degree_for(len(planes), options.degree)
    calibration = calibrate_depth(
        project.camera,
        fields[0] if fields else None,
        planes,
        options=DepthOptions(degree=degree, low_pass_px=options.low_pass_px),
        progress=progress.part(0.7, 1.0),
    )
    return replace(calibration, warnings=(*notes, *_notes(list(told.values())), *warnings, *calibration.warnings))


def _notes(targets: Sequence[TargetSet]) -> list[str]:
    """What was found about picks and turns, capture by capture."""
    return [f"{t.capture}: {note}" for t in targets for note in t.notes]


def _degree_for(planes: int, wanted: int | None) -> tuple[int | None, list[str]]:
    """Lower the usual degree to what few plates determine, and say so; another one was asked for and stays."""
    usual = CalibrateOptions().degree
    if wanted is None or wanted != usual or not 2 <= planes <= wanted:
        return wanted, []
    return planes - 1, [f"polynomial of degree {planes - 1}, not {wanted}: only {planes} plate positions, add captures"]


def adjust_network(folder: Path, progress: Progress = SILENT) -> Adjustment:
    """Adjust a network of targets that were measured elsewhere."""
    from core.calibrate import adjust

    return judge_adjustment(adjust(read_network(folder), progress=progress))


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
        If there is none, or one is of another camera or projector than the project's.
    """
    kinds: dict[Method, type] = {"photogrammetric": PhotogrammetricCalibration, "polynomial": DepthCalibration}
    found: dict[Method, Calibration] = {}
    for method, kind in kinds.items():
        if (path := calibration_file(project, f"{method}.npz")) is not None:
            found[method] = load_archive(path, kind)
            _check_rig(project, path, found[method])
    if not found:
        raise InputError(project.path, "the project has no calibration", "run `stripe-core calibrate` on it first")
    return found


def _check_rig(project: Project, path: Path, calibration: Calibration) -> None:
    """See that a calibration is of the rig that project.json describes."""
    if isinstance(calibration, DepthCalibration):
        pairs = [(project.camera, "camera", calibration.camera_spec)]
    elif project.rig.is_pair:
        pairs = [(project.camera, "camera", calibration.camera.spec)]
        pairs.append((project.projector, "projector", calibration.projector.spec))
    else:
        devices = project.rig.devices
        pairs = [(devices[n], n, device.spec) for n, device in calibration.devices.items() if n in devices]
    for there, name, then in pairs:
        if (then.width, then.height, then.pitch_mm) != (there.width, there.height, there.pitch_mm):
            raise InputError(
                path,
                f"is of a {name} of {_size(then)}, the one in project.json has {_size(there)}",
                "calibrate again, or correct project.json",
            )


def _size(spec: DeviceSpec) -> str:
    return f"{spec.width} x {spec.height} px of {spec.pitch_mm[0]:g} x {spec.pitch_mm[1]:g} mm"
