"""The image in which a board is seen best."""

from __future__ import annotations

from core.model import Capture
from core.pipeline.guessing import lit_frame_of
from core.progress import SILENT, Progress
from stripe_gui.presenters.capture import FrameView, load_frame


def lit_frame(capture: Capture, progress: Progress = SILENT) -> FrameView:
    """Read the frame in which the board is lit evenly: the white one, else the first."""
    return load_frame(capture.frames[lit_frame_of(capture)].path, progress)
