"""Stage 3, one capture at a time: what an operator's picks give at once, put among the targets the project keeps."""

from __future__ import annotations

from dataclasses import replace

from core.errors import InputError
from core.model import Capture, PhaseMap, Project, TargetSet
from core.pipeline.decode import phase_maps
from core.pipeline.folders import captures_of
from core.pipeline.freshness import made_from
from core.pipeline.measure import BOARDS, kept_targets, measure_capture, save_targets, side_of
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
    signs = _signs(project)
    capture = next((c for c, _ in signs.values() if c.name == name), None)
    if capture is None:
        raise InputError(project.path / "captures" / name, "no picks", "pick 4 targets first")
    side = side_of([c for c, _ in signs.values() if c.role == capture.role])
    if phase is None:
        progress(0.0, f"decoding {name}")
        ((_, phase),) = phase_maps(project, [capture])
    progress(0.6, f"measuring {name}")
    sign = signs[capture.name][1]
    targets = replace(measure_capture(capture, phase, project, side), made_from=sign)
    progress.check()
    found = {t.made_from: t for t in kept_targets(project)} | {sign: targets}
    save_targets(project, [found[s] for _, s in signs.values() if s in found])
    return targets


def current_targets(project: Project) -> dict[str, TargetSet]:
    """Give the kept targets that follow from the frames, picks, boards and rig as they are now, by capture."""
    current = {sign for _, sign in _signs(project).values()}
    return {t.capture: t for t in kept_targets(project) if t.made_from in current}


def _signs(project: Project) -> dict[str, tuple[Capture, str]]:
    """All captures that have picks, and the sign of what their targets follow from."""
    signs = {}
    for role in BOARDS:
        captures = [c for c in captures_of(project, role) if c.seeds]
        side = side_of(captures)
        signs.update({c.name: (c, made_from(project, c, side)) for c in captures})
    return signs
