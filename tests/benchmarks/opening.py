"""Opening projects of many captures: project.json, every capture.json with its checks, and the state of every stage."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from core.model import DeviceSpec, Subject
from core.patterns import reference_sequence
from core.pipeline.state.graph import Graph
from core.project import read_capture, read_project, write_image, write_project
from core.project.captures import write_capture_json
from tests.benchmarks.timing import Contestant, Row, race


def run() -> list[Row]:
    """Projects of 200 and 2,000 captures with 28 frames each; the frames are links to one tiny image."""
    rows = []
    for count in (200, 2000):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            _write(folder, count)
            opening = Contestant("stripe workbench", lambda f=folder: _open(f), lambda n, c=count: _all(n, c))
            listing = Contestant("project.json alone", lambda f=folder: len(read_project(f).captures))
            rows += race("opening", f"{count} captures", count, "captures", [opening, listing])
    return rows


def _write(folder: Path, count: int) -> None:
    frames = [(f"{i:03d}.png", pattern) for i, pattern in enumerate(reference_sequence())]
    for i in range(len(frames)):
        write_image(folder / "captures" / "000" / f"{i:03d}.png", np.zeros((4, 4), np.uint8), durable=False)
    text = None
    for k in range(count):
        place = folder / "captures" / f"{k:03d}"
        if text is None:
            write_capture_json(place, Subject("plane", angle_deg=0.0), frames)
            text = (place / "capture.json").read_bytes()
        else:
            place.mkdir()
            (place / "capture.json").write_bytes(text)
            for name, _ in frames:
                os.link(folder / "captures" / "000" / name, place / name)
    spec = DeviceSpec(4, 4, (0.01, 0.01), 12.0)
    (folder / "results").mkdir()  # of a project that was worked on: every frame is compared with what it was
    write_project(folder, "many", spec, spec, captures=[f"captures/{k:03d}" for k in range(count)])


def _open(folder: Path) -> int:
    project = read_project(folder)
    captures = {path: read_capture(path, project) for path in project.captures}
    states = Graph(project, captures).states()
    assert all(of["decode"].state == "absent" for of in states.captures.values())
    return sum(len(capture.frames) == 28 for capture in captures.values())


def _all(found: int, expected: int) -> str:
    assert found == expected
    return f"{found} captures read"
