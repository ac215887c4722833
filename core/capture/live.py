"""One sequence after the other, in memory: verified by content like every capture, and nothing of it stored."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from core.capture.plan import check_shown, make_plan, sequence_for
from core.capture.run import Loop, check_sizes
from core.capture.store import Shot, Store
from core.devices import Camera, Image, Projector, open_devices
from core.model import Project, Subject
from core.model.finding import Finding
from core.patterns import Pattern, level_of
from core.progress import SILENT, Progress
from core.project.images import Image as Pixels


@dataclass(frozen=True)
class Taken:
    """The frames of one sequence, in the order of the patterns, and how it went; `begun_s` is of `time.monotonic`."""

    patterns: tuple[Pattern, ...]
    images: tuple[Pixels, ...]
    findings: tuple[Finding, ...]
    retakes: int
    begun_s: float
    seconds: float


@dataclass
class Memory(Store):
    """Shots that are kept in memory until the next sequence."""

    images: dict[int, Image] = field(default_factory=dict)

    def note(self, event: str, flush: bool = False, **details: Any) -> None:
        """Tell whoever listens."""
        self.listen({"event": event, **details})

    def keep(self, planned: int, image: Image) -> Shot:
        """Remember an image."""
        self.images[planned] = image
        self.shots[planned] = Shot(planned, "", image.bits)
        return self.shots[planned]

    def read(self, planned: int) -> Pixels:
        """Give the latest image of a planned shot."""
        return self.images[planned].pixels

    def finish(self, findings: Sequence[Finding], seconds: float, retakes: int, repeats: int = 0) -> None:
        """Nothing to list."""


@contextmanager
def continuous(
    project: Project, projector_url: str, camera_url: str, patterns: Sequence[Pattern] | None, progress: Progress
) -> Iterator[Continuous]:
    """Open a projector and a camera that take sequences for a `with` block."""
    with open_devices(projector_url, camera_url, check=progress.check) as (projector, camera):
        yield Continuous(project, projector, camera, patterns)


class Continuous:
    """A projector and a camera, open and of the project's sizes, that take the same sequence again and again.

    Without patterns it is what `sequence_for` chooses.
    """

    def __init__(
        self, project: Project, projector: Projector, camera: Camera, patterns: Sequence[Pattern] | None = None
    ) -> None:
        check_sizes(project, projector, camera)
        chosen = patterns if patterns is not None else sequence_for(project, projector)
        plan = make_plan(project, Subject("object", "live"), chosen)
        # an evenly lit frame before and after tells the noise; stripes twice more would only take time
        guards = tuple(g for g in plan.guards if level_of(g) is not None and projector.refusal(g) is None)
        self.plan = replace(plan, guards=guards)
        check_shown(self.plan, projector.refusal, projector.name)
        self._loop = Loop(Memory(Path("live"), self.plan), projector, camera)
        self._loop.again_when_moved = False  # things move between sequences: that is why somebody looks

    def take(self, progress: Progress = SILENT) -> Taken:
        """Take one sequence; DeviceError if frames do not show what they claim after the tries of a capture."""
        begun = time.monotonic()
        store = self._loop.store = Memory(Path("live"), self.plan)
        report = self._loop.run(progress)
        images = tuple(store.read(i) for i in self.plan.own)
        return Taken(self.plan.patterns, images, report.findings, report.retakes, begun, report.seconds)
