"""Whether the rig still stands as it was calibrated, by one capture."""

from __future__ import annotations

from dataclasses import dataclass

from core.errors import InputError
from core.model import Capture, Project
from core.pipeline import motion_words, orient_capture
from core.progress import SILENT, Progress
from stripe_gui.presenters.told import sentence


@dataclass(frozen=True)
class Health:
    """What one capture says of the rig; `kind` is a notice's."""

    kind: str
    words: str
    more: str = ""


def health_of(project: Project, capture: Capture, progress: Progress = SILENT) -> Health:
    """Look whether projector and camera stand as they were calibrated, by the frames of one camera and projector.

    Nothing is kept: whoever looks at a capture changes no report.
    """
    camera, projector = capture.camera, capture.projector
    try:
        motion = orient_capture(
            project, capture.name, camera=camera, projector=projector, keep=False, progress=progress
        )
    except InputError as error:
        return Health("info", sentence(error.seen))
    first, *more = map(sentence, motion_words(motion))
    return Health("error" if motion.moved else "success", first, "\n".join(more))
