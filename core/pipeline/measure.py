"""Stage 3: the targets of all captures that have picks."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from core.errors import InputError
from core.figures import targets_figures
from core.model import Capture, PhaseMap, Project, Role, TargetSet
from core.pipeline.decode import phase_maps
from core.pipeline.folders import captures_of, result_path
from core.pipeline.inputs import measured_from
from core.progress import SILENT, Progress
from core.project import load_archive, save_archive, write_json
from core.project.contents import contents_of
from core.project.lock import writing_results

Side = Literal["front", "back"]
BOARDS: tuple[Role, ...] = ("testfield", "depth")


def measure_project(project: Project, progress: Progress = SILENT) -> tuple[TargetSet, ...]:
    """Measure the targets of all captures that have picks, and keep them in the project.

    What was measured before from the same frames, picks, board and rig is taken as it is.
    """
    captures = picked_boards(project)
    if not captures:
        raise InputError(project.path, "no capture has picks.json", "pick 4 targets in each testfield capture")
    with writing_results(project.path, "measure"):
        targets = measured_targets(project, captures, progress)
        save_targets(project, targets)
    return tuple(targets)


def picked_boards(project: Project) -> list[Capture]:
    """Give all captures of boards that have picks."""
    return [c for role in BOARDS for c in captures_of(project, role) if c.seeds]


def measured_targets(project: Project, captures: Sequence[Capture], progress: Progress = SILENT) -> list[TargetSet]:
    """Measure the targets of captures, or take what was measured before where nothing has changed since."""
    sides = sides_of(captures)
    signs = signs_of(project, captures, sides)
    found = {t.made_from: t for t in kept_targets(project)}
    due = [c for c in captures if signs[c.path] not in found]
    for capture, phase in phase_maps(project, due, progress):
        sign = signs[capture.path]
        targets = measure_capture(capture, phase, project, sides[capture.role], progress.quiet())
        found[sign] = replace(targets, made_from=sign)
    return [found[signs[c.path]] for c in captures]


def signs_of(project: Project, captures: Sequence[Capture], sides: Mapping[Role, Side]) -> dict[Path, str]:
    """Record what the targets of captures follow from, as one text each, by the captures' folders."""
    contents = contents_of(project.path)
    contents.learn(frame.path for c in captures for frame in c.frames)
    signs = {
        c.path: json.dumps(measured_from(project, c, sides[c.role], contents), separators=(",", ":")) for c in captures
    }
    contents.keep()
    return signs


def kept_targets(project: Project) -> tuple[TargetSet, ...]:
    """Give the targets that the project keeps; none where the file is missing or damaged."""
    try:
        path = result_path(project, "targets.npz")
        kept: tuple[TargetSet, ...] = load_archive(path, tuple, TargetSet) if path.exists() else ()
    except InputError as error:
        logging.getLogger(__name__).warning("%s: %s; measured anew", error.where, error.seen)
        return ()
    return kept


def save_targets(project: Project, targets: Sequence[TargetSet]) -> None:
    """Keep measured targets in the project, for the program and as JSON."""
    save_archive(result_path(project, "targets.npz"), tuple(targets))
    write_json(result_path(project, "targets.json"), targets_figures(targets))


def sides_of(captures: Sequence[Capture]) -> dict[Role, Side]:
    """Give the side from which the boards of each role are seen, see `side_of`."""
    return {role: side_of([c for c in captures if c.role == role]) for role in BOARDS}


def side_of(captures: list[Capture]) -> Side:
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


def measure_capture(
    capture: Capture, phase: PhaseMap, project: Project, side: Side, progress: Progress = SILENT
) -> TargetSet:
    """Measure the targets of one decoded capture."""
    from core.measure import MeasureOptions, measure_targets

    if capture.testfield is None:
        raise InputError(capture.path / "capture.json", "picks, but no testfield", 'name the board in "testfield"')
    targets = measure_targets(
        phase,
        capture.testfield,
        capture.seeds,
        project.camera,
        projector=project.projector,
        capture=str(capture.path),
        excluded=capture.excluded,
        progress=progress,
        options=MeasureOptions(side=side),
    )
    return replace(targets, capture=capture.name, notes=phase.notes)
