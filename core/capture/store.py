"""Shots on disk while a capture is being taken: complete and flushed before the next step depends on them.

A shot's file name is the number of its taking and claims nothing. Which pattern it shows is written into capture.json
only after all frames have been verified; until then capture.json lists no frames, says "taking" and what is planned.
The transcript has one line of JSON for everything that happened, with times; a resumed capture starts from it.
"""

from __future__ import annotations

import json
import os
import threading
import time
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from core.atomic import unwritable
from core.devices import Image
from core.errors import InputError
from core.fields import Fields, read_document
from core.model import Plan, Subject
from core.model.finding import Finding
from core.patterns import pattern_from_dict, pattern_to_dict
from core.project import read_capture, read_image, write_image
from core.project.captures import write_capture_json
from core.project.images import Image as Pixels
from core.project.unfinished import TRANSCRIPT, Status, intact_shots, unfinished_status

Listen = Callable[[dict[str, Any]], None]  # hears every line of the transcript as it is written, in whatever thread


LOCK = ".lock"  # held by the program that records into the folder
TIFF, PNG = ".tif", ".png"  # plain TIFF goes to the disk as quickly as the disk takes it
AHEAD = 4  # frames that may wait for the disk: what a power cut can cost beyond the one being taken


class Writer:
    """Keeps shots in a store, in the order they come, on a thread of its own.

    Nothing may depend on a shot before `wait` has returned. Leaving the context writes what is waiting, whatever the
    reason for leaving: frames that were taken before a cancellation are there when the capture goes on. Where a frame
    could not be written, `put` or `wait` raises a StripeError.
    """

    def __init__(self, store: Store) -> None:
        self.store = store
        self._thread = ThreadPoolExecutor(1, "frames to disk")
        self._waiting: deque[Future[Shot]] = deque()

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, *_: object) -> None:
        self._thread.shutdown()

    def put(self, planned: int, image: Image) -> None:
        """Hand over a shot; waits while `AHEAD` others wait."""
        while self._waiting and (len(self._waiting) > AHEAD or self._waiting[0].done()):
            self._waiting.popleft().result()
        self._waiting.append(self._thread.submit(self.store.keep, planned, image))

    def wait(self) -> None:
        """Return once everything handed over is on disk, complete and flushed."""
        while self._waiting:
            self._waiting.popleft().result()


def no_listener(entry: dict[str, Any]) -> None:
    """Hear nothing."""


@dataclass(frozen=True)
class Shot:
    """One image on disk: the planned shot it was taken for, its file, and the camera's number of bits."""

    planned: int
    file: str
    bits: int


@dataclass
class Store:
    """The folder of a capture that is being taken."""

    folder: Path
    plan: Plan
    shots: dict[int, Shot] = field(default_factory=dict)  # the latest of every planned shot
    taken: int = 0
    ending: str = TIFF  # of the frames' names: the format they are stored in
    started_s: float = field(default_factory=time.monotonic)
    listen: Listen = no_listener
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def note(self, event: str, flush: bool = False, **details: Any) -> None:
        """Add a line to the transcript: seconds since the start (or since it was resumed), the event, its details."""
        entry = {"t": round(time.monotonic() - self.started_s, 6), "event": event, **details}
        path = self.folder / TRANSCRIPT
        with self._lock, _told(path), path.open("ab") as file:
            file.write(json.dumps(entry, ensure_ascii=False).encode() + b"\n")
            if flush:
                file.flush()
                os.fsync(file.fileno())
        self.listen(entry)

    def keep(self, planned: int, image: Image) -> Shot:
        """Write an image to disk, durably, then its line in the transcript."""
        shot = Shot(planned, f"shot-{self.taken:04d}{self.ending}", image.bits)
        self.taken += 1
        path = self.folder / shot.file
        with _told(path):
            write_image(path, image.pixels)
        check = zlib.crc32(np.ascontiguousarray(image.pixels).tobytes())
        exposed = round(image.time_s - self.started_s, 6)
        self.note("shot", True, planned=planned, file=shot.file, bits=image.bits, crc=check, exposed=exposed)
        self.shots[planned] = shot
        return shot

    def read(self, planned: int) -> Pixels:
        """Read the latest image of a planned shot back from disk."""
        return read_image(self.folder / self.shots[planned].file)

    def drop(self, planned: Sequence[int], reason: str) -> None:
        """Give up shots, to be taken again."""
        for number in planned:
            shot = self.shots.pop(number, None)
            if shot is not None:
                self.note("rejected", True, planned=number, file=shot.file, reason=reason)

    def begin(self) -> None:
        """Say in capture.json what is planned."""
        planned = [pattern_to_dict(pattern) for pattern in self.plan.patterns]
        self._write("taking", [], {"planned": planned})

    def finish(self, findings: Sequence[Finding], seconds: float, retakes: int, repeats: int = 0) -> None:
        """List the verified frames in capture.json, then remove the files of rejected shots."""
        frames = [(self.shots[i].file, self.plan.shots[i]) for i in self.plan.own]
        guards = [i for i in range(len(self.plan.shots)) if i not in self.plan.own]
        extra = {
            "guards": [{"file": self.shots[i].file, "pattern": pattern_to_dict(self.plan.shots[i])} for i in guards],
            "camera_bits": self.shots[self.plan.own.start].bits,
            "findings": [finding.as_dict() for finding in findings],
            "repeats": repeats,
            "transcript": TRANSCRIPT,
        }
        self.note("verified", True, seconds=round(seconds, 3), retakes=retakes, repeats=repeats)
        self._write("complete", frames, extra)
        listed = {shot.file for shot in self.shots.values()}
        for path in self.folder.glob("shot-*"):
            if path.name not in listed:
                path.unlink(missing_ok=True)

    def _write(self, state: str, frames: Sequence[Any], extra: dict[str, Any]) -> None:
        plan = self.plan
        with _told(self.folder / "capture.json"):
            write_capture_json(
                self.folder,
                plan.subject,
                frames,
                extra={"state": state, **extra},
                more=[plan.devices] * len(frames) if plan.devices else None,
            )


def open_store(
    folder: Path, plan: Plan, listen: Listen = no_listener, ending: str = TIFF, *, reopen: bool = False
) -> Store:
    """Start a capture's folder, or go on with one that was interrupted.

    With `reopen` a complete one is opened again: of several cameras' folders one is complete before the others.
    InputError if the folder holds a complete capture, something else, or an interrupted capture with another plan.
    """
    other = InputError(
        folder, "an interrupted capture with another plan", "give the same options as then, or remove its folder first"
    )
    if not folder.exists() or not any(p for p in folder.iterdir() if not p.name.endswith((".part", LOCK))):
        with _told(folder):
            folder.mkdir(parents=True, exist_ok=True)
        store = Store(folder, plan, listen=listen, ending=ending)
        store.begin()
        store.note("began", True, wall=_wall(), guards=len(plan.guards))
        return store
    document = _document(folder)
    if reopen and document.get("state") == "complete":
        store = reopen_store(folder, listen)
        own = store.plan
        if plan.shots != own.shots or plan.subject.facts != own.subject.facts:
            raise other
        store.plan, store.ending = plan, ending
        return store
    if document.get("state") != "taking":
        raise InputError(folder, "this capture is complete", "choose another name, or remove its folder first")
    planned = [pattern_to_dict(pattern) for pattern in plan.patterns]
    wanted = plan.subject.facts
    if document.get("planned") != json.loads(json.dumps(planned)) or {k: document.get(k) for k in wanted} != wanted:
        raise other
    for part in folder.glob(".*.part"):
        part.unlink(missing_ok=True)
    store = Store(folder, plan, listen=listen, ending=ending)
    store.taken = _numbers(folder)
    store.shots = {planned: Shot(planned, e["file"], e["bits"]) for planned, e in intact_shots(folder).items()}
    with _told(folder / TRANSCRIPT), (folder / TRANSCRIPT).open("ab") as file:
        file.write(b"\n")  # ends a line that a power cut has torn
    store.note("resumed", True, wall=_wall(), guards=len(plan.guards), kept=sorted(store.shots))
    return store


def reopen_store(folder: Path, listen: Listen = no_listener) -> Store:
    """Open a complete capture to take single frames of it again; it stays as it is until `Store.finish`.

    InputError if the capture is not complete, or was recorded by another program.
    """
    document = _document(folder)
    if document.get("state") != "complete" or "guards" not in document:
        raise InputError(folder, "was not recorded and verified by this program", "capture it under another name")
    capture, where = read_capture(folder), str(folder / "capture.json")
    kept = Fields(document, where).objects("guards", "guard")
    guards = [(g.text("file"), pattern_from_dict(g.data.get("pattern"), g.where)) for g in kept]
    half, frames = len(guards) // 2, [(frame.path.name, frame.pattern) for frame in capture.frames]
    patterns, before = tuple(p for _, p in frames), tuple(p for _, p in guards[:half])
    subject = Subject(capture.role, folder.name, capture.z_mm, capture.angle_deg, document.get("testfield"))
    plan = Plan(subject, patterns, before)
    store = Store(folder, plan, taken=_numbers(folder), listen=listen)
    bits = Fields(document, where).integer("camera_bits", 1, 16)
    for i, (file, _) in enumerate([*guards[:half], *frames, *guards[half:]]):
        store.shots[i] = Shot(i, file, bits)
    return store


def list_together(folder: Path, stores: Sequence[Store], findings: Sequence[Finding]) -> None:
    """Write capture.json of the frames of several cameras, each with a complete folder of its name within `folder`."""
    frames, more = [], []
    for store in stores:
        for i in store.plan.own:
            frames.append((f"{store.folder.name}/{store.shots[i].file}", store.plan.shots[i]))
            more.append({"camera": store.folder.name, **store.plan.devices})
    plan, extra = stores[0].plan, {"state": "complete", "findings": [finding.as_dict() for finding in findings]}
    with _told(folder / "capture.json"):
        write_capture_json(folder, plan.subject, frames, extra=extra, more=more)


def capture_status(folder: Path) -> Status:
    """Say how far a capture got; nothing is changed."""
    document = _document(folder)
    if document.get("state", "complete") == "complete":
        count = len(document.get("frames", []))
        return Status("complete", count, count, ())
    return unfinished_status(folder, len(document.get("planned", [])))


def is_complete(folder: Path) -> bool:
    """Whether a folder holds a capture that this program has verified."""
    return (folder / "capture.json").is_file() and _document(folder).get("state") == "complete"


def read_findings(folder: Path) -> list[Finding]:
    """Read the findings stored with a capture."""
    return [
        Finding(entry["check"], entry["level"], entry["text"], entry["figures"])
        for entry in _document(folder).get("findings", [])
    ]


def _document(folder: Path) -> Mapping[str, Any]:
    try:
        return read_document(folder / "capture.json", "stripe-capture").data
    except InputError as error:
        raise InputError(error.where, error.seen, "choose another name for the capture") from error


def _numbers(folder: Path) -> int:
    """The first number that no file of the folder has had."""
    used = [int(p.stem[5:]) for p in folder.glob("shot-*.*") if p.stem[5:].isdigit()]
    return max(used, default=-1) + 1


def _wall() -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%S%z")


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn what the operating system says about a write into an error that says what to do."""
    try:
        yield
    except OSError as error:
        raise unwritable(path, error, "make room on the disk and start the capture again: it goes on") from error
