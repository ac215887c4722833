"""A capture that was interrupted: what its transcript says has been taken and verified."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from core.errors import InputError
from core.lazy import dataclass
from core.project.images import read_image

TRANSCRIPT = "transcript.jsonl"


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


def unfinished_status(folder: Path, planned: int) -> Status:
    """Tell from the transcript which of the planned frames are there and whole."""
    before = next((int(e["guards"]) for e in transcript(folder) if "guards" in e), 0)
    have = {shot - before for shot in intact_shots(folder)}
    missing = tuple(i for i in range(planned) if i not in have)
    return Status("taking", planned, planned - len(missing), missing)


def transcript(folder: Path) -> Iterator[dict[str, Any]]:
    """Read the transcript's whole lines; a power cut may have torn the last one."""
    path = folder / TRANSCRIPT
    for line in path.read_bytes().split(b"\n") if path.exists() else []:
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if isinstance(entry, dict):
            yield entry


def intact_shots(folder: Path) -> dict[int, dict[str, Any]]:
    """Give the transcript's entries, by planned shot, of the frames that are on the disk as they were written."""
    shots: dict[int, dict[str, Any]] = {}
    for entry in transcript(folder):
        if entry.get("event") == "shot" and _is_intact(folder, entry):
            shots[entry["planned"]] = entry
        elif entry.get("event") == "rejected":
            shots.pop(entry.get("planned", -1), None)
    return shots


def _is_intact(folder: Path, entry: dict[str, Any]) -> bool:
    """Whether an entry's frame is there, and all that tells of it."""
    try:
        pixels = read_image(folder / entry["file"])
        return zlib.crc32(pixels.tobytes()) == entry["crc"] and isinstance(entry["planned"], int) and "bits" in entry
    except (InputError, KeyError, TypeError, ValueError):
        return False
