"""Stage 6: plane captures by calibrations, all of either unless some are chosen."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from core.errors import InputError, NoCoordinateError, StripeError, TooFewPointsError
from core.figures import evaluation_figures
from core.geometry import knows
from core.model import (
    Calibration,
    Capture,
    Method,
    PhaseMap,
    PhotogrammetricCalibration,
    PlaneEvaluation,
    PointCloud,
    Project,
)
from core.parallel import beside
from core.patterns import axis_of
from core.pipeline.calibrate import load_calibrations
from core.pipeline.decode import from_phase_maps
from core.pipeline.evidence import because_of, shared_frames
from core.pipeline.folders import captures_of, result_path
from core.pipeline.judge import bend_rms, judge_planes, said_of
from core.pipeline.methods import METHODS
from core.pipeline.runs import calibration_hashes
from core.pipeline.state.inputs import evaluated_from
from core.pipeline.views import intersectable, joint_clouds
from core.progress import SILENT, Progress
from core.project import load_archive, save_archive, write_json
from core.project.contents import contents_of
from core.project.images import Image, read_image
from core.project.lock import read_only, writing_results

if TYPE_CHECKING:
    from core.checks.planes import Form

TOGETHER = "all devices"  # in place of the projector, where all that saw a point made it
CAMERAS = "all cameras"  # where no projector is calibrated
MODULES = ("core.evaluate.planes", "core.orient.motion", "core.reconstruct.points", "numpy.random")
COMPARED = 3  # frames of planes that stand at one place

# with it the form of the deviations, how far the calibration alone may bend it, mm r.m.s., and what is said of it
Row = tuple[PlaneEvaluation, "Form", float, Sequence[str]]


def evaluate_project(
    project: Project,
    progress: Progress = SILENT,
    *,
    captures: Collection[str] | None = None,
    methods: Collection[Method] | None = None,
) -> tuple[PlaneEvaluation, ...]:
    """Judge plane captures by calibrations, all of either unless some are named; keep the deviations in the project.

    A plane that several cameras or projectors saw is judged by each pair, and by the points of all together in every
    camera's raster. A project that may only be read is judged all the same, and keeps nothing.

    Raises
    ------
    InputError
        If there is no such plane capture or calibration; nothing has been written then.
    """
    if read_only(project.path):
        return _evaluate(project, captures, methods, progress, keep=False)
    with writing_results(project.path, "evaluate"):
        return _evaluate(project, captures, methods, progress, keep=True)


def _evaluate(
    project: Project,
    captures: Collection[str] | None,
    methods: Collection[Method] | None,
    progress: Progress,
    *,
    keep: bool,
) -> tuple[PlaneEvaluation, ...]:
    calibrations = {m: c for m, c in load_calibrations(project).items() if methods is None or m in methods}
    planes = [c for c in captures_of(project, "plane") if captures is None or c.name in captures]
    missing = sorted({*(captures or ()), *(methods or ())} - {c.name for c in planes} - {*calibrations})
    if missing or not calibrations:
        names = ", ".join(missing) or "none at all"
        raise InputError(project.path, f"chosen to evaluate: {names}", "choose plane captures and calibrations it has")
    if not planes:
        raise InputError(
            project.path, "no capture of role plane", "capture the plane-table and list it in project.json"
        )
    contents = contents_of(project.path)
    contents.learn(frame.place for plane in planes for frame in plane.frames)
    choice = (None if captures is None else sorted(captures), None if methods is None else sorted(methods))
    # of what is there before it is read: what is changed meanwhile is seen to have changed
    record = evaluated_from(project, planes, calibration_hashes(project, calibrations), choice, contents)
    result = _judge(project, planes, calibrations, progress)
    if keep:
        save_archive(result_path(project, "evaluation.npz"), result, record)
        write_json(result_path(project, "evaluation.json"), evaluation_figures(result))
    contents.keep()
    return result


def _judge(
    project: Project, planes: Sequence[Capture], calibrations: Mapping[Method, Calibration], progress: Progress
) -> tuple[PlaneEvaluation, ...]:
    from core.checks import end_notes, light_end, repeated_planes

    of_whole = {capture.name: capture for capture in planes}
    shared = beside(lambda: shared_frames(project, planes))

    def by_pair(capture: Capture, phase: PhaseMap) -> tuple[PhaseMap | None, tuple[str, str], Any, Any]:
        rows = _of_pair(project, capture, phase, calibrations, progress, len(of_whole[capture.name].pairs) == 1)
        kept = phase if len(of_whole[capture.name].pairs) > 1 else None
        return kept, (phase.camera, phase.projector), (light_end(phase.u), light_end(phase.v)), rows

    found: list[Row] = []
    lacking: list[StripeError] = []
    ends: dict[tuple[str, str], dict[str, Any]] = {}
    seen: dict[str, list[PhaseMap]] = {}
    for capture, (phase, pair, end, (rows, not_by)) in from_phase_maps(project, planes, by_pair, progress, MODULES):
        found += rows
        lacking += not_by.values()
        for by, error in not_by.items():
            logging.getLogger(__name__).warning("%s: %s; not judged by %s", error.where, error.seen, by)
        ends.setdefault(pair, {})[capture.name] = end
        if phase is not None:
            seen.setdefault(capture.name, []).append(phase)
        if len(together := seen.get(capture.name, ())) == len(of_whole[capture.name].pairs):
            for name, calibration in calibrations.items():
                if not isinstance(calibration, PhotogrammetricCalibration):
                    continue
                if len(intersectable(together, calibration)) > 1:
                    clouds = joint_clouds(together, calibration, progress=progress.quiet())
                    by = TOGETHER if calibration.projectors else CAMERAS
                    said = said_of(capture, together, calibration, "cameras")  # each pair by itself has told
                    for camera, cloud in clouds.items():
                        whole = united([p for p in together if p.camera == camera])
                        found.append(_judged(capture, whole, name, calibration, cloud, said, by))
            del seen[capture.name]
    if not found and lacking:
        raise lacking[0]
    if not found:
        devices = {n for c in calibrations.values() for n in getattr(c, "devices", ())}
        raise InputError(project.path, f"no plane by the calibrated {', '.join(sorted(devices))}", "capture one")
    progress.check()
    by_name = {capture.name: capture for capture in planes}
    repeated = repeated_planes([row for row, *_ in found], lambda a, b: _same_stripes(by_name[a], by_name[b]))
    notes: dict[str, Sequence[str]] = {**shared()}
    for (_, projector), of_pair in ends.items():
        for name, text in end_notes(of_pair, project.rig.projectors[projector], projector).items():
            notes[name] = (*notes[name], text)
    return _told(found, calibrations, notes, repeated)


def _same_stripes(a: Capture, b: Capture) -> Iterator[tuple[Image, Image]]:
    """Give images of two captures by the same devices under the same pattern, of some that vary over the field."""
    shown = {(f.pattern, f.camera, f.projector, f.exposure_ms): f for f in a.frames if axis_of(f.pattern) is not None}
    both = [(shown[key], f) for f in b.frames if (key := (f.pattern, f.camera, f.projector, f.exposure_ms)) in shown]
    for f, g in both[-COMPARED:]:
        yield read_image(f.path), read_image(g.path)


def united(phases: Sequence[PhaseMap]) -> PhaseMap:
    """Tell what a camera decoded of any projector: each pixel has the coordinates that one of them gave it."""
    u, v = (np.fmax.reduce([getattr(p, axis) for p in phases]) for axis in "uv")
    return replace(phases[0], u=u, v=v)


def judge_plane(
    project: Project, capture: Capture, phase: PhaseMap, calibrations: Mapping[Method, Calibration]
) -> tuple[PlaneEvaluation, ...]:
    """Judge a plane that one pair of devices saw, by itself; nothing of it is kept."""
    rows, lacking = _of_pair(project, capture, phase, calibrations, SILENT)
    if not rows and lacking:
        raise next(iter(lacking.values()))
    return _told(rows, calibrations, {})


def _of_pair(
    project: Project,
    capture: Capture,
    phase: PhaseMap,
    calibrations: Mapping[Method, Calibration],
    progress: Progress,
    alone: bool = True,
) -> tuple[list[Row], dict[str, StripeError]]:
    """Evaluate a plane by every calibration of a pair of devices, which took it alone or beside others.

    Also what it cannot be judged by, and why: a method that uses one coordinate where the pair has the other, or whose
    depths end before.
    """
    rows: list[Row] = []
    lacking: dict[str, StripeError] = {}
    for name, calibration in calibrations.items():
        if covers(name, calibration, phase, project):
            by = name if alone else f"{phase.camera} and {phase.projector}"
            try:
                rows.append(_by_itself(capture, phase, name, calibration, progress))
            except TooFewPointsError as lack:
                lacking[by] = lack
            except NoCoordinateError as lack:
                remedy = f"{lack.remedy}, or take it out of project.json"
                lacking[by] = NoCoordinateError(capture.path, lack.seen, remedy)
    dark = [lack for lack in lacking.values() if isinstance(lack, NoCoordinateError)]
    if alone and not rows and dark:  # the capture shows nothing, or the wrong patterns
        with because_of({capture.name: (*capture.notes, *phase.notes)}):
            raise dark[0]
    return rows, lacking


def _told(
    found: Sequence[Row],
    calibrations: Mapping[Method, Calibration],
    more: Mapping[str, Sequence[str]],
    repeated: Mapping[str, str] | None = None,
) -> tuple[PlaneEvaluation, ...]:
    """Put verdicts on planes, with `more` notes by capture."""
    said: dict[tuple[str, ...], list[str]] = {}  # by capture, and by its devices
    for row, *_, own in found:
        for key in ((row.capture,), (row.capture, *row.devices)):
            said.setdefault(key, []).extend(own)
    seen = {}
    for row, form, rms, _ in found:
        whole = row.devices[1] == TOGETHER  # what any pair says is said of all devices together, too
        texts = said[(row.capture,) if whole else (row.capture, *row.devices)]
        seen[row.capture, row.method, *row.devices] = form, rms, (*more.get(row.capture, ()), *texts)
    order = list(METHODS)
    verdicts = {m: c.verdict for m, c in calibrations.items()}
    result = sorted((row for row, *_ in found), key=lambda e: order.index(e.method))
    return judge_planes(result, seen, verdicts, repeated)


def covers(method: Method, calibration: Calibration, phase: PhaseMap, project: Project) -> bool:
    """Whether a calibration is of the devices of a phase map."""
    pair = phase.camera, phase.projector
    if isinstance(calibration, PhotogrammetricCalibration) and not knows(calibration, *pair):
        return False
    return METHODS[method].is_of(project, calibration, *pair)


def _by_itself(capture: Capture, phase: PhaseMap, name: Method, calibration: Calibration, progress: Progress) -> Row:
    """Judge a plane by one pair of devices."""
    progress.check()
    cloud = METHODS[name].reconstruct(phase, calibration, False, progress.quiet())
    return _judged(capture, phase, name, calibration, cloud, said_of(capture, [phase], calibration), phase.projector)


def _judged(
    capture: Capture,
    phase: PhaseMap,
    name: Method,
    calibration: Calibration,
    cloud: PointCloud,
    said: Sequence[str],
    by: str,
) -> Row:
    from core.checks import form_of, is_noise
    from core.evaluate import evaluate_plane

    method = METHODS[name]
    with because_of({capture.name: said}):
        row = evaluate_plane(
            phase,
            cloud,
            capture=capture.name,
            angle_deg=capture.angle_deg,
            method=name,
            camera=method.camera(phase, calibration),
            outside=method.outside if by != CAMERAS else "no place that is surely its own in another camera",
        )
    form = form_of(row.deviation_mm)
    told = replace(row, devices=(phase.camera, by), form_pv_um=form.pv_um, noisy=is_noise(row, form))
    # what noise explains needs no excuse by the calibration
    return told, form, 0.0 if told.noisy else bend_rms(told, cloud, calibration), said


def load_evaluation(project: Project) -> tuple[PlaneEvaluation, ...]:
    """Read the evaluation that the project has."""
    return load_archive(result_path(project, "evaluation.npz"), tuple, PlaneEvaluation)
