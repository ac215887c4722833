"""Stage 2: projector coordinates of the pixels of one capture, or of many in a stream."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import closing, contextmanager
from dataclasses import fields, replace
from functools import partial
from importlib import import_module
from itertools import starmap, zip_longest
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from core.errors import InputError
from core.lazy import dataclass
from core.model import Capture, Note, PhaseMap, Project, named_by
from core.model.finding import Finding
from core.parallel import can_fork, on_processes
from core.pipeline.evidence import shared_frames
from core.pipeline.folders import own_folder
from core.progress import SILENT, Progress
from core.project import atomic_write, find_project, iterate_images, read_capture, read_project

T = TypeVar("T")
MANY = 4  # captures that are worth processes, each of which works out for itself what all captures share


def decode_capture(
    folder: Path, progress: Progress = SILENT, *, camera: str = "", projector: str = "", estimate: bool = False
) -> PhaseMap:
    """Decode the frames of one capture, in a project or on its own.

    Parameters
    ----------
    camera, projector : str
        Whose frames, where the capture holds those of several.
    estimate : bool
        Refine the coordinates by all frames.

    Raises
    ------
    InputError
        If it holds frames of several and none is named, or of none of that name.
    """
    root = find_project(folder)
    project = read_project(root) if root else None
    capture = one_series(read_capture(own_folder(project, folder) if project else folder, project), camera, projector)
    phase = decode_series(capture, project, progress, estimate)
    return replace(phase, notes=(*shared_frames(project, [capture])[capture.name], *phase.notes)) if project else phase


def one_series(capture: Capture, camera: str = "", projector: str = "") -> Capture:
    """Choose the frames of one camera and one projector of a capture."""
    named = (("camera", camera), ("projector", projector))
    found = [s for s in capture.series if all(not name or getattr(s, kind) == name for kind, name in named)]
    if len(found) == 1:
        return found[0]
    pairs = ", ".join(f"{s.camera} with {s.projector}" for s in capture.series)
    wanted = " with ".join(name for _, name in named if name)
    seen = f"holds no frames of {wanted}" if not found else f"holds frames of several devices: {pairs}"
    raise InputError(capture.path, seen, f"choose one: {pairs}" if not found else "name the camera, or the projector")


def decode_series(capture: Capture, project: Project | None, progress: Progress, estimate: bool = False) -> PhaseMap:
    """Read and decode the frames of one camera and one projector."""
    images = []
    for image in iterate_images(capture, project.rig.cameras[capture.camera] if project else None):
        progress.check()  # a large capture takes seconds to read
        images.append(image)
    return decode_images(capture, images, project, progress, estimate)


def decode_images(
    capture: Capture, images: list, project: Project | None, progress: Progress, estimate: bool = False
) -> PhaseMap:
    """Decode frames that have been read already; `estimate`, or the project's, refines coordinates by all of them."""
    from core.decode import DecodeOptions, decode

    spec = project.rig.projectors[capture.projector] if project else None
    lines = (spec.width, spec.height) if spec else None
    patterns = [frame.pattern for frame in capture.frames]
    exposures = [frame.exposure_ms for frame in capture.frames]
    where = str(capture.path)
    if project and not project.rig.is_pair:
        where += f", {capture.camera} with {capture.projector}"
    options = DecodeOptions(estimate=estimate or (project is not None and project.estimate))
    try:
        phase = decode(
            patterns, images, lines=lines, options=options, exposures_ms=exposures, where=where, progress=progress
        )
    except InputError as error:
        raise (of_another_projector(error, capture, project) if project else None) or error from None
    phase = replace(phase, camera=capture.camera, projector=capture.projector)
    if lines is None or not images:
        return phase
    from core.verify.pixels import gaps_among
    from core.verify.stored import check_stored

    progress.check()
    findings = check_stored(capture, images, phase, lines)
    return replace(phase, notes=all_notes(findings, phase.notes), gaps=gaps_among(images))


def all_notes(findings: Sequence[Finding], notes: Sequence[str]) -> tuple[str, ...]:
    """Put what is found of frames before the notes on decoding; a frame that stands elsewhere is not late."""
    told = [Note(finding.text, finding.names) for finding in findings]
    elsewhere = tuple(f"Frame {shot} shows the pattern" for finding in findings for shot in finding.shots)
    return (*told, *(note for note in notes if not note.startswith(elsewhere)))


def of_another_projector(error: InputError, capture: Capture, project: Project) -> InputError | None:
    """Say of patterns that one projector is refused for which of the others has the lines that they fit, if any."""
    from core.decode import refuse_patterns

    patterns, rig, fitting = [frame.pattern for frame in capture.frames], project.rig.projectors, []
    for name in (capture.projector, *(other for other in rig if other != capture.projector)):
        try:
            refuse_patterns(patterns, (rig[name].width, rig[name].height))
            fitting.append(name)
        except InputError:
            continue
    if not fitting or capture.projector in fitting:
        return None
    seen = " and ".join(f"{rig[name].width} x {rig[name].height} lines of {name}" for name in fitting)
    told = f"{error.seen}; the frames fit the {seen}: is the projector named wrongly?"
    return InputError(error.where, told, error.remedy)


def phase_maps(
    project: Project, captures: Iterable[Capture], progress: Progress = SILENT
) -> Iterator[tuple[Capture, PhaseMap]]:
    """Decode captures one after the other; the next is read and decoded while this one is used, so memory stays flat.

    A capture by several cameras or projectors comes once for each pair, with that pair's frames and picks.
    """
    waiting = [series for capture in captures for series in capture.series]
    pool, told = ThreadPoolExecutor(1), progress.quiet()
    try:
        ahead = [pool.submit(decode_series, capture, project, told) for capture in waiting[:1]]
        for i, capture in enumerate(waiting):
            progress(i / len(waiting), f"decoding {capture.name}")
            phase = ahead.pop()
            while wait([phase], timeout=0.05).not_done:
                progress.check()
            ahead = [pool.submit(decode_series, following, project, told) for following in waiting[i + 1 : i + 2]]
            yield capture, phase.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)  # who stops waits for no other capture


def from_phase_maps(
    project: Project,
    captures: Iterable[Capture],
    what: Callable[[Capture, PhaseMap], T],
    progress: Progress = SILENT,
    modules: Sequence[str] = (),
) -> Generator[tuple[Capture, T]]:
    """Decode captures as `phase_maps` does and give what is made of each; on processes where that is safe.

    `modules` are those that `what` imports.
    """
    waiting = [series for capture in captures for series in capture.series]
    if len(waiting) < MANY or not can_fork(len(waiting)):
        yield from ((capture, what(capture, phase)) for capture, phase in phase_maps(project, waiting, progress))
        return
    for name in ("core.decode.absolute", "core.verify.stored", "numpy.fft", "numpy.ma", *modules):
        import_module(name)  # once, not by every process

    def work(k: int, said: Progress) -> T:
        said(k / len(waiting), f"decoding {waiting[k].name}")
        return what(waiting[k], decode_series(waiting[k], project, said.quiet()))

    yield from zip(waiting, on_processes(work, len(waiting), progress), strict=True)


@dataclass(frozen=True)
class Look:
    """What some work wants of captures: those that it needs, what is made of each, and what of all in the end.

    `due` are captures by one pair of devices each.
    """

    due: Sequence[Capture]
    each: Callable[[Capture, PhaseMap], Any]
    whole: Callable[[Iterable[tuple[Capture, Any]]], Any]

    def taken(self, project: Project, progress: Progress = SILENT) -> Any:
        """Decode the captures, and give what is made of them."""
        return self.whole(from_phase_maps(project, self.due, self.each, progress))


@contextmanager
def taken_together(
    project: Project, looks: Sequence[Look], parts: Sequence[Progress]
) -> Iterator[list[Callable[[], Any]]]:
    """Decode for several works in one stream: while one goes on, processes decode what the next ones want.

    Each of the functions that are given ends one look; they are called in the order of the looks, whose decoding is
    reported to `parts`.
    """
    wanted: dict[tuple[Path, str, str], tuple[Capture, list[int]]] = {}
    for k, look in enumerate(looks):
        for one in look.due:
            wanted.setdefault((one.path, one.camera, one.projector), (one, []))[1].append(k)

    def each(capture: Capture, phase: PhaseMap) -> dict[int, Any]:
        _, of = wanted[capture.path, capture.camera, capture.projector]
        return {k: looks[k].each(capture, phase) for k in of}

    def told(fraction: float, text: str) -> None:
        at = fraction * sum(len(look.due) for look in looks)
        for look, part in zip(looks, parts, strict=True):
            if at < len(look.due):
                part.report(at / len(look.due), text)
                return
            at -= len(look.due)

    def own(k: int) -> Iterator[tuple[Capture, Any]]:
        for one in looks[k].due:
            while k not in made.get((one.path, one.camera, one.projector), {}):
                other, found = next(stream)
                made[other.path, other.camera, other.projector] = found
            yield one, made[one.path, one.camera, one.projector].pop(k)

    made: dict[tuple[Path, str, str], dict[int, Any]] = {}
    said = Progress(told, parts[0].cancelled) if parts else SILENT
    with closing(from_phase_maps(project, [one for one, _ in wanted.values()], each, said)) as stream:
        yield [partial(look.whole, own(k)) for k, look in enumerate(looks)]


def write_phase(out: Path, phase: PhaseMap) -> None:
    """Write a phase map as NPZ, one array for each of its fields; no response, no array."""
    arrays = {f.name: getattr(phase, f.name) for f in fields(PhaseMap)}
    names = [named_by(note) for note in phase.notes]
    arrays |= {"notes": np.array(phase.notes, np.str_), "notes_name": np.array(names, np.str_)}
    with atomic_write(out) as file:
        np.savez(file, **{name: array for name, array in arrays.items() if array is not None})


def read_phase(path: Path) -> PhaseMap:
    """Read what `write_phase` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        arrays = {f.name: stored[f.name] for f in fields(PhaseMap) if f.name in stored}
        names = stored["notes_name"].tolist() if "notes_name" in stored else []
    notes = starmap(Note, zip_longest(arrays.get("notes", np.zeros(0)).tolist(), names, fillvalue="capture"))
    values: dict[str, Any] = {**arrays, "notes": tuple(notes)}
    values |= {name: str(arrays[name]) for name in ("camera", "projector") if name in arrays}
    values |= {name: float(arrays[name]) for name in ("gaps",) if name in arrays}
    return PhaseMap(**values)
