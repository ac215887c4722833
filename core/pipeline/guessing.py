"""Before stage 3: a guess of the picks of images that nobody has picked yet."""

from __future__ import annotations

from collections.abc import Collection

from numpy.typing import NDArray

from core.errors import InputError
from core.model import Array, Capture, DeviceSpec, Project, Seed
from core.patterns import level_of
from core.pipeline.folders import captures_of
from core.pipeline.measure import BOARDS, Side, sides_of
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
    return kind_of(capture.testfield, str(capture.path)).guess(image, capture.testfield, camera, known, side)


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
