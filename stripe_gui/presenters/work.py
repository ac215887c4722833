"""What some stages' buttons run, over `core.pipeline`; others run its functions as they are."""

from __future__ import annotations

from pathlib import Path

from core import pipeline
from core.lazy import dataclass
from core.model import Capture, Method, PhaseMap, Project
from core.pipeline import METHODS, CalibrateOptions
from core.progress import SILENT, Progress


@dataclass(frozen=True)
class CalibrateChoice:
    """What the operator chose for a calibration."""

    method: Method = "all"
    options: CalibrateOptions = CalibrateOptions()


def chosen_methods(method: Method) -> list[Method]:
    """Give the methods that a choice means."""
    return list(METHODS) if method == "all" else [method]


def export_points(
    project: Project,
    capture: str,
    method: Method,
    out: Path,
    devices: dict[str, str],
    fill: bool = False,
    progress: Progress = SILENT,
) -> int:
    """Write the points of a capture for another program, by the name's ending; give their number."""
    pipeline.reconstruct.check_cloud(out, joined=not devices)
    if not devices:  # of all cameras
        image, cloud = pipeline.views.reconstruct_views(project, capture, fill=fill, progress=progress)
    else:
        phase, cloud = pipeline.reconstruct_capture(project, capture, method, progress=progress, **devices)  # type: ignore[arg-type]
        image = phase.image
    progress.check()
    return pipeline.reconstruct.write_cloud(out, image, cloud)


def merge_points(project: Project, names: list[str], out: Path, progress: Progress = SILENT) -> pipeline.merge.Merged:
    """Join captures of one object, and write their points for another program."""
    pipeline.reconstruct.check_cloud(out, joined=True)
    merged = pipeline.merge.merge_captures(project, names, progress=progress)
    pipeline.reconstruct.write_cloud(out, merged.image, merged.cloud)
    return merged


def decode_one(capture: Capture, progress: Progress = SILENT) -> PhaseMap:
    """Decode one capture, of one camera and one projector, for a look at it."""
    return pipeline.decode_capture(capture.path, progress, camera=capture.camera, projector=capture.projector)
