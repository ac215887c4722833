"""Captures written for tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from core.model import Seed, Subject
from core.patterns import Pattern
from core.project import write_image, write_picks
from core.project.captures import write_capture_json
from core.project.images import Image


def write_capture(
    folder: Path, subject: Subject, frames: Sequence[tuple[Pattern, Image]], seeds: Sequence[Seed] = ()
) -> None:
    for i, (_, image) in enumerate(frames):
        write_image(folder / f"{i:03d}.png", image)
    if seeds:
        write_picks(folder / "picks.json", seeds)
    write_capture_json(folder, subject, [(f"{i:03d}.png", pattern) for i, (pattern, _) in enumerate(frames)])
