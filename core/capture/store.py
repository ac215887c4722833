"""Shots on disk while a capture is being taken: complete and flushed before the next step depends on them.

A shot's file name is the number of its taking and claims nothing. Which pattern it shows is written into capture.json
only after all frames have been verified; until then capture.json lists no frames, says "taking" and what is planned.
The transcript has one line of JSON for everything that happened, with times; a resumed capture starts from it.
"""

from __future__ import annotations

import json
import os
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from core.capture.finding import Finding
from core.capture.plan import Plan
from core.devices import Image
from core.errors import InputError, StripeError
from core.patterns import pattern_to_dict
from core.project import read_image, write_image
from core.project.captures import VERSION, write_capture_json
from core.project.images import Image as Pixels

TRANSCRIPT = "transcript.jsonl"


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
    started_s: float = field(default_factory=time.monotonic)

    def note(self, event: str, flush: bool = False, **details: Any) -> None:
        """Add a line to the transcript: seconds since the start (or since it was resumed), the event, its details."""
        entry = {"t": round(time.monotonic() - self.started_s, 6), "event": event, **details}
        with _told(self.folder / TRANSCRIPT), (self.folder / TRANSCRIPT).open("ab") as file:
            file.write(json.dumps(entry, ensure_ascii=False).encode() + b"\n")
            if flush:
                file.flush()
                os.fsync(file.fileno())

    def keep(self, planned: int, image: Image) -> Shot:
        """Write an image to disk, durably, then its line in the transcript."""
        shot = Shot(planned, f"shot-{self.taken:04d}.png", image.bits)
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

    def finish(self, findings: Sequence[Finding], seconds: float, retakes: int) -> None:
        """List the verified frames in capture.json, then remove the files of rejected shots."""
        frames = [(self.shots[i].file, self.plan.shots[i]) for i in self.plan.own]
        guards = [i for i in range(len(self.plan.shots)) if i not in self.plan.own]
        extra = {
            "guards": [{"file": self.shots[i].file, "pattern": pattern_to_dict(self.plan.shots[i])} for i in guards],
            "camera_bits": self.shots[self.plan.own.start].bits,
            "findings": [finding.as_dict() for finding in findings],
            "transcript": TRANSCRIPT,
        }
        self.note("verified", True, seconds=round(seconds, 3), retakes=retakes)
        self._write("complete", frames, extra)
        listed = {shot.file for shot in self.shots.values()}
        for path in self.folder.glob("shot-*.png"):
            if path.name not in listed:
                path.unlink(missing_ok=True)

    def _write(self, state: str, frames: Sequence[Any], extra: dict[str, Any]) -> None:
        plan = self.plan
        with _told(self.folder / "capture.json"):
            write_capture_json(
                self.folder,
                plan.role,
                frames,
                testfield=plan.testfield,
                z_mm=plan.z_mm,
                angle_deg=plan.angle_deg,
                extra={"state": state, **extra},
            )


def open_store(folder: Path, plan: Plan) -> Store:
    """Start a capture's folder, or go on with one that was interrupted.

    Raises
    ------
    InputError
        If the folder holds a complete capture, something else, or an interrupted capture with another plan.
    """
    if not folder.exists() or not any(p for p in folder.iterdir() if not p.name.endswith(".part")):
        with _told(folder):
            folder.mkdir(parents=True, exist_ok=True)
        store = Store(folder, plan)
        store.begin()
        store.note("began", True, wall=_wall(), guards=len(plan.guards))
        return store
    document = _document(folder)
    if document.get("state") != "taking":
        raise InputError(folder, "this capture is complete", "choose another name, or remove its folder first")
    planned = [pattern_to_dict(pattern) for pattern in plan.patterns]
    kept = {k: document.get(k) for k in ("role", "testfield", "z_mm", "angle_deg")}
    wanted = {"role": plan.role, "testfield": plan.testfield, "z_mm": plan.z_mm, "angle_deg": plan.angle_deg}
    if document.get("planned") != json.loads(json.dumps(planned)) or kept != wanted:
        raise InputError(
            folder,
            "an interrupted capture with another plan",
            "give the same options as then, or remove its folder first",
        )
    for part in folder.glob(".*.part"):
        part.unlink(missing_ok=True)
    store = Store(folder, plan)
    store.taken, entries = _numbers(folder), list(_transcript(folder))
    for entry in entries:
        if entry.get("event") == "shot" and _intact(folder, entry):
            store.shots[entry["planned"]] = Shot(entry["planned"], entry["file"], entry["bits"])
        elif entry.get("event") == "rejected":
            store.shots.pop(entry.get("planned", -1), None)
    with _told(folder / TRANSCRIPT), (folder / TRANSCRIPT).open("ab") as file:
        file.write(b"\n")  # ends a line that a power cut has torn
    store.note("resumed", True, wall=_wall(), guards=len(plan.guards), kept=len(store.shots))
    return store


@dataclass(frozen=True)
class Status:
    """What is in a capture's folder: how many frames were planned, which of them have been taken and verified."""

    state: str
    planned: int
    taken: int
    missing: tuple[int, ...]

    def __str__(self) -> str:
        if self.state == "complete":
            return f"complete: {self.planned} frames"
        numbers = ", ".join(str(i) for i in self.missing)
        what = f"missing: {numbers}" if self.missing else "all taken, not yet verified"
        return f"incomplete: {self.taken} of {self.planned} frames taken; {what}"


def capture_status(folder: Path) -> Status:
    """Say how far a capture got; nothing is changed.

    Raises
    ------
    InputError
        If the folder holds no capture.
    """
    document = _document(folder)
    if document.get("state", "complete") == "complete":
        count = len(document.get("frames", []))
        return Status("complete", count, count, ())
    planned, entries = len(document.get("planned", [])), list(_transcript(folder))
    before = next((int(e["guards"]) for e in entries if "guards" in e), 0)
    have: set[int] = set()
    for entry in entries:
        if entry.get("event") == "shot" and _intact(folder, entry):
            have.add(entry["planned"] - before)
        elif entry.get("event") == "rejected":
            have.discard(entry["planned"] - before)
    missing = tuple(i for i in range(planned) if i not in have)
    return Status("taking", planned, planned - len(missing), missing)


def is_complete(folder: Path) -> bool:
    """Whether a folder holds a capture that this program has verified."""
    return (folder / "capture.json").is_file() and _document(folder).get("state") == "complete"


def read_findings(folder: Path) -> list[Finding]:
    """Read the findings stored with a capture."""
    return [
        Finding(entry["check"], entry["level"], entry["text"], entry["figures"])
        for entry in _document(folder).get("findings", [])
    ]


def _document(folder: Path) -> dict[str, Any]:
    path = folder / "capture.json"
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(folder, "holds no capture.json", "choose another name for the capture") from error
    except (OSError, ValueError) as error:
        raise InputError(path, f"cannot be read ({error})", "choose another name for the capture") from error
    if not isinstance(document, dict) or document.get("version") != VERSION:
        raise InputError(path, "not a capture of this program's version", "choose another name for the capture")
    return document


def _transcript(folder: Path) -> Iterator[dict[str, Any]]:
    """Read the transcript's whole lines; a power cut may have torn the last one."""
    path = folder / TRANSCRIPT
    for line in path.read_bytes().split(b"\n") if path.exists() else []:
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if isinstance(entry, dict):
            yield entry


def _intact(folder: Path, entry: dict[str, Any]) -> bool:
    try:
        pixels = read_image(folder / entry["file"])
        return zlib.crc32(pixels.tobytes()) == entry["crc"] and isinstance(entry["planned"], int) and "bits" in entry
    except (InputError, KeyError, TypeError):
        return False


def _numbers(folder: Path) -> int:
    """The first number that no file of the folder has had."""
    used = [int(p.stem[5:]) for p in folder.glob("shot-*.png") if p.stem[5:].isdigit()]
    return max(used, default=-1) + 1


def _wall() -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%S%z")


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn what the operating system says about a write into an error that says what to do."""
    try:
        yield
    except OSError as error:
        raise StripeError(
            path,
            f"cannot be written ({error.strerror})",
            "make room on the disk and start the capture again: it goes on",
        ) from error
