"""One sequence after the other, in memory: verified by content like every capture, and nothing of it stored."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from core.capture.plan import check_shown, make_plan, sequence_for
from core.capture.run import Loop, check_sizes
from core.capture.store import Shot, Store
from core.devices import Camera, Image, Projector, open_camera, open_projector
from core.model import Project, Subject
from core.model.finding import Finding
from core.patterns import Pattern, level_of
from core.progress import SILENT, Progress
from core.project.images import Image as Pixels


@dataclass(frozen=True)
class Taken:
    """The frames of one sequence, in the order of the patterns, and how it went; `begun_s` is of `time.monotonic`."""

    patterns: tuple[Pattern, ...]
    images: Mapping[str, tuple[Pixels, ...]]  # of every camera
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
    project: Project,
    projector_url: str,
    camera_urls: Mapping[str, str],
    patterns: Sequence[Pattern] | None,
    progress: Progress,
    shown_by: str = "",
) -> Iterator[Continuous]:
    """Open a projector and cameras, by their names in the rig, that take sequences for a `with` block."""
    with ExitStack() as opened:
        projector = opened.enter_context(closing(open_projector(projector_url, check=progress.check)))
        cameras = {}
        for name, url in camera_urls.items():
            said = name if len(camera_urls) > 1 else ""
            cameras[name] = opened.enter_context(closing(open_camera(url, name=said)))
        yield Continuous(project, projector, cameras, patterns, shown_by)


class Continuous:
    """A projector and cameras, open and of the project's sizes, that take the same sequence again and again.

    Without patterns it is what `sequence_for` chooses. `shown_by` names the projector in a rig of several.
    """

    def __init__(
        self,
        project: Project,
        projector: Projector,
        cameras: Mapping[str, Camera],
        patterns: Sequence[Pattern] | None = None,
        shown_by: str = "",
    ) -> None:
        for name, camera in cameras.items():
            check_sizes(project, projector, camera, name, shown_by)
        chosen = patterns if patterns is not None else sequence_for(project, projector)
        loops = []
        for name, camera in cameras.items():
            plan = make_plan(project, Subject("object", "live", camera=name, projector=shown_by), chosen)
            # an evenly lit frame before and after tells the noise; stripes twice more would only take time
            guards = tuple(g for g in plan.guards if level_of(g) is not None and projector.refusal(g) is None)
            loops.append(Loop(Memory(Path("live"), replace(plan, guards=guards)), projector, camera))
        self._loop = loops[0]
        self._loop.beside = loops[1:]
        self._loop.again_when_moved = False  # things move between sequences: that is why somebody looks
        self._cameras, self.plan = tuple(cameras), self._loop.plan
        check_shown(self.plan, projector.refusal, projector.name)

    def take(self, progress: Progress = SILENT) -> Taken:
        """Take one sequence; DeviceError if frames do not show what they claim after the tries of a capture."""
        begun = time.monotonic()
        stores = {
            name: Memory(Path("live"), loop.plan) for name, loop in zip(self._cameras, self._loop.together, strict=True)
        }
        for store, loop in zip(stores.values(), self._loop.together, strict=True):
            loop.store = store
        report = self._loop.run(progress)
        images = {name: tuple(store.read(i) for i in self.plan.own) for name, store in stores.items()}
        return Taken(self.plan.patterns, images, report.findings, report.retakes, begun, report.seconds)
