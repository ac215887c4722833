"""Stage 3, one capture at a time: what an operator's picks give at once, put among the targets the project keeps."""

from __future__ import annotations

from dataclasses import replace

from core.errors import InputError
from core.model import PhaseMap, Project, TargetSet
from core.pipeline.decode import phase_maps
from core.pipeline.measure import boards_of, kept_targets, measure_capture, save_targets, sides_of, signs_of
from core.progress import SILENT, Progress


def measure_one(project: Project, name: str, phase: PhaseMap | None = None, progress: Progress = SILENT) -> TargetSet:
    """Measure the targets of one capture and keep them; kept targets of other captures stay while they are current.

    Parameters
    ----------
    project : Project
    name : str
        The capture, which must have picks.
    phase : PhaseMap, optional
        The capture decoded already.
    progress : Progress

    Raises
    ------
    InputError
        No capture of that name with picks, or picks that cannot be used; nothing is changed then.
    """
    boards = boards_of(project)
    capture = next((c for c in boards if c.name == name and c.seeds), None)
    if capture is None:
        raise InputError(project.path / "captures" / name, "no picks", "pick 4 targets first")
    sides = sides_of(boards)
    signs = signs_of(project, boards, sides)
    if phase is None:
        progress(0.0, f"decoding {name}")
        ((_, phase),) = phase_maps(project, [capture])
    progress(0.6, f"measuring {name}")
    sign = signs[capture.path]
    targets = replace(measure_capture(capture, phase, project, sides[capture.role]), made_from=sign)
    progress.check()
    found = {t.made_from: t for t in kept_targets(project)} | {sign: targets}
    save_targets(project, [found[s] for s in signs.values() if s in found])
    return targets


def current_targets(project: Project) -> dict[str, TargetSet]:
    """Give the kept targets that follow from the frames, picks, boards and rig as they are now, by capture."""
    boards = boards_of(project)
    current = set(signs_of(project, boards, sides_of(boards)).values())
    return {t.capture: t for t in kept_targets(project) if t.made_from in current}
