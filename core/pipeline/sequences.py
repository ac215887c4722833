"""Before and beside stage 1: a sequence as images to be shown, and frames that came from elsewhere."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from core.atomic import undone_on_failure
from core.errors import InputError, choose_among
from core.lazy import dataclass
from core.model import DeviceSpec, Frame, PhaseMap, Project, Subject
from core.patterns import Pattern, SequenceSpec, default_sequence, pattern_image
from core.progress import SILENT, Progress
from core.project import read_project, write_image
from core.project.captures import write_capture_json
from core.project.images import Image
from core.project.made import foreign

if TYPE_CHECKING:
    from core.capture.importing import ImportReport

IMAGES = re.compile(r"\d{3,}\.png|capture\.json")


@dataclass(frozen=True)
class WrittenPatterns:
    """The images of a sequence: where they are, how many, and of which."""

    folder: Path
    patterns: tuple[Pattern, ...]
    sequence: str
    linearised: bool


def write_patterns(
    folder: Path,
    out: Path,
    sequence: SequenceSpec | None = None,
    *,
    linearise: bool = False,
    projector: str = "",
    progress: Progress = SILENT,
) -> WrittenPatterns:
    """Write a project's sequence as numbered PNG of the projector's size, and the capture.json that lists them.

    The projector is the one of that name, the first of several if none is named.

    Without a sequence it is the project's own, else that of its latest capture, else fringes of grey. `linearise`
    writes the levels that make the projector's light what the patterns mean, by its `response` in project.json. `out`
    is new, empty, or holds such images only, as they were written, which are replaced: anything else, or a response
    that is missing or does not rise, is an InputError.
    """
    project = read_project(folder)
    spec = sequence or shown_sequence(project)
    shown_by, where = projector or project.rig.projector_name, project.path / "project.json"
    if shown_by not in project.rig.projectors:
        raise InputError(where, f"has no projector {shown_by!r}", choose_among(shown_by, [*project.rig.projectors]))
    device = project.rig.projectors[shown_by]
    size = device.width, device.height
    patterns = spec.patterns(size)
    levels = _inverse(where, device) if linearise else None
    for path in _stale(Path(out)):
        path.unlink()
    digits = max(3, len(str(len(patterns) - 1)))
    with undone_on_failure(Path(out)):
        entries = []
        for k in progress.over(range(len(patterns)), "pattern {}"):
            name = f"{k:0{digits}d}.png"
            light = pattern_image(patterns[k], *size)
            light = light if levels is None else np.interp(light, *levels)
            write_image(Path(out) / name, np.rint(255 * light).astype(np.uint8), False)
            entries.append((name, patterns[k]))
        write_capture_json(Path(out), Subject("object"), entries)
    return WrittenPatterns(Path(out), patterns, spec.words, linearise)


def shown_sequence(project: Project) -> SequenceSpec:
    """Give the sequence of a project: its own, else of its latest capture, else fringes of grey."""
    from core.capture.importing import sequence_of

    try:
        return sequence_of(project)
    except InputError:
        return default_sequence(grey=True)


def _inverse(where: Path, projector: DeviceSpec) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give light, rising, and the level that makes it."""
    response = np.array(projector.response, np.float64).reshape(-1, 2)
    if len(response) < 2:
        raise InputError(where, "gives no response of the projector", "measure it, or leave --linearise out")
    response = response[np.argsort(response[:, 0], kind="stable")]
    level, light = response.T
    light = (light - light[0]) / (light[-1] - light[0]) if light[-1] != light[0] else light
    if (np.diff(light) <= 0).any() or (np.diff(level) <= 0).any():
        raise InputError(where, "the projector's response does not rise", "correct it: more level, more light")
    return light, (level - level[0]) / (level[-1] - level[0])


def _stale(out: Path) -> Sequence[Path]:
    """Give the images of an earlier call; refuse a folder that holds anything else, as the frames of a capture."""
    if not out.exists():
        return []
    if not out.is_dir():
        raise InputError(out, "is a file", "choose a new or empty folder")
    unlike = sorted(p.name for p in out.iterdir() if not (IMAGES.fullmatch(p.name) or p.name.startswith(".")))
    if others := unlike or foreign(out):  # `unlike` may be the program's own, as a simulated project's
        raise InputError(out, f"holds {others[0]}, not as `patterns` wrote it", "choose a new or empty folder")
    return [p for p in out.iterdir() if IMAGES.fullmatch(p.name)]


def import_into(
    folder: Path,
    frames: Path,
    subject: Subject,
    *,
    sequence: SequenceSpec | None = None,
    order: str | None = None,
    progress: Progress = SILENT,
) -> ImportReport:
    """Make a capture of a project from frames that came from elsewhere, as `core.capture.importing.import_frames`."""
    from core.capture.importing import import_frames

    def decoded(shown: Sequence[Frame], images: Sequence[Image], lines: tuple[int, int]) -> PhaseMap:
        from core.decode import decode

        patterns, exposures = [frame.pattern for frame in shown], [frame.exposure_ms for frame in shown]
        return decode(patterns, images, lines=lines, exposures_ms=exposures, where=str(frames))

    return import_frames(
        read_project(folder), frames, subject, sequence=sequence, order=order, decoded=decoded, progress=progress
    )
