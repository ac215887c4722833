"""Stage 5 for captures by several devices: points from all that saw them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from core.model import Floats, PhaseMap, PhotogrammetricCalibration, PointCloud, Project
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.decode import phase_maps
from core.pipeline.folders import find_capture
from core.pipeline.methods import METHODS
from core.pipeline.runs import current_runs
from core.progress import SILENT, Progress


def seen_by_several(project: Project, name: str) -> bool:
    """Whether several cameras or projectors took part in a capture, and a calibration in use knows them together."""
    several = len(find_capture(project, name).pairs) > 1
    return several and any(METHODS[method].joint for method in current_runs(project))


def reconstruct_views(
    project: Project,
    name: str,
    *,
    camera: str = "",
    rays: Literal["all", "cameras"] = "all",
    progress: Progress = SILENT,
) -> tuple[Floats, PointCloud]:
    """Reconstruct a capture by the photogrammetric calibration from all cameras and projectors, or cameras alone.

    Parameters
    ----------
    name : str
        The capture: its name, or its folder.
    camera : str
        Give this camera's points in its raster and frame; unsaid, those of all cameras, each once, in the frame of the
        first one.
    rays : {"all", "cameras"}

    Returns
    -------
    image : array, (H, W) or (1, n)
        Grey values of the points.
    cloud : PointCloud
        With `sight`.
    """
    from core.reconstruct import merged

    calibration = photogrammetric_calibration(project)
    capture = find_capture(project, name)
    phases = [phase for _, phase in phase_maps(project, [capture], progress.part(0.0, 0.5))]
    clouds = joint_clouds(phases, calibration, camera=camera, rays=rays, progress=progress.part(0.5, 1.0))
    images = {phase.camera: phase.image for phase in phases}
    if camera:
        return images[camera], clouds[camera]
    cloud, image = merged(clouds, images, calibration)
    return image, cloud


def joint_clouds(
    phases: Sequence[PhaseMap],
    calibration: PhotogrammetricCalibration,
    *,
    camera: str = "",
    rays: Literal["all", "cameras"] = "all",
    progress: Progress = SILENT,
) -> dict[str, PointCloud]:
    """Points of one capture from all that saw them, by camera, in the raster of each or of the one named."""
    from core.reconstruct import intersect_all

    known = [phase for phase in phases if {phase.camera, phase.projector} <= set(calibration.devices)]
    wanted = [camera] if camera else list(dict.fromkeys(phase.camera for phase in known))
    return {
        each: intersect_all(
            known, calibration, each, rays=rays, progress=progress.part(i / len(wanted), (i + 1) / len(wanted))
        )
        for i, each in enumerate(wanted)
    }
