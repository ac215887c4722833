"""The loop: show, wait until the light is steady, take, store; verify every frame; take again what is wrong."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from core.capture.latency import measure_latency
from core.capture.plan import check_shown, make_plan, sequence_for
from core.capture.store import (
    LOCK,
    TIFF,
    Listen,
    Store,
    Writer,
    capture_status,
    is_complete,
    list_together,
    no_listener,
    open_store,
    read_findings,
)
from core.capture.triggered import period_of, take_sequence
from core.devices import Camera, Image, Projector, open_camera, open_projector, wait_until
from core.errors import DeviceError, InputError, PatternRefusedError
from core.lazy import dataclass
from core.model import Plan, Project, Subject
from core.model.finding import Finding
from core.patterns import Pattern, describe
from core.progress import SILENT, Progress
from core.project import add_capture, read_project
from core.project.lock import lock
from core.verify.identity import identity
from core.verify.misfit import misfitting_steps
from core.verify.quality import lamp, line, modulation, movement, sample_grid, saturation, summarise

ROUNDS = 4  # times that wrong frames are taken again before the capture is given up
FLASHES = 8  # to find the latency of a screen
TRIES = 3  # at one frame, when a device does not deliver

Said = tuple[float, str, str]  # when (of time.monotonic), who, what: a device about what it did beside the asked


@dataclass(frozen=True)
class CaptureReport:
    """How a capture went."""

    folder: Path
    frames: int
    findings: tuple[Finding, ...]
    retakes: int
    seconds: float
    resumed: int = 0  # frames that an interrupted run had taken before
    repeats: int = 0  # questions to the projector that had to be put again

    @property
    def words(self) -> list[str]:
        """The findings in words, warnings first."""
        order = {"bad": 0, "warning": 1, "good": 2}
        return [finding.text for finding in sorted(self.findings, key=lambda f: order[f.level])]


def run_capture(
    project: Project,
    subject: Subject,
    projector_url: str,
    camera_url: str | Mapping[str, str],
    *,
    patterns: Sequence[Pattern] | None = None,
    progress: Progress = SILENT,
    listen: Listen = no_listener,
    ending: str = TIFF,
) -> CaptureReport:
    """Record one sequence into ``captures/NAME`` of a project, or go on with one that was interrupted.

    Several cameras take every pattern together, and what one of them has wrong all take again. Each has a folder of its
    own within the capture's, with its transcript; the capture lists the frames of all once every one is verified.

    Parameters
    ----------
    projector_url, camera_url : str
        As `core.devices.open_projector` and `open_camera` take them; of several cameras by their names in the rig.
    patterns : sequence of Pattern, optional
        Without it what `sequence_for` chooses.
    listen : callable
        Receives every entry of the transcript, from whatever thread writes it.
    ending : str
        Of the frames' names, and so their format: plain TIFF or PNG.

    Raises
    ------
    InputError
        Before anything is written: bad URLs, names, roles, sizes.
    BusyError
        If another program is recording that capture.
    DeviceError
        If a device fails, or frames still do not show what they claim after `ROUNDS` rounds. What was taken stays on
        disk and the same call goes on with it.
    """
    urls = {"": camera_url} if isinstance(camera_url, str) else camera_url
    folder, notes = project.path / "captures" / subject.name, list[Said]()

    def planned(camera: str, chosen: Sequence[Pattern] | None) -> Plan:
        return make_plan(project, replace(subject, camera=camera or subject.camera), chosen)

    def note(who: str, what: str) -> None:
        notes.append((time.monotonic(), who, what))

    for camera in urls:
        planned(camera, patterns)
    if is_complete(folder):
        if folder.resolve() in {path.resolve() for path in read_project(project.path).captures}:
            raise InputError(folder, "this capture is complete", "choose another name, or remove its folder first")
        add_capture(project.path, f"captures/{subject.name}")  # a run was interrupted at the very end
        return stored_report(folder)
    if "" not in urls and (folder / "capture.json").exists():
        raise InputError(folder, "an interrupted capture of one camera", "go on with that one, or remove its folder")
    with ExitStack() as opened:
        projector = opened.enter_context(closing(open_projector(projector_url, note, progress.check)))
        devices = {c: opened.enter_context(closing(open_camera(url, note, c))) for c, url in urls.items()}
        for camera, device in devices.items():
            check_sizes(project, projector, device, camera, subject.projector)
        chosen = patterns if patterns is not None else sequence_for(project, projector)
        plans = {}
        for camera in devices:
            plan = planned(camera, chosen)
            plans[camera] = replace(plan, guards=tuple(g for g in plan.guards if projector.refusal(g) is None))
            check_shown(plans[camera], projector.refusal, projector.name)
        opened.enter_context(lock(folder / LOCK, "capture"))
        stores = {c: open_store(folder / c, plan, listen, ending, reopen=bool(c)) for c, plan in plans.items()}
        loops = [Loop(stores[camera], projector, device, notes) for camera, device in devices.items()]
        loops[0].beside = loops[1:]
        report = loops[0].run(progress)
        if "" not in urls:
            list_together(folder, list(stores.values()), report.findings)
            report = replace(report, folder=folder, frames=report.frames * len(loops))
        add_capture(project.path, f"captures/{subject.name}")
    return report


def stored_report(folder: Path) -> CaptureReport:
    """Give the report of a complete capture again, as far as it is stored."""
    findings = tuple(read_findings(folder))
    frames = capture_status(folder).planned
    return CaptureReport(folder, frames, findings, 0, 0.0, frames)


class Loop:
    """One capture being taken: the store, the two devices, and the projector's settle time as far as it is known."""

    def __init__(self, store: Store, projector: Projector, camera: Camera, notes: list[Said] | None = None) -> None:
        self.store, self.projector, self.camera = store, projector, camera
        self.plan: Plan = store.plan
        self.settle_s = projector.settle_s
        self._late = getattr(projector, "late", False)  # and nobody has said by how much
        self.notes = notes if notes is not None else []
        self.beside: Sequence[Loop] = ()  # those of further cameras, which look at the same patterns
        self.again_when_moved = True  # all of it, once
        self._loaded = False
        self._by_clock, self._clock_tries = False, TRIES  # whether the last take was by the clock of a device
        self._shape: tuple[int, ...] | None = None  # of the images

    @property
    def together(self) -> list[Loop]:
        """This loop and those of further cameras."""
        return [self, *self.beside]

    def run(self, progress: Progress = SILENT) -> CaptureReport:
        """Take what is missing, verify everything, take wrong frames again, and finish."""
        start, resumed, retakes = time.monotonic(), len(self.store.shots), 0
        self._clock_tries = TRIES
        whole_again = not self.again_when_moved
        for attempt in range(ROUNDS + 1):
            missing = [
                i for i in range(len(self.plan.shots)) if any(i not in loop.store.shots for loop in self.together)
            ]
            retakes += len(missing) if attempt else 0
            self.take(missing, progress.part(0.9 * attempt / (attempt + 1), 0.9))
            findings = [f for loop in self.together for f in loop.verified(progress.part(0.9, 1.0))]
            wrong, moved = judge(findings)
            reasons = "; ".join(f.text for f in findings if f.level == "bad" or f is moved)
            # what was taken before an interruption may show the scene at another place
            if not whole_again and (resumed and attempt if wrong else moved):
                whole_again = True
                self._drop(range(len(self.plan.shots)), reasons)
                continue
            if not wrong:
                return self.finish(findings, start, retakes, resumed)
            if self._by_clock:  # a trigger that was missed shifts all that follow
                self._drop(range(len(self.plan.shots)), reasons)
                continue
            self._drop(wrong, reasons)
            self.doubt()
        raise DeviceError(
            self.store.folder.parent if self.beside else self.store.folder,
            f"after {ROUNDS} further tries {reasons}",
            "check the projector's settle time, its cable, the camera's trigger and, of a folder camera, its "
            "latency_ms; then start the same capture again",
        )

    def take(self, shots: Sequence[int], progress: Progress) -> None:
        """Take shots one after the other; they are on disk when this returns."""
        if self._late:
            self._measure_latency(progress)
        with ExitStack() as stack:
            writers = [stack.enter_context(Writer(loop.store)) for loop in self.together]
            self._by_clock = len(shots) == len(self.plan.shots) and self._take_all(writers, progress)
            if not self._by_clock:
                for i in progress.over(shots, "frame {}"):
                    for writer, image in zip(writers, self._take(i, progress), strict=True):
                        writer.put(i, image)
            for writer in writers:
                writer.wait()

    def _take_all(self, writers: Sequence[Writer], progress: Progress) -> bool:
        """Take the whole sequence by one device's clock, if these devices can; say whether it succeeded."""
        shots, cameras = self.plan.shots, [loop.camera for loop in self.together]
        if not period_of(self.projector, cameras) or self.projector.capacity < len(shots):
            return False
        while self._clock_tries:
            self._clock_tries -= 1
            try:
                if not self._loaded:
                    self.projector.load(shots, progress.check)
                    self._loaded = True
                taken = take_sequence(self.projector, cameras, len(shots), progress.check)
            except DeviceError as error:
                self.store.note("failed", reason=str(error))
                self._loaded = False
                continue
            for loop, writer, images in zip(self.together, writers, taken, strict=True):
                for planned, image in enumerate(images):
                    loop._check_image(image, shots[planned])
                    writer.put(planned, image)
            return True
        return False  # step by step instead, which is slower and surer

    def _measure_latency(self, progress: Progress) -> None:
        """Find by some flashes what is to be waited after a pattern is shown, once."""
        self._late = False
        try:
            latency = measure_latency(self.projector, self.camera, FLASHES, progress.check)
            self.settle_s, told = latency.enough_s, latency.finding.text
        except DeviceError as error:  # whether the camera sees the patterns is judged by the frames
            told = f"its latency was not found: {error}"
        self.notes.append((time.monotonic(), self.projector.name, told))

    def doubt(self) -> None:
        """Wait longer from now on, perhaps the light was not steady; load again, perhaps the device is out of step."""
        self.settle_s = min(2 * self.settle_s + 0.005, 1.0)
        self._loaded = False

    def finish(self, findings: Sequence[Finding], start_s: float, retakes: int, resumed: int) -> CaptureReport:
        """List the verified frames, and tell how it went."""
        self._write_notes()
        seconds = time.monotonic() - start_s
        repeats, asked = getattr(self.projector, "repeats", (0, 0))
        findings = [*findings, line(repeats, asked)] if asked else list(findings)
        for loop in self.together:
            loop.store.finish(findings, seconds, retakes, repeats)
        frames = len(self.plan.patterns)
        return CaptureReport(self.store.folder, frames, tuple(findings), retakes, seconds, resumed, repeats)

    def verified(self, progress: Progress) -> list[Finding]:
        """Verify the frames of this loop's camera, and name it where there are several."""
        found = verify(self.store, self.projector.size, progress)
        name = self.plan.devices.get("camera")
        return [replace(f, text=f"{name}: {f.text}") for f in found] if name else found

    def _drop(self, shots: Sequence[int], reason: str) -> None:
        for loop in self.together:
            loop.store.drop(shots, reason)

    def _take(self, planned: int, progress: Progress) -> list[Image]:
        """Show, wait until steady, expose all cameras."""
        pattern = self.plan.shots[planned]
        for attempt in range(TRIES):
            try:
                self._show(planned, progress)
                wait_until(time.monotonic() + self.settle_s, progress.check)
                images = [loop.camera.grab(check=progress.check) for loop in self.together]
                break
            except PatternRefusedError:
                raise
            except DeviceError as error:
                self.store.note("failed", planned=planned, reason=str(error))
                self._loaded = False
                if attempt + 1 == TRIES:
                    self._write_notes()
                    raise
        self._write_notes()
        for loop, image in zip(self.together, images, strict=True):
            loop._check_image(image, pattern)
        return images

    def _show(self, planned: int, progress: Progress) -> None:
        shots = self.plan.shots
        if self.projector.capacity < len(shots):
            self.projector.show(shots[planned], progress.check)
            return
        if not self._loaded:
            self.projector.load(shots, progress.check)
            self._loaded = True
        self.projector.step(planned, progress.check)

    def _check_image(self, image: Image, pattern: Pattern) -> None:
        self._shape = self._shape or image.pixels.shape
        if image.pixels.ndim != 2 or image.pixels.shape != self._shape:
            raise DeviceError(
                self.camera.name,
                f"an image of shape {image.pixels.shape} for {describe(pattern)}",
                "set the camera to one size and to grey values for the whole capture",
            )

    def _write_notes(self) -> None:
        for moment, who, what in self.notes:
            self.store.note("device", at=round(moment - self.store.started_s, 6), who=who, what=what)
        self.notes.clear()


def judge(findings: Sequence[Finding]) -> tuple[list[int], Finding | None]:
    """Give the shots that are to be taken again, and the finding that something moved."""
    wrong = sorted({i for f in findings if f.level == "bad" for i in f.shots})
    return wrong, next((f for f in findings if f.check == "movement" and f.level != "good"), None)


def verify(store: Store, lines: tuple[int, int], progress: Progress = SILENT) -> list[Finding]:
    """Read all shots back from disk and run every check on them.

    Parameters
    ----------
    store : Store
        With every planned shot taken.
    lines : (int, int)
        The projector's columns and rows.
    """
    plan = store.plan
    shape = store.read(0).shape
    at = sample_grid(shape)

    def sample(shot: int) -> NDArray[np.float64]:
        progress.check()
        pixels = store.read(shot)
        if pixels.shape != shape:
            raise DeviceError(
                store.folder / store.shots[shot].file,
                f"{pixels.shape[1]}x{pixels.shape[0]} px among frames of {shape[1]}x{shape[0]} px",
                "remove the capture's folder and set the camera to one size",
            )
        return pixels[at[0], at[1]].astype(np.float64)

    progress(0.0, "reading the frames back")
    with ThreadPoolExecutor(2) as pool:  # decoding a PNG leaves the interpreter to others
        grey = list(pool.map(sample, range(len(plan.shots))))
    progress(0.3, "verifying")
    full = (1 << store.shots[0].bits) - 1
    sampled = summarise(plan, np.array(grey), at, shape, full)
    before = [store.read(i).astype(np.float64) for i, _ in plan.guard_pairs]
    after = [store.read(i).astype(np.float64) for _, i in plan.guard_pairs]
    progress(0.5, "verifying")
    shown = identity(plan, sampled, lines)
    if all(f.level != "bad" for f in shown):
        shown += misfitting_steps(plan, sampled).values()
    return [
        *shown,
        modulation(plan, sampled),
        saturation(sampled),
        lamp(plan, sampled),
        movement(plan, before, after, sampled.noise),
    ]


def check_sizes(project: Project, projector: Projector, camera: Camera, name: str = "", shown_by: str = "") -> None:
    """See that the devices are those of the project: those of these names in it, or the ones that are meant."""
    rig = project.rig
    for device, spec, size, unit in (
        (shown_by or "projector", rig.projectors[shown_by or rig.projector_name], projector.size, "lines"),
        (name or "camera", rig.cameras[name or rig.camera_name], camera.size, "px"),
    ):
        if size is not None and tuple(size) != (spec.width, spec.height):
            raise InputError(
                project.path / "project.json",
                f"{device} is {spec.width}x{spec.height}, the device has {size[0]}x{size[1]} {unit}",
                f"correct the {device} in project.json or connect the device it describes",
            )
