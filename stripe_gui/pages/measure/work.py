"""What is made ready while the operator looks at an image: frames, guesses and decoded maps, kept for a while."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.measure import kind_of
from core.model import Array, Capture, DeviceSpec, Project, Seed, Testfield
from core.pipeline.guessing import look_for_picks
from core.pipeline.measure import Side
from core.progress import SILENT, Progress
from stripe_gui.presenters.capture import FrameView, lit_frame
from stripe_gui.presenters.decode import recent_phases
from stripe_gui.presenters.folder import CaptureEntry, Recent, written_ns

FRAMES_KEPT = 6


@dataclass(frozen=True)
class Look:
    """An image, where its dots are, and the guesses of its picks, the likeliest first; None where not asked for."""

    frame: FrameView
    dots: Array
    guesses: tuple[tuple[Seed, ...], ...] | None


def look_at(
    capture: Capture,
    camera: DeviceSpec,
    neighbour: tuple[Seed, ...],
    side: Side,
    guess: bool,
    progress: Progress = SILENT,
) -> Look:
    """Read the evenly lit image of a capture, find its dots, and guess its picks if asked to."""
    frame = lit_frame(capture, progress)
    field = capture.testfield
    if field is None:
        return Look(frame, np.zeros((0, 2)), ())
    progress(0.3, capture.name)
    dots, guesses = look_for_picks(frame.image, capture, camera, neighbour, side)
    return Look(frame, dots, guesses if guess else None)


def snapped(image: NDArray, field: Testfield, at: tuple[float, float], reach_px: float) -> tuple[float, float] | None:
    """Give the centre of the target at or next to a position; one further than a 20th of the image is never meant."""
    return kind_of(field).nearest(image, field, at, min(reach_px, image.shape[1] / 20))


class Kept:
    """Frames and maps of the images worked on last."""

    def __init__(self) -> None:
        self.frames: Recent[FrameView] = Recent(FRAMES_KEPT, lambda _: 1)
        self.phases = recent_phases()


def boards(entries: list[CaptureEntry]) -> list[Capture]:
    """Give the captures in which targets can be picked."""
    return [e.capture for e in entries if e.capture is not None and e.capture.testfield is not None]


def signature(project: Project) -> tuple[object, ...]:
    """Tell whether kept targets or their captures may have changed."""
    return (written_ns(project.path / "results" / "targets.npz"), *project.rig.devices.items())
