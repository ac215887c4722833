"""Depth per pixel from a plate at known depths, as a polynomial or a table of the projector's coordinate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from core.errors import AdjustmentError, InputError
from core.figures import depth_figures
from core.geometry import lens_of, nominal
from core.lazy import dataclass
from core.model import (
    Adjustment,
    Array,
    Capture,
    Concern,
    DepthCalibration,
    DeviceSpec,
    Interior,
    PhaseMap,
    PhotogrammetricCalibration,
    Project,
    TargetSet,
    Testfield,
)
from core.pipeline.decode import Look
from core.pipeline.evidence import Evidence, because_of, lengths_of, notes_of
from core.pipeline.measure import common_testfield, measured_or_why, side_of, signs_of, turned_together
from core.pipeline.method import ADJUSTMENT, Calibrated, CalibrationMethod, Judgement, intersected
from core.pipeline.options import CalibrateOptions
from core.progress import Progress

TOO_BENT, MOST_BENT = 0.5, 4.0  # what a higher degree would explain of the residuals, over what it would leave
LEAST_PLATES = 4  # that curves can be judged by
# of the residuals over those that the noise leaves: of sound polynomials 1.05 at most
RESIDUAL_RATIO, FAILED_RATIO = 1.35, 5.0


@dataclass(frozen=True)
class _Plates:
    """The plate at its positions: captures by one pair of devices, decoded, and the targets of those with a board."""

    captures: Sequence[Capture]
    phases: Sequence[PhaseMap]
    boards: Sequence[Capture]
    targets: Mapping[Path, TargetSet]


def _field(captures: Sequence[Capture]) -> Testfield | None:
    named = [c for c in captures if c.testfield is not None]
    return common_testfield(named) if named else None


def _look(project: Project, captures: list[Capture], options: CalibrateOptions) -> Look:
    side, _ = side_of(captures), _field(captures)  # refused before anything is decoded
    signs = signs_of(project, [c for c in captures if c.testfield is not None or c.seeds], {"depth": side})
    # depth per pixel is a matter of one camera with one projector
    camera, projector = project.rig.pair(options.camera, options.projector)
    of_pair = [s for c in captures for s in c.series if (s.camera, s.projector) == (camera, projector)]
    if lacking := {c.name for c in captures} - {s.name for s in of_pair}:
        remedy = "capture the plate with both, or choose others with --camera and --projector"
        raise InputError(f"capture {min(lacking)}", f"has no frames of {camera} with {projector}", remedy)
    captures = of_pair
    boards = [c for c in captures if c.testfield is not None or c.seeds]

    def each(capture: Capture, phase: PhaseMap) -> tuple[PhaseMap, Any]:
        return phase, measured_or_why(capture, phase, project, side) if capture in boards else None

    def whole(found: Iterable[tuple[Capture, tuple[PhaseMap, Any]]]) -> _Plates:
        made = {capture.path: of for capture, of in found}
        seen = {path: replace(of[0], made_from=signs[path]) for path, (_, of) in made.items() if of is not None}
        told = turned_together(boards, list(seen.values()), [made[path][1][1] for path in seen])
        return _Plates(captures, [phase for phase, _ in made.values()], boards, dict(zip(seen, told, strict=True)))

    return Look(captures, each, whole)


def _calibrate(
    project: Project,
    captures: list[Capture],
    options: CalibrateOptions,
    progress: Progress,
    seen: Callable[[], _Plates],
    earlier: Mapping[str, Any],
) -> Calibrated:
    from core.calibrate import DepthOptions, DepthPlane, calibrate_depth
    from core.measure import kind_of

    field, plates = _field(captures), seen()
    told, decoded = plates.targets, [*zip(plates.captures, plates.phases, strict=True)]
    notes = [f"{c.name}: {note}" for c, phase in decoded if c.testfield is None for note in phase.notes]
    notes += [f"{t.capture}: {note}" for t in told.values() for note in t.notes]
    planes = []
    for capture, phase in decoded:
        assert capture.z_mm is not None
        own = told.get(capture.path)
        planes.append(DepthPlane(capture.z_mm, phase, own if own is not None and len(own.row) else None))
    degree, warnings = _degree_for(len(planes), options.degree)
    devices = project.rig.pair(options.camera, options.projector)
    camera = project.rig.cameras[devices[0]]
    interior = _interior(devices[0], camera, earlier.get("photogrammetric"))
    adjusted = None if field is None else _adjusted(field, earlier.get(ADJUSTMENT))
    try:
        calibration = calibrate_depth(
            camera,
            field,
            planes,
            options=DepthOptions(degree=degree, low_pass_px=options.low_pass_px),
            interior=interior,
            adjusted=adjusted,
            recentred=kind_of(field).recentred if field is not None else None,
            progress=progress,
        )
    except AdjustmentError as error:
        from core.checks import repeated_targets

        known = interior[0] if interior else nominal(camera)
        sets = [t for t in told.values() if len(t.row)]
        scale = None if adjusted is None else project.scale
        told_of = lengths_of(camera, known, plates.boards, {t.capture: t for t in sets}, scale)
        doubts = repeated_targets(sets) or [concern for concern in told_of if concern.state == "failed"]
        if not doubts:
            with because_of({**{c.name: phase.notes for c, phase in decoded}, **notes_of([*told.values()])}):
                raise
        raise AdjustmentError(error.where, error.seen, f"{error.remedy}. First see to this: {doubts[0].text}") from None
    told_all = (*notes, *warnings, *calibration.warnings)
    return Calibrated(replace(calibration, devices=devices, warnings=told_all), list(told.values()))


def _interior(name: str, spec: DeviceSpec, known: PhotogrammetricCalibration | None) -> tuple[Interior, Array] | None:
    """Give the camera's interior orientation and its covariance, from a calibration of the same device."""
    device = known.devices.get(name) if known is not None else None
    if known is None or device is None or device.spec != spec:
        return None
    at = [known.parameter_names.index(f"{name}.{p}") for p in lens_of(device.interior).names]
    return device.interior, known.covariance[np.ix_(at, at)]


def _adjusted(field: Testfield, adjustment: Adjustment | None) -> Testfield | None:
    """Give a board with the coordinates of an adjustment of the same board, nominal ones where that has none."""
    if adjustment is None:
        return None
    index, xyz = field.index(), field.xyz_mm.copy()
    found = [(k, index[t.row, t.col]) for k, t in enumerate(adjustment.network.point_ids) if (t.row, t.col) in index]
    points, own = np.array(found, np.int64).reshape(-1, 2).T
    if 2 * len(own) < len(xyz) or not np.allclose(adjustment.network.point_xyz_mm[points], xyz[own]):
        return None
    xyz[own] = adjustment.points_mm[points]
    return replace(field, xyz_mm=xyz)


def _degree_for(planes: int, wanted: int | None) -> tuple[int | None, list[str]]:
    """Lower the usual degree to what few plates determine, and say so; another one was asked for and stays."""
    usual = CalibrateOptions().degree
    if wanted is None or wanted != usual or not 2 <= planes <= wanted:
        return wanted, []
    return planes - 1, [f"polynomial of degree {planes - 1}, not {wanted}: only {planes} plate positions, add captures"]


def _judge(evidence: Evidence, name: str, depth: DepthCalibration) -> Judgement:
    from core.checks import flatness_concerns, misplaced_on_plate, placed_concerns, travel_concerns

    lengths, (camera, _) = evidence.lengths, POLYNOMIAL.pair(evidence.project, depth)
    known = evidence.calibrations.get(evidence.photogrammetric or "")
    if known is None:
        captures = [c for c in evidence.captures if c.role == "depth"]
        seen = {t.capture: t for t in evidence.sets if t.camera == camera}
        lengths = [*travel_concerns(depth, camera), *lengths_of(depth.camera_spec, depth.camera, captures, seen)]
    of_plates = [c for c in lengths if c.about != "board"]
    plates, board = evidence.plates
    if plates is not None and board is not None and not evidence.same_board:
        of_plates = [*misplaced_on_plate(board, plates), *of_plates]
    if not of_plates and isinstance(known, PhotogrammetricCalibration) and known.camera_name == camera:
        of_plates = placed_concerns(depth, plates)  # in that camera's frame
    of_plates = [*of_plates, *flatness_concerns(depth, plates)]
    sound = (f"residuals of {depth.residual_rms_mm:.3g} mm r.m.s.",)
    return Judgement([*of_plates, *_of_residuals(depth)], sound, evidence.left_out(name))


def _of_residuals(depth: DepthCalibration) -> list[Concern]:
    noise_mm = depth.noise_rms_mm or 0.0
    if depth.between_rms_mm > TOO_BENT * noise_mm:
        curves = "straight lines" if depth.degree in (None, 1) else f"polynomials of degree {depth.degree}"
        text = (
            f"{curves} through {len(depth.depths_mm)} plate positions are off by about {depth.between_rms_mm:.2g} mm "
            f"r.m.s. between them, by the plate's distance, and no residual shows it (noise {noise_mm:.2g} mm): "
            f"capture the plate at {max(LEAST_PLATES, len(depth.depths_mm) + 1)} positions or more"
        )
        return [Concern("failed" if depth.between_rms_mm > MOST_BENT * noise_mm else "doubtful", text)]
    rest = max(depth.residual_rms_mm**2 - depth.bent_rms_mm**2, 0.0) ** 0.5
    if depth.bent_rms_mm > TOO_BENT * rest:
        text = (
            f"degree {depth.degree} is too low: polynomials of degree {(depth.degree or 0) + 1} would leave "
            f"{rest:.3g} mm of the residuals of {depth.residual_rms_mm:.3g} mm: calibrate with a higher degree"
        )
        return [Concern("failed" if depth.bent_rms_mm > MOST_BENT * rest else "doubtful", text)]
    if depth.degree is None:
        return _of_table(depth, noise_mm)
    ratio = depth.residual_rms_mm / (noise_mm or np.inf)
    if ratio <= RESIDUAL_RATIO:
        return []
    text = (
        f"residuals of {depth.residual_rms_mm:.3g} mm are {ratio:.3g} times what the noise leaves: a plate does not "
        "stand where z_mm says or is tilted against the others, it is not flat, or the degree is too low"
    )
    return [Concern("failed" if ratio > FAILED_RATIO else "doubtful", text)]


def _of_table(depth: DepthCalibration, noise_mm: float) -> list[Concern]:
    """Its residuals are those of inner positions from their neighbours: in the middle of chords twice as long.

    A chord's largest error grows with the square of its length, and its r.m.s. is the root of 8/15 of that.
    """
    off_mm = (max(depth.residual_rms_mm**2 - 1.5 * noise_mm**2, 0.0) * 8 / 15) ** 0.5 / 4
    if off_mm <= TOO_BENT * noise_mm:
        return []
    text = (
        f"between its positions the table is off by about {off_mm:.2g} mm r.m.s. (noise {noise_mm:.2g} mm): capture "
        "the plate at smaller steps, or take polynomials; where steps are small, a plate does not stand where z_mm says"
    )
    return [Concern("failed" if off_mm > MOST_BENT * noise_mm else "doubtful", text)]


def _devices(project: Project, depth: DepthCalibration) -> list[tuple[str, DeviceSpec, DeviceSpec]]:
    name, _ = POLYNOMIAL.pair(project, depth)
    return [(name, project.rig.cameras[name], depth.camera_spec)]


POLYNOMIAL = CalibrationMethod(
    title="depth calibration",
    result=DepthCalibration,
    roles=("depth",),
    none=("no capture of role depth", "capture a plate at known depths"),
    calibrate=_calibrate,
    looks=_look,
    reconstruct=intersected,
    figures=depth_figures,
    devices=_devices,
    camera=lambda phase, depth: depth.camera,
    judge=_judge,
    about="From the plate at known depths alone. Measures between the plate positions only.",
    options=("degree", "low_pass_px", "camera", "projector"),
    reads=("photogrammetric",),
    least=2,  # a single position tells no depth
    reused=True,
    one_pair=True,
    outside="outside the calibrated depths or field",
)
