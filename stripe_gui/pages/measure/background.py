"""Work behind the picking page: measuring what was accepted, and making the next images ready, kept for a while."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from core.errors import StripeError
from core.lazy import dataclass
from core.measure import kind_of
from core.model import Array, Capture, DeviceSpec, PhaseMap, Project, Seed, TargetSet, Testfield
from core.pipeline.measure import Side
from core.pipeline.picking import current_target_sets, look_for_picks, measure_one
from core.progress import SILENT, Progress
from stripe_gui.jobs import Failure, JobQueue
from stripe_gui.pages.measure.model import Measurement, Picking, Picks
from stripe_gui.presenters.capture import FrameView, lit_frame
from stripe_gui.presenters.decode import recent_phases
from stripe_gui.presenters.failures import describe
from stripe_gui.presenters.folder import CaptureEntry, Recent, written_ns
from stripe_gui.presenters.work import decode_one
from stripe_gui.workbench import Workbench

FRAMES_KEPT = 6


@dataclass(frozen=True)
class Look:
    """An image, where its dots are, and the guesses of its picks, the likeliest first; None where not asked for."""

    frame: FrameView
    dots: Array
    guesses: tuple[tuple[Seed, ...], ...] | None


def look_at(
    capture: Capture,
    camera: DeviceSpec,
    neighbour: tuple[Seed, ...],
    side: Side,
    guess: bool,
    progress: Progress = SILENT,
) -> Look:
    """Read the evenly lit image of a capture, find its dots, and guess its picks if asked to."""
    frame = lit_frame(capture, progress)
    field = capture.testfield
    if field is None:
        return Look(frame, np.zeros((0, 2)), ())
    progress(0.3, capture.name)
    dots, guesses = look_for_picks(frame.image, capture, camera, neighbour, side)
    return Look(frame, dots, guesses if guess else None)


def snapped(image: NDArray, field: Testfield, at: tuple[float, float], reach_px: float) -> tuple[float, float] | None:
    """Give the centre of the target at or next to a position; one further than a 20th of the image is never meant."""
    return kind_of(field).nearest(image, field, at, min(reach_px, image.shape[1] / 20))


class Kept:
    """Frames and maps of the images worked on last."""

    def __init__(self) -> None:
        self.frames: Recent[FrameView] = Recent(FRAMES_KEPT, lambda _: 1)
        self.phases = recent_phases()


def boards(entries: list[CaptureEntry]) -> list[Capture]:
    """Give the captures in which targets can be picked."""
    return [e.capture for e in entries if e.capture is not None and e.capture.testfield is not None]


def signature(project: Project) -> tuple[object, ...]:
    """Tell whether kept targets or their captures may have changed."""
    return (written_ns(project.path / "results" / "targets.npz"), *project.rig.devices.items())


class Background(QObject):
    """Measures in the program's queue of jobs, so that it is shown and can be cancelled; prepares in one of its own.

    Images `at_work` are being measured or wait for it.
    """

    measured = Signal(int)  # an image was measured, refused or cancelled
    looked = Signal(int)  # an image and its guesses are here

    def __init__(self, bench: Workbench, model: Picking, project: Project, kept: Kept, parent: QObject) -> None:
        super().__init__(parent)
        self._bench, self._model, self._project, self._kept = bench, model, project, kept
        self._ahead = JobQueue(self)
        self._version: tuple[object, ...] = ()
        self._unreadable: set[int] = set()
        self._stopped = False
        self.at_work: set[int] = set()

    @property
    def preparing(self) -> bool:
        return self._ahead.busy

    def stop(self) -> None:
        self._stopped = True
        self._ahead.shut_down()

    def take_measured(self) -> None:
        """Take over the targets that the project keeps, where they follow from the picks as they are."""
        now = signature(self._project)
        if now == self._version or self.at_work:
            return
        self._version = now
        kept = self._bench.guarded(current_target_sets, self._project) or ()
        found = {(t.capture, t.camera, t.projector): t for t in kept}
        for i, capture in enumerate(self._model.captures):
            if (own := found.get((capture.name, capture.camera, capture.projector))) is not None:
                self._model.keep_measurement(i, Measurement(self._model.picks_of(i), own))

    # ---------------------------------------------------------------------------------------------------- measuring

    def measure(self, image: int) -> None:
        capture, picks = self._model.captures[image], self._model.picks_of(image)
        self.at_work.add(image)
        job = self._bench.jobs.run(
            self.tr("Measuring {name}").format(name=capture.name),
            measure_one,
            self._project,
            capture.name,
            self._kept.phases.get(capture),
            camera=capture.camera,
            projector=capture.projector,
            on_done=partial(self._done, image, picks),
            on_failed=partial(self._refused, image, picks),
        )
        job.cancelled.connect(partial(self._ended, image))

    def _done(self, image: int, picks: Picks, targets: TargetSet) -> None:
        self._model.keep_measurement(image, Measurement(picks, targets))
        self._version = signature(self._project)
        self._ended(image)

    def _refused(self, image: int, picks: Picks, failure: Failure) -> None:
        told = describe(failure.error, failure.trace)
        if isinstance(failure.error, StripeError):
            why = f"{failure.error.seen}; {failure.error.remedy}"
            self._model.keep_measurement(image, Measurement(picks, None, why))
        self._bench.notify("error", told.happened, told.remedy, told.details)
        self._ended(image)

    def _ended(self, image: int) -> None:
        self.at_work.discard(image)
        self.measured.emit(image)

    # ---------------------------------------------------------------------------------------------------- preparing

    def prepare(self) -> None:
        """Make ready what the operator will need next: this image, then the next ones, looked at and decoded."""
        if self._ahead.busy or self._stopped:
            return
        model = self._model
        for image in dict.fromkeys((model.image, model.next_due(), model.next_image(1))):
            if image is None or image in self._unreadable:
                continue
            capture = model.captures[image]
            # the guess for the next image waits for this one's picks, which it may be near to
            settled = image == model.image or model.complete
            told = model.has_guesses(image) or model.picks_of(image).seeds or model.settled(image)
            guess = settled and not told
            if guess or self._kept.frames.get(capture) is None:
                camera = self._project.rig.cameras[capture.camera]
                board = (camera, model.neighbour(image), model.side(), guess)
                return self._run(image, look_at, self._have_looked, *board)
            if self._kept.phases.get(capture) is None and model.measured(image) is None:
                return self._run(image, decode_one, self._have_decoded)
        return None

    def _run(self, image: int, function: Callable[..., Any], done: Callable[..., None], *arguments: Any) -> None:
        capture = self._model.captures[image]
        job = self._ahead.run(
            capture.name,
            function,
            capture,
            *arguments,
            on_done=partial(done, image, capture),
            on_failed=lambda _: self._unreadable.add(image),
        )
        job.ended.connect(self.prepare)

    def _have_looked(self, image: int, capture: Capture, look: Look) -> None:
        self._kept.frames.put(capture, look.frame)
        self._model.find(image, look.dots)
        if look.guesses is not None:
            self._model.suggest(image, look.guesses)
        self.looked.emit(image)

    def _have_decoded(self, image: int, capture: Capture, phase: PhaseMap) -> None:
        self._kept.phases.put(capture, phase)
