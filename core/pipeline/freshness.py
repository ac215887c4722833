"""Whether something was computed from what is there now: a short text that changes with everything it was made from.

Files count by name, size and time of writing, what was read from them by its content. Sources and version of the
program count too, so that an update computes anew.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields
from functools import cache
from importlib.metadata import version
from pathlib import Path

import core
from core.model import Capture, Project


def made_from(project: Project, capture: Capture, *choices: object) -> str:
    """Sign all that the result for one capture follows from: frames, picks, board, rig, and choices made.

    Raises
    ------
    OSError
        If a frame has vanished.
    """
    digest = hashlib.sha256(f"{_program()} {capture.name} {project.camera} {project.projector} {choices}".encode())
    for field in fields(capture):
        if field.name not in ("path", "frames", "testfield"):
            digest.update(f"{field.name} {getattr(capture, field.name)}".encode())
    for frame in capture.frames:
        stat = frame.path.stat()
        digest.update(f"{frame.path.name} {frame.pattern} {stat.st_size} {stat.st_mtime_ns}".encode())
    if (board := capture.testfield) is not None:
        digest.update(board.polarity.encode())
        for values in (board.row, board.col, board.xyz_mm, board.diameter_mm):
            digest.update(values.tobytes())
    return digest.hexdigest()


@cache
def _program() -> str:
    digest = hashlib.sha256(version("stripe-workbench").encode())
    for path in sorted(Path(core.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
