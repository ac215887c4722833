"""What the verdict on a calibration rests on: the results of one run, its captures, their targets, known lengths.

What captures say of themselves is told where a result fails or is in doubt because of them: causes before effects.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property, partial
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from core.errors import (
    AdjustmentError,
    InputError,
    NoCoordinateError,
    NotRecognisedError,
    StripeError,
    TooFewPointsError,
    listed,
)
from core.lazy import dataclass
from core.model import (
    Adjustment,
    Calibration,
    Capture,
    Concern,
    DeviceSpec,
    Frame,
    Interior,
    LeftOut,
    Method,
    Note,
    PhaseMap,
    PhotogrammetricCalibration,
    Project,
    Role,
    ScaleBar,
    TargetSet,
    Testfield,
    bluntness,
    named_by,
    points_at_a_cause,
)
from core.numerics import quantile_of, spaced
from core.patterns import axis_of
from core.pipeline.options import CalibrateOptions
from core.project import read_capture
from core.project.contents import contents_of
from core.project.images import read_image

if TYPE_CHECKING:
    from core.checks import Plates

HARMLESS = "pick", "mended"  # notes that leave no result in doubt: there are more picks than are needed
MIDDLE = 64  # bytes
# kinds of errors to which a cause may be added
KINDS = StripeError, AdjustmentError, InputError, NotRecognisedError, NoCoordinateError, TooFewPointsError
LIT_BY = 6  # frames, which light nearly all pixels between them
BRIGHTER, NOISE, UNLIKE = 1.15, 0.05, 0.02  # than white; of what is brightest; of the lit pixels, which noise leaves
NAMED = re.compile(r"\b[Ff]rames? (\d+)(?: and (\d+))?\b")
FIGURE = re.compile(r"\d+(?:\.\d+)? ?%?")


def notes_of(sets: Sequence[TargetSet]) -> dict[str, list[str]]:
    """What captures say of themselves, by name, and why none of their targets was measured."""
    notes: dict[str, list[str]] = {}
    for t in sets:
        own = notes.setdefault(t.capture, [])
        own += [note for note in t.notes if note not in own]
        if not len(t.row) and t.missing:
            why = t.missing[0].reason
            # dots of another size are cut in the middle, or reach into each other
            why = f"{why}; look at diameter_mm in its testfield file, too" if "contour" in why else why
            why = f"{why}, or sharpened by the camera" if "uneven" in why else why
            own.append(f"none of its targets was measured: {why}")
    return notes


def frames_named(sets: Sequence[TargetSet]) -> dict[str, set[int]]:
    """Numbers of frames that captures say are not what they claim, by capture."""
    named: dict[str, set[int]] = {}
    for t in sets:
        for note in t.notes:
            for numbers in NAMED.findall(note) if points_at_a_cause(note) else ():
                named.setdefault(t.capture, set()).update(int(n) for n in numbers if n)
    return named


def noted(notes: Mapping[str, Sequence[str]]) -> list[Concern]:
    """What captures say of themselves, alike ones together, those that point at a cause first."""
    by_text: dict[str, list[tuple[str, str]]] = {}
    for name, texts in notes.items():
        for text in texts:
            by_text.setdefault(FIGURE.sub("", text), []).append((name, text))
    concerns = []
    for entries in sorted(by_text.values(), key=lambda entries: bluntness(entries[0][1])):
        names = list(dict.fromkeys(name for name, _ in entries))
        concerns.append(Concern("doubtful", f"{listed(names, 3)}: {entries[0][1]}"))
    return concerns


def shared_frames(project: Project, captures: Sequence[Capture]) -> dict[str, tuple[Note, ...]]:
    """Say by capture which of its frames stand under two patterns of it, or in another of the project, too."""
    from core.checks import repeated_frames

    own = [frame for capture in captures for frame in capture.frames]
    sizes, mine = {_size(frame) for frame in own} - {None}, {os.path.realpath(capture.path) for capture in captures}
    others = []
    for folder in project.captures:
        with suppress(InputError):  # another that cannot be read is no matter of these
            others += [] if os.path.realpath(folder) in mine else [read_capture(folder, project)]
    contents = contents_of(project.path)
    # only files of one size can be the same, and of those that are not compressed the ones that look alike
    alike = [f for c in (*others, *captures) for f in c.frames if _size(f) in sizes]
    middles = {_middle(frame) for frame in own}
    known = contents.learn(f.place for f in alike if _middle(f) in middles)
    held = {known.get(frame.place) for frame in own} - {None}
    shared = {place: key for place, key in known.items() if key in held}
    checks = has_one_value, shows_all_or_no_light, is_white_of
    found = repeated_frames([*others, *captures], project.rig.projectors, shared, *checks, of_each=True)
    contents.keep()
    told: dict[str, tuple[Note, ...]] = {capture.name: () for capture in captures}
    for concern in found:
        if (name := concern.about) in told:
            told[name] += (Note(concern.text.removeprefix(name).lstrip(": "), "mistake"),)
    return told


def has_one_value(frame: Frame) -> bool:
    """Whether a frame is of one grey value: darkness without noise is the same everywhere."""
    return not np.ptp(read_image(frame.path))


def shows_all_or_no_light(capture: Capture, frame: Frame) -> bool:
    """Whether no other frame of the same devices is brighter anywhere, or none darker: with noise some always are."""
    image = read_image(frame.path)
    others = [f.path for f in capture.frames if (f.camera, f.projector) == (frame.camera, frame.projector)]
    return any(
        all(np.all(way(read_image(path), image)) for path in others) for way in (np.less_equal, np.greater_equal)
    )


def is_white_of(capture: Capture, frame: Frame) -> bool:
    """Whether a white frame is as bright, wherever its capture is lit, as some of the other frames."""
    taken = attrgetter("camera", "projector", "exposure_ms")
    others = [f for f in capture.frames if axis_of(f.pattern) and taken(f) == taken(frame)]
    if not others:
        return False
    white = read_image(frame.path).astype(np.float32)
    seen = np.max([read_image(others[k].path) for k in spaced(len(others), LIT_BY)], axis=0).astype(np.float32)
    lit = seen > quantile_of(seen, 0.97) / 2
    return float(np.mean((seen > BRIGHTER * white + NOISE * seen.max())[lit])) < UNLIKE


def _size(frame: Frame) -> int | None:
    try:
        return os.stat(frame.place).st_size
    except OSError:
        return None


def _middle(frame: Frame) -> bytes:
    """Read a few bytes from the middle of a frame's file: grey values where it is not compressed."""
    try:
        with open(frame.place, "rb") as file:
            file.seek(os.stat(frame.place).st_size // 2)
            return file.read(MIDDLE)
    except OSError:
        return b""


@contextmanager
def because_of(notes: Mapping[str, Sequence[str]]) -> Iterator[None]:
    """Where work fails, say also what captures say of themselves: the cause, as a rule."""
    try:
        yield
    except StripeError as error:
        told = [c.text for c in noted(notes)]
        sharp = any(points_at_a_cause(note) for texts in notes.values() for note in texts)
        kind = AdjustmentError if isinstance(error, AdjustmentError) else type(error)  # its own kinds say the same
        if kind not in KINDS or not told or (isinstance(error, InputError) and not sharp):
            raise
        raise kind(error.where, error.seen, f"{error.remedy}. First see to this: {told[0]}") from None


@contextmanager
def points_of(capture: Capture, phases: Sequence[PhaseMap]) -> Iterator[None]:
    """Where decoded frames have no coordinate that points follow from, name the capture and what it says."""
    with because_of({capture.name: [*capture.notes, *(note for phase in phases for note in phase.notes)]}):
        try:
            yield
        except NoCoordinateError as error:
            raise InputError(capture.path, error.seen, error.remedy) from None


@dataclass(frozen=True)
class Evidence:
    """One run that is to be judged: its results by method, what lies beside them by file name, the captures used."""

    project: Project
    calibrations: Mapping[Method, Calibration]
    beside: Mapping[str, object]
    used: Mapping[Method, Sequence[Capture]]
    options: CalibrateOptions
    sets: Sequence[TargetSet]  # all that are current
    roles: Mapping[Method, Sequence[Role]]  # of the captures that a method reads
    captures: Sequence[Capture]  # all of the project

    @cached_property
    def kept(self) -> dict[str, TargetSet]:
        """The targets of each capture; of those that several cameras saw, the first one's."""
        return {t.capture: t for t in reversed(self.sets)}

    @property
    def photogrammetric(self) -> Method | None:
        """The method of this run, if any, that calibrated the devices themselves."""
        found = (m for m, c in self.calibrations.items() if isinstance(c, PhotogrammetricCalibration))
        return next(found, None)

    @cached_property
    def lengths(self) -> list[Concern]:
        """What known lengths, boards and plates say of the photogrammetric calibration, if it gives points at all."""
        from core.checks import depthless_concerns, length_concerns

        adjustment = next((a for a in self.beside.values() if isinstance(a, Adjustment)), None)
        if self.photogrammetric is None or adjustment is None:
            return []
        calibration, board = self.calibrations[self.photogrammetric], self.used[self.photogrammetric][0].testfield
        assert isinstance(calibration, PhotogrammetricCalibration)
        if found := depthless_concerns(calibration, adjustment):
            return found
        return length_concerns(adjustment, board, self.project.scale, self.plates[0], self.same_board)

    @cached_property
    def plates(self) -> tuple[Plates | None, Testfield | None]:
        """Plates at known positions, seen by the photogrammetric calibration, and their board."""
        calibration = self.calibrations.get(self.photogrammetric or "")
        if not isinstance(calibration, PhotogrammetricCalibration):
            return None, None
        return _plates(calibration, self.captures, self.kept)

    @property
    def same_board(self) -> bool:
        """Whether the plates have the board that the photogrammetric calibration was adjusted with."""
        plate = self.plates[1]
        return plate is not None and _same(plate, self.used[self.photogrammetric or ""][0].testfield)

    def targets(self, method: Method) -> list[TargetSet]:
        """The targets of the captures that a method used."""
        wanted = {c.name for c in self.used[method]}
        return [t for t in self.sets if t.capture in wanted]

    def said(self, method: Method) -> list[Concern]:
        """What the captures of a method say of themselves, and those of which nothing was measured."""
        from core.checks import exchanged_notes, size_concerns

        sets, boards = self.targets(method), {id(c.testfield): c.testfield for c in self.used[method]}
        of_board = {key: exchanged_notes(board) for key, board in boards.items() if board is not None}
        notes = {name: [n for n in own if named_by(n) not in HARMLESS] for name, own in notes_of(sets).items()}
        for capture in self.used[method]:
            notes.setdefault(capture.name, []).extend((*capture.notes, *of_board.get(id(capture.testfield), ())))
        notes["project"] = list(self.project.notes)
        told = noted(notes)
        return [*told, *size_concerns(sets, {c.name: c.testfield for c in self.used[method]})]

    def left_out(self, method: Method, rejected: Mapping[str, tuple[int, int]] | None = None) -> tuple[LeftOut, ...]:
        """List targets and captures without a part in a method's result; `rejected` is by station, of how many."""
        from core.checks import left_out_of

        names = {c.name for c in self.used[method]}
        idle = [c.name for c in self.captures if c.role in self.roles[method] and c.name not in names]
        why = [(n, "left out by choice" if n in self.options.without else "names no testfield") for n in idle]
        return left_out_of(self.targets(method), rejected, why)


def lengths_of(
    spec: DeviceSpec,
    interior: Interior,
    plates: Sequence[Capture],
    targets: Mapping[str, TargetSet],
    scale: ScaleBar | None = None,
) -> list[Concern]:
    """What the targets of plates, by capture, say of their positions and their board, seen by the camera alone.

    `scale` is a bar on that very board.
    """
    from core.checks import length_concerns, misplaced_on_plate, pose_plates

    boards = [c for c in plates if c.testfield is not None and c.name in targets]
    if not boards or boards[0].testfield is None:
        return []
    z_mm = {c.name: c.z_mm for c in boards if c.z_mm is not None}
    board = boards[0].testfield
    posed = partial(pose_plates, spec, interior, [targets[name] for name in z_mm], z_mm, board)
    return [
        *misplaced_on_plate(board, posed(seen=True)),  # which may be why a plate seems to stand elsewhere
        *length_concerns(None, board, scale, posed(), False),
    ]


def _plates(
    calibration: PhotogrammetricCalibration, captures: Sequence[Capture], kept: Mapping[str, TargetSet]
) -> tuple[Plates | None, Testfield | None]:
    from core.checks import see_plates

    depth = [c for c in captures if c.role == "depth" and c.z_mm is not None and c.testfield is not None]
    if not depth or not any(c.name in kept for c in depth):
        return None, None
    board = depth[0].testfield
    assert board is not None
    z_mm = {
        c.name: c.z_mm for c in depth if c.z_mm is not None and c.testfield is not None and _same(c.testfield, board)
    }
    return see_plates(calibration, [kept[name] for name in z_mm if name in kept], z_mm, board), board


def _same(a: Testfield, b: Testfield | None) -> bool:
    return b is not None and a.index() == b.index() and bool(np.allclose(a.xyz_mm, b.xyz_mm))
