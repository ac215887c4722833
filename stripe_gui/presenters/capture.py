"""The captures of a project in words, and one frame of them as an image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Capture, Rig
from core.patterns import Pattern, describe
from core.pipeline.picking import lit_frame_of
from core.progress import SILENT, Progress
from core.project import read_image
from stripe_gui.presenters.folder import CaptureEntry
from stripe_gui.presenters.told import sentence, signed, told, translate


@dataclass(frozen=True)
class CaptureRow:
    """A capture in a list; `problem` says why it cannot be used, empty if it can."""

    name: str
    role: str
    summary: str
    problem: str = ""


@dataclass(frozen=True)
class FrameView:
    """One frame, ready to be shown between 0 and `white` grey values, or up to `bright`, its 99.5th percentile."""

    image: NDArray
    white: float
    bright: float
    clipped_percent: float
    mean: float


def role_name(role: str) -> str:
    """Give a role in the operator's language."""
    return {
        "testfield": translate("Capture", "testfield"),
        "depth": translate("Capture", "plate at a depth"),
        "plane": translate("Capture", "plane-table"),
        "object": translate("Capture", "object"),
    }.get(role, role)


def capture_row(entry: CaptureEntry) -> CaptureRow:
    """Describe a capture of a project."""
    capture = entry.capture
    if capture is None:
        return CaptureRow(entry.name, "", translate("Capture", "cannot be read"), str(entry.error))
    parts = [role_name(capture.role)]
    if capture.z_mm is not None:
        parts.append(signed(capture.z_mm, " mm"))
    if capture.angle_deg is not None:
        parts.append(signed(capture.angle_deg, "°"))
    if capture.seeds and capture.role == "testfield":
        parts.append(translate("Capture", "{n} picks").format(n=len(capture.seeds)))
    return CaptureRow(entry.name, capture.role, ", ".join(parts))


def rig_lines(rig: Rig) -> list[str]:
    """Name every camera and projector of a rig in a line each."""
    camera = translate("Capture", "camera, {w} × {h} px, {c:g} mm")
    projector = translate("Capture", "projector, {w} × {h} lines, {c:g} mm")
    lines = []
    for kind, text, devices in (("camera", camera, rig.cameras), ("projector", projector, rig.projectors)):
        for name, spec in devices.items():
            said = text.format(w=spec.width, h=spec.height, c=spec.nominal_c_mm)
            lines.append(sentence(said) if name == kind else f"{name}: {said}")
    return lines


def pattern_text(pattern: Pattern) -> str:
    """Say in a few words what the projector showed."""
    return told(describe(pattern))


def lit_frame(capture: Capture, progress: Progress = SILENT) -> FrameView:
    """Read the frame in which the board is lit evenly: the white one, else the first."""
    return load_frame(capture.frames[lit_frame_of(capture)].path, progress)


def load_frame(path: Path, progress: Progress = SILENT) -> FrameView:
    """Read one frame and what the operator wants to know about it.

    The white level is the least full scale of 8, 10, 12, 14 or 16 bit that holds the brightest pixel; clipped pixels
    have the very value of that full scale.
    """
    progress.check()
    image = read_image(path)
    top = int(image.max())
    white = next(2**bits - 1 for bits in (8, 10, 12, 14, 16) if top < 2**bits)
    clipped = float(np.mean(image == white)) * 100
    bright = float(np.percentile(image, 99.5))
    return FrameView(image, float(white), max(bright, 1.0), clipped, float(image.mean()))
