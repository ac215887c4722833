"""Stage 3, one capture at a time: what an operator's picks give at once, put among the targets the project keeps."""

from __future__ import annotations

from dataclasses import replace

from core.errors import InputError
from core.model import PhaseMap, Project, TargetSet
from core.pipeline.decode import one_series, phase_maps
from core.pipeline.measure import boards_of, kept_targets, measured_capture, save_targets, sides_of, signs_of
from core.progress import SILENT, Progress


def measure_one(
    project: Project,
    name: str,
    phase: PhaseMap | None = None,
    progress: Progress = SILENT,
    *,
    camera: str = "",
    projector: str = "",
) -> TargetSet:
    """Measure the targets of one capture and keep them; kept targets of other captures stay while they are current.

    `phase` is the capture decoded already; without devices all of its pairs that have picks are measured. InputError
    for no capture of that name with picks, or picks that cannot be used; nothing is changed then.
    """
    boards = boards_of(project)
    capture = next((c for c in boards if c.name == name and c.seeds), None)
    if capture is None:
        raise InputError(project.path / "captures" / name, "no picks", "pick 4 targets first")
    sides = sides_of(boards)
    signs = signs_of(project, boards, sides)
    series = [one for one in capture.series if one.seeds]
    if camera or projector:
        series = [one for one in (one_series(capture, camera, projector),) if one.seeds]
    if not series:
        raise InputError(capture.path, f"no picks in the image of {camera}", "pick 4 targets there first")
    if phase is not None:
        decoded = [(one, phase) for one in series if (one.camera, one.projector) == (phase.camera, phase.projector)]
    else:
        progress(0.0, f"decoding {name}")
        decoded = list(phase_maps(project, series))
    progress(0.6, f"measuring {name}")
    sign, side = signs[capture.path], sides[capture.role]
    measured = [replace(measured_capture(one, phase, project, side)[0], made_from=sign) for one, phase in decoded]
    progress.check()
    anew = {(t.capture, t.camera, t.projector) for t in measured}
    kept = [t for t in current_target_sets(project) if (t.capture, t.camera, t.projector) not in anew]
    order = {board.name: k for k, board in enumerate(boards)}
    save_targets(project, sorted([*measured, *kept], key=lambda t: order[t.capture]))
    return measured[0]


def current_target_sets(project: Project) -> list[TargetSet]:
    """Give the kept targets that follow from what is there now, of every camera with every projector."""
    if not (kept := kept_targets(project)):
        return []
    boards = boards_of(project)
    current = set(signs_of(project, boards, sides_of(boards)).values())
    return [t for t in kept if t.made_from in current]
