"""Picks: guessed before stage 3, and what an operator's give at once, put among the targets the project keeps."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from numpy.typing import NDArray

from core.errors import InputError
from core.model import Array, Capture, DeviceSpec, PhaseMap, Project, Seed, TargetSet
from core.patterns import level_of
from core.pipeline.decode import one_series, phase_maps
from core.pipeline.folders import captures_of
from core.pipeline.measure import (
    BOARDS,
    Side,
    boards_of,
    kept_targets,
    measured_capture,
    save_targets,
    sides_of,
    signs_of,
)
from core.progress import SILENT, Progress
from core.project import keep_picks, read_image

Guesses = tuple[tuple[Seed, ...], ...]


def lit_frame_of(capture: Capture) -> int:
    """Give the number of the frame in which the board is lit evenly: the white one, else the first."""
    white = (i for i, frame in enumerate(capture.frames) if level_of(frame.pattern) == 1)
    return next(white, 0)


def look_for_picks(
    image: NDArray, capture: Capture, camera: DeviceSpec, known: tuple[Seed, ...] = (), side: Side = "front"
) -> tuple[Array, Guesses]:
    """Find the targets of a board in its evenly lit image, (n, 2) px, and guess the picks, the likeliest first.

    The capture must name its testfield; `known` are picks of a neighbouring image. No guesses where the targets seen do
    not fit the testfield.
    """
    from core.measure import kind_of

    assert capture.testfield is not None
    return kind_of(capture.testfield).guess(image, capture.testfield, camera, known, side)


def guess_picks(
    project: Project, names: Collection[str] | None = None, progress: Progress = SILENT
) -> dict[str, Guesses]:
    """Guess the picks of boards, by default of all that have none, by the captures' names.

    A regular board looks the same after half a turn: the first guess is the one nearest to the picks of the images
    before, which an operator should look at all the same.
    """
    boards = [c for role in BOARDS for c in captures_of(project, role) if c.testfield is not None]
    if not boards:
        raise InputError(project.path, "no capture names a testfield", "capture a board with targets")
    wanted = [c for c in boards if (not c.seeds if names is None else c.name in names)]
    if missing := sorted(set(names or ()) - {c.name for c in wanted}):
        known = ", ".join(c.name for c in boards) or "none"
        raise InputError(project.path, f"no board was captured as {', '.join(missing)}", f"boards: {known}")
    sides = sides_of(boards)
    found: dict[str, Guesses] = {}
    near: tuple[Seed, ...] = next((c.seeds for c in boards if c.seeds), ())
    for capture in progress.over(wanted, "looking at {0.name}"):
        image = read_image(capture.frames[lit_frame_of(capture)].path)
        _, found[capture.name] = look_for_picks(image, capture, project.camera, near, sides[capture.role])
        if found[capture.name]:
            near = found[capture.name][0]
    return found


def accept_guesses(project: Project, guesses: dict[str, Guesses], number: int = 1) -> list[str]:
    """Keep one guess of every capture as its picks, the first by default; give the captures that have so many."""
    folders = {c.name: c for role in BOARDS for c in captures_of(project, role)}
    kept = [name for name, found in guesses.items() if len(found) >= number]
    for name in kept:
        keep_picks(folders[name].path, guesses[name][number - 1], folders[name].excluded)
    return kept


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


def current_target_sets(project: Project, captures: Sequence[Capture] | None = None) -> list[TargetSet]:
    """Give the kept targets that follow from what is there now, of every camera with every projector.

    `captures` are all of the project, where they have been read.
    """
    if not (kept := kept_targets(project)):
        return []
    boards = boards_of(project, captures)
    current = set(signs_of(project, boards, sides_of(boards)).values())
    return [t for t in kept if t.made_from in current]
