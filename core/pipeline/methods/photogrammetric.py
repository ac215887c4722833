"""The bundle adjustment of a testfield that was moved: every device's interior and relative orientation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from core.digits import unit_hint
from core.errors import InputError
from core.figures import photogrammetric_figures
from core.geometry import camera_for
from core.model import (
    Adjustment,
    Capture,
    Concern,
    DeviceSpec,
    PhotogrammetricCalibration,
    Project,
    ScaleBar,
    StationId,
    TargetSet,
    Testfield,
)
from core.pipeline.decode import Look
from core.pipeline.evidence import Evidence, because_of, notes_of
from core.pipeline.measure import common_testfield, look_at_boards
from core.pipeline.method import ADJUSTMENT, Calibrated, CalibrationMethod, Judgement, intersected
from core.pipeline.options import CalibrateOptions
from core.progress import Progress

CONTRADICTING = 1.05  # no printed board is so out of shape, and no adjustment finds what is
DOUBTED = 3.3  # sigmas of a length, which may be measured roughly


def _look(project: Project, captures: list[Capture], options: CalibrateOptions) -> Look:
    known = common_testfield(captures).index()  # refused before anything is decoded
    bars = [("scale", project.scale), *((f"lengths, entry {i}", bar) for i, bar in enumerate(project.lengths))]
    for where, end in ((where, end) for where, bar in bars if bar is not None for end in (bar.start, bar.stop)):
        if end not in known:
            seen = f"names target row {end[0]}, col {end[1]}, which the testfield of {captures[0].name} lacks"
            remedy = "name two of its targets, or correct testfield in capture.json if another board was captured"
            raise InputError(f"{project.path / 'project.json'}: {where}", seen, remedy)
    check_lengths(project.path, {where: bar for where, bar in bars if bar is not None}, captures[0].testfield)
    return look_at_boards(project, captures)


def check_lengths(folder: Path, bars: Mapping[str, ScaleBar], board: Testfield | None) -> None:
    """Refuse measured distances that contradict each other by the nominal board, in whatever unit that is."""
    if board is None or len(bars) < 2:
        return
    index, xyz = board.index(), board.xyz_mm
    own = {k: float(np.linalg.norm(xyz[index[bar.start]] - xyz[index[bar.stop]])) for k, bar in bars.items()}
    times = {k: bar.length_mm / max(own[k], 1e-9) for k, bar in bars.items()}
    known_to = {k: DOUBTED * bar.sigma_mm / bar.length_mm for k, bar in bars.items()}
    middle = float(np.median([1.0, *(times[k] for k in times if known_to[k] < np.log(CONTRADICTING))]))
    off = {k: abs(np.log(times[k] / middle)) for k in times}
    worst = max(times, key=lambda k: off[k] - known_to[k])
    other = min((k for k in times if k != worst), key=lambda k: off[k] + known_to[k])
    if abs(np.log(times[worst] / times[other])) > np.log(CONTRADICTING) + np.hypot(known_to[worst], known_to[other]):
        seen = (
            f"length_mm is {bars[worst].length_mm:g}, {times[worst]:.4g} times what the nominal testfield has there; "
            f"{other}: {times[other]:.4g} times{unit_hint(times[worst] / times[other])}"
        )
        raise InputError(f"{folder / 'project.json'}: {worst}", seen, "correct length_mm, or from and to")


def _calibrate(
    project: Project,
    captures: list[Capture],
    options: CalibrateOptions,
    progress: Progress,
    measured: Callable[[], list[TargetSet]],
) -> Calibrated:
    from core.calibrate import CALIBRATION_OPTIONS, calibrate_photogrammetric
    from core.checks import bar_notes
    from core.measure import kind_of

    testfield = common_testfield(captures)
    targets = measured()
    with because_of({"project.json": bar_notes(project.scale, testfield), **notes_of(targets)}):
        calibration, adjustment = calibrate_photogrammetric(
            project.rig,
            testfield,
            targets,
            scale=project.scale,
            lengths=project.lengths,
            rigid=options.rigid,
            hold=options.hold,
            options=replace(CALIBRATION_OPTIONS, reject_beyond=options.reject_beyond),
            recentred=partial(_recentred, targets, testfield) if kind_of(testfield).recentred else None,
            progress=progress.part(0.9, 1.0),
        )
    bars = [bar for bar in (project.scale, *project.lengths) if bar is not None]
    notes = [f"{t.capture}: {note}" for t in targets for note in t.notes]
    notes += [] if bars else [_unscaled(adjustment)]
    warnings = (*notes, *words_from_behind(project, captures, adjustment), *calibration.warnings)
    return Calibrated(replace(calibration, warnings=warnings), targets, {ADJUSTMENT: adjustment})


def placing_concerns(project: Project, captures: Sequence[Capture], adjustment: Adjustment) -> list[Concern]:
    """Tell known distances that may be between other targets: of boards that nobody picked, or everybody mirrored."""
    from core import checks
    from core.measure import kind_of, symmetries

    board = common_testfield(captures)
    bars = [bar for bar in (project.scale, *project.lengths) if bar is not None]
    if kind_of(board).coded:
        return []
    if any(c.seeds for c in captures):
        return checks.mirrored_concerns(adjustment, board, bars, project.rig.cameras)
    namings = [(np.array(turn), np.array(shift)) for turn, shift in symmetries(board)]
    return checks.turned_concerns(adjustment, board, bars, namings)


def words_from_behind(project: Project, captures: Sequence[Capture], adjustment: Adjustment) -> list[str]:
    """Tell picks in mirrored order where nothing else comes of them."""
    from core import checks

    if not any(c.seeds for c in captures) or placing_concerns(project, captures, adjustment):
        return []
    if not checks.named_from_behind(adjustment, common_testfield(captures), project.rig.cameras):
        return []
    return [
        "the boards are seen from behind, by the order in which the picks name targets: right in a mirror or through "
        "glass; else rows or columns were counted from the wrong side, and x_mm and y_mm of each target are another's"
    ]


def _recentred(targets: Sequence[TargetSet], testfield: Testfield, adjustment: Adjustment) -> list[TargetSet]:
    """Take what a target's shape adds to its centre from the adjusted camera and poses."""
    from core.measure import kind_of

    recentred = kind_of(testfield).recentred
    assert recentred is not None
    adjusted, nominal = (float(np.ptp(xyz)) for xyz in (adjustment.points_mm, adjustment.network.point_xyz_mm))
    if not 0.8 < adjusted / nominal < 1.25:  # dots and distances are in different units: no ellipse fits
        return list(targets)
    poses = dict(zip(adjustment.network.station_ids, adjustment.station_from_object, strict=True))
    index, true = testfield.index(), testfield.xyz_mm.copy()
    true[[index[i.row, i.col] for i in adjustment.network.point_ids]] = adjustment.points_mm  # the board as it is bent
    testfield = replace(testfield, xyz_mm=true)
    result = []
    for t in targets:
        device = adjustment.devices.get(t.camera)
        pose = poses.get(StationId(t.capture, t.camera), poses.get(StationId(t.capture, t.camera, t.projector)))
        if device is not None and pose is not None:
            t = recentred(t, testfield, device.spec, device.interior, pose)
        result.append(t)
    return result


def _judge(evidence: Evidence, name: str, calibration: PhotogrammetricCalibration) -> Judgement:
    from core import checks

    adjustment, targets = evidence.beside[ADJUSTMENT], evidence.targets(name)
    assert isinstance(adjustment, Adjustment)
    rejected, lonely = checks.rejected_of(adjustment, targets)
    lengths = [c for c in evidence.lengths if c.about != "plates"]  # which the adjustment does not use
    if any(c.state == "failed" for c in lengths):  # a wrong unit bends more than the rig
        adjustment = replace(adjustment, doubts=tuple(c for c in adjustment.doubts if c.about != "rigid"))
    concerns = [
        *checks.adjustment_concerns(adjustment, rejected),
        *checks.uneven_axes(adjustment),
        *checks.misplaced_concerns(common_testfield(evidence.used[name]), adjustment, targets),
        *lengths,
        *placing_concerns(evidence.project, evidence.used[name], adjustment),
        *checks.nominal_concerns(calibration.devices, evidence.project.rig.cameras),
    ]
    alone = checks.left_out_of([], lonely, why="seen from one place only")
    return Judgement(concerns, checks.sound_words(adjustment), (*evidence.left_out(name, rejected), *alone))


def _devices(project: Project, calibration: PhotogrammetricCalibration) -> Sequence[tuple[str, DeviceSpec, DeviceSpec]]:
    if project.rig.is_pair:
        pair = (("camera", project.camera, calibration.camera), ("projector", project.projector, calibration.projector))
        return [(name, there, device.spec) for name, there, device in pair]
    there = project.rig.devices
    return [(name, there[name], device.spec) for name, device in calibration.devices.items() if name in there]


def _unscaled(adjustment: Adjustment) -> str:
    """Say that the nominal board gives the scale, and how sure that is by what its targets are off their places."""
    nominal, found = adjustment.network.point_xyz_mm, adjustment.points_mm
    known = np.isfinite(nominal + found).all(axis=1)
    places = (nominal - nominal[known].mean(axis=0))[known]
    outwards = np.sum((found - nominal)[known] * places, axis=1)
    unsure = float(np.sqrt(np.sum(outwards**2)) / np.sum(places**2))
    return (
        "no measured length: the scale is that of the nominal testfield. Its targets' deviations leave it "
        f"{1e6 * unsure:.2g} ppm unsure, an error that all share any amount, and no sigma contains either; measure a "
        'length and give it as "scale"'
    )


PHOTOGRAMMETRIC = CalibrationMethod(
    title="photogrammetric calibration",
    result=PhotogrammetricCalibration,
    roles=("testfield",),
    none=("no capture of a testfield", "capture a moved testfield, named in capture.json"),
    calibrate=_calibrate,
    looks=_look,
    reconstruct=intersected,
    figures=photogrammetric_figures,
    devices=_devices,
    camera=lambda phase, calibration: camera_for(phase, calibration).interior,
    judge=_judge,
    usable=lambda capture: capture.testfield is not None or bool(capture.seeds),
    about="From the moved testfield alone. Measures anywhere, with the sigma of every point.",
    options=("rigid", "hold", "reject_beyond"),
    beside={ADJUSTMENT: Adjustment},
    scaled=True,
    reused=True,
    joint=True,
)
