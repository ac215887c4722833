"""Many captures: on copies of a process, as stages that need all decode them; in a stream, where memory stays flat."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from core.model import DeviceSpec, PhaseMap, Project, Subject
from core.patterns import reference_sequence
from core.pipeline import decode_capture
from core.pipeline.decode import decode_images, from_phase_maps, phase_maps
from core.progress import SILENT
from core.project import iterate_images, read_capture, read_project, write_image, write_project
from core.project.captures import write_capture_json
from tests.benchmarks.scenes import LINES, Frames, frames
from tests.benchmarks.timing import EFFORT, OURS, Contestant, Row, race

SIZE = 748, 576
COUNTS = (4, 12, 36)


def run() -> list[Row]:
    """Read and decode all captures of a project: by copies, in a stream, in turn, and all read before the first."""
    data = frames(reference_sequence(), *SIZE)
    rows = []
    for count in COUNTS[:1] if EFFORT.quick else COUNTS:
        with tempfile.TemporaryDirectory() as name:
            project = _project(Path(name), data, count)
            decode_capture(project.captures[0])  # the compiled kernels are loaded

            def right(last: PhaseMap) -> str:
                return _right(data, last)

            field = [
                Contestant(OURS, lambda p=project: _by_copies(p), right, warm=False),
                Contestant("a stream, the next one ahead", lambda p=project: _streamed(p), right, warm=False),
                Contestant("one capture after the other", lambda p=project: _in_turn(p), right, warm=False),
                Contestant("all read before the first", lambda p=project: _at_once(p), right, warm=False),
            ]
            rows += race("batch", f"{count} captures 748x576 x 28", count, "captures", field)
    return rows


def _project(folder: Path, data: Frames, count: int) -> Project:
    """Captures whose frames are the same files."""
    named = [(f"../000/{i:03d}.png", pattern) for i, pattern in enumerate(data.patterns)]
    for (file, _), image in zip(named, data.images, strict=True):
        write_image(folder / "captures/000" / Path(file).name, image, durable=False)
    for k in range(count):
        write_capture_json(folder / f"captures/{k:03d}", Subject("plane", angle_deg=0.0), named)
    camera = DeviceSpec(*SIZE, (0.008, 0.008), 12.0)
    projector = DeviceSpec(LINES, LINES, (0.09, 0.09), 182.0)
    write_project(folder, "batch", camera, projector, captures=[f"captures/{k:03d}" for k in range(count)])
    return read_project(folder)


def _by_copies(project: Project) -> PhaseMap:
    captures = [read_capture(path, project) for path in project.captures]
    for _, phase in from_phase_maps(project, captures, lambda capture, phase: phase):
        last = phase
    return last


def _streamed(project: Project) -> PhaseMap:
    for _, phase in phase_maps(project, (read_capture(path, project) for path in project.captures)):
        last = phase
    return last


def _in_turn(project: Project) -> PhaseMap:
    for path in project.captures:
        last = decode_capture(path)
    return last


def _at_once(project: Project) -> PhaseMap:
    captures = [read_capture(path, project) for path in project.captures]
    images = [list(iterate_images(capture)) for capture in captures]
    for capture, own in zip(captures, images, strict=True):
        last = decode_images(capture, own, project, SILENT)
    return last


def _right(data: Frames, last: PhaseMap) -> str:
    for found, true in ((last.u, data.u), (last.v, data.v)):
        valid = np.isfinite(found)
        wrong = np.mean(np.abs(found[valid] - true[valid]) > 1)
        assert valid.mean() > 0.75, f"only {valid.mean():.0%} decoded"
        assert wrong < 1e-3, f"{wrong:.1e} of the pixels are wrong"
    return f"{wrong:.0e} of the last capture's pixels wrong"
