"""Stage 6: every plane capture by every calibration."""

from __future__ import annotations

from core.errors import InputError
from core.figures import evaluation_figures
from core.model import PlaneEvaluation, Project
from core.pipeline.calibrate import METHODS, load_calibrations
from core.pipeline.decode import phase_maps
from core.pipeline.folders import captures_of, result_path
from core.progress import SILENT, Progress
from core.project import load_archive, save_archive, write_json


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
