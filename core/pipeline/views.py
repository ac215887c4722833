"""Stage 5 for captures by several devices: points from all that saw them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from core.errors import InputError
from core.model import Capture, Figures, Floats, PhaseMap, PhotogrammetricCalibration, PointCloud, Project
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.decode import phase_maps
from core.pipeline.evidence import points_of, shared_frames
from core.pipeline.folders import find_capture
from core.pipeline.judge import judge_points, said_of
from core.pipeline.methods import METHODS
from core.pipeline.orient_rig import oriented_together
from core.pipeline.runs import current_runs
from core.progress import SILENT, Progress
from core.project import iterate_images


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
    fill: bool = False,
    orient: bool = False,
    progress: Progress = SILENT,
) -> tuple[Floats, PointCloud]:
    """Reconstruct a capture by the photogrammetric calibration from all cameras and projectors, or cameras alone.

    Also gives the points' grey values, (H, W) or (1, n). The cloud has `sight`; filled, also the number of pixels that
    the object takes in the (first) camera's image.

    Parameters
    ----------
    camera : str
        Give this camera's points in its raster and frame; unsaid, those of all cameras, each once, in the frame of the
        first one.
    rays : {"all", "cameras"}
    fill : bool
        Where nothing was decoded, match the texture that two cameras see.
    orient : bool
        With all devices where `correct_together` found them.
    """
    from core.reconstruct import fill_by_texture, merged

    calibration = photogrammetric_calibration(project)
    capture = find_capture(project, name)
    if orient:
        calibration = oriented_together(project, capture, calibration)
    phases = [phase for _, phase in phase_maps(project, [capture], progress.part(0.0, 0.5))]
    with points_of(capture, phases):
        clouds = joint_clouds(
            phases, calibration, camera="" if fill else camera, rays=rays, progress=progress.part(0.5, 0.8)
        )
    if not clouds:
        seen = f"has no {camera or 'pair of cameras and projectors'} of the capture"
        raise InputError("calibration", seen, f"it knows {', '.join(calibration.devices)}")
    if fill:
        first = camera or next(iter(clouds))
        means = {name: _mean_image(project, capture, name) for name in clouds}
        others = {name: cloud for name, cloud in clouds.items() if name != first}
        clouds[first] = fill_by_texture(
            clouds[first], others, means, calibration, first, progress=progress.part(0.8, 1.0)
        )
    images = {phase.camera: phase.image for phase in phases}
    cloud, image = (clouds[camera], images[camera]) if camera else merged(clouds, images, calibration)
    shared = shared_frames(project, [capture])[capture.name]
    said = (*shared, *said_of(capture, intersectable(phases, calibration), calibration, rays))
    return image, judge_points(cloud, {capture.name: said}, "photogrammetric", calibration)


def coverage(cloud: PointCloud) -> Figures:
    """Share of the object that has points in the first camera: by code, and filled; empty if none was filled."""
    from core.reconstruct import Sight

    if cloud.object_px is None or cloud.sight is None:
        return {}
    sight = cloud.sight if cloud.source is None else cloud.sight[cloud.source == 0]
    coded, matched = (
        int(np.count_nonzero(w)) for w in ((sight != Sight.NONE) & (sight != Sight.TEXTURE), sight == Sight.TEXTURE)
    )
    whole = cloud.object_px
    return {"object_px": whole, "by_code": coded / whole, "filled": (coded + matched) / whole}


def _mean_image(project: Project, capture: Capture, camera: str) -> Floats:
    """Mean of all frames of a camera, NaN where half of them are saturated: in a shadow all are alike."""
    from core.decode import DecodeOptions
    from core.decode.chosen import take_sample
    from core.decode.sample import full_scale

    spec = project.rig.cameras[camera]
    images = [image for s in capture.series if s.camera == camera for image in iterate_images(s, spec)]
    full = full_scale(images, tuple(range(len(images))), take_sample(images), DecodeOptions())
    total: Any = sum(image.astype(np.float32) for image in images)
    burnt: Any = sum(image >= full for image in images)
    return np.where(burnt > len(images) / 2, np.float32(np.nan), total / len(images)).astype(np.float32)


def intersectable(phases: Sequence[PhaseMap], calibration: PhotogrammetricCalibration) -> list[PhaseMap]:
    """Choose the phase maps of calibrated devices; of calibrated cameras, where none of their projectors is."""
    seen = [phase for phase in phases if phase.camera in calibration.devices]
    return [phase for phase in seen if phase.projector in calibration.devices] or seen


def joint_clouds(
    phases: Sequence[PhaseMap],
    calibration: PhotogrammetricCalibration,
    *,
    camera: str = "",
    rays: Literal["all", "cameras"] = "all",
    progress: Progress = SILENT,
) -> dict[str, PointCloud]:
    """Points of one capture from all that saw them, by camera, in the raster of each or of the one named.

    A camera whose only axis tells no points has none; NoCoordinateError if there is no other.
    """
    from core.reconstruct import intersect_each

    known = intersectable(phases, calibration)
    wanted = [name for name in dict.fromkeys(phase.camera for phase in known) if camera in ("", name)]
    return intersect_each(known, calibration, wanted, rays=rays, progress=progress)
