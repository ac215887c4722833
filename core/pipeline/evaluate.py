"""Stage 6: plane captures by calibrations, all of either unless some are chosen."""

from __future__ import annotations

from collections.abc import Collection

from core.errors import InputError
from core.figures import evaluation_figures
from core.model import AdjustedDevice, Method, PlaneEvaluation, Project
from core.pipeline.calibrate import load_calibrations
from core.pipeline.decode import phase_maps
from core.pipeline.folders import captures_of, result_path
from core.pipeline.judge import calibration_rms, judge_planes
from core.pipeline.options import METHODS
from core.progress import SILENT, Progress
from core.project import load_archive, save_archive, write_json


def evaluate_project(
    project: Project,
    progress: Progress = SILENT,
    *,
    captures: Collection[str] | None = None,
    methods: Collection[Method] | None = None,
) -> tuple[PlaneEvaluation, ...]:
    """Judge plane captures by calibrations, all of either unless some are named; keep the deviations in the project.

    Raises
    ------
    InputError
        If there is no such plane capture or calibration; nothing has been written then.
    """
    from core.evaluate import evaluate_plane
    from core.reconstruct import reconstruct

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
    evaluations = []
    calibrated: dict[tuple[str, Method], float] = {}
    for capture, phase in phase_maps(project, planes, progress):
        for method, calibration in calibrations.items():
            progress.check()
            camera = calibration.camera
            if isinstance(camera, AdjustedDevice):
                camera = camera.interior
            cloud = reconstruct(phase, calibration)
            calibrated[capture.name, method] = calibration_rms(cloud)
            evaluations.append(
                evaluate_plane(
                    phase, cloud, capture=capture.name, angle_deg=capture.angle_deg, method=method, camera=camera
                )
            )
    progress.check()
    result = judge_planes(sorted(evaluations, key=lambda e: METHODS.index(e.method)), calibrated)
    save_archive(result_path(project, "evaluation.npz"), result)
    write_json(result_path(project, "evaluation.json"), evaluation_figures(result))
    return result


def load_evaluation(project: Project) -> tuple[PlaneEvaluation, ...]:
    """Read the evaluation that the project has."""
    return load_archive(result_path(project, "evaluation.npz"), tuple)
