"""Stage 5 for several captures of one object, the rig or the object having been moved: one cloud in one frame."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Literal

import numpy as np

from core.digits import fixed
from core.errors import InputError
from core.figures import picked, verdict_figures
from core.geometry import pair_of, rotation_vector_from_matrix
from core.lazy import dataclass
from core.model import (
    Capture,
    Figures,
    Floats,
    PhaseMap,
    PhotogrammetricCalibration,
    PointCloud,
    Project,
    Registration,
    TargetSet,
)
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.decode import phase_maps
from core.pipeline.evidence import because_of, points_of, shared_frames
from core.pipeline.folders import find_capture, result_path
from core.pipeline.judge import judge_points, said_of
from core.pipeline.measure import boards_of, measured_targets
from core.pipeline.orient import signature_of
from core.progress import SILENT, Progress
from core.project import load_archive, save_archive

KEPT = "merged.npz"


@dataclass(frozen=True)
class Merged:
    """Points of several captures in the frame of the first one's camera.

    `cloud` (1, n, 3) has `source`, positions in `sources`: the cameras and captures by which it has a point. `image`
    (1, n) are their grey values, `pose_sigmas` (k-1, 6) those of the registration with the calibration's part.
    """

    cloud: PointCloud
    image: Floats
    sources: tuple[tuple[str, str], ...]
    registration: Registration
    pose_sigmas: np.ndarray


def merge_captures(
    project: Project,
    names: Sequence[str],
    *,
    by: Literal["both", "targets", "surface"] = "both",
    progress: Progress = SILENT,
) -> Merged:
    """Register at least two captures of one object, and join their points in the frame of the first one's camera.

    Parameters
    ----------
    by : {"both", "targets", "surface"}
        What tells how the rig stood: targets of a testfield that the captures name, the surface, or all there is.

    Raises
    ------
    InputError
        If the captures lack a common camera and projector, or do not tell how they stand to each other.
    """
    from core.orient import View, apart, register, starts_of
    from core.reconstruct import at_stations, joined, reconstruct

    if len(set(names)) < 2:
        raise InputError("merge", f"{len(set(names))} capture", "name at least two captures of one object")
    calibration = photogrammetric_calibration(project)
    captures = [find_capture(project, name) for name in dict.fromkeys(names)]
    pair = _common(captures, calibration)
    phases = _phases(project, captures, calibration, progress.part(0.0, 0.5))
    views = []
    for capture, seen in zip(captures, phases, strict=True):
        phase = next(p for p in seen if (p.camera, p.projector) == pair)
        with points_of(capture, seen):
            views.append(View(phase, reconstruct(phase, calibration), name=capture.name))
    shared = shared_frames(project, captures)
    said = {c.name: (*shared[c.name], *said_of(c, seen, calibration)) for c, seen in zip(captures, phases, strict=True)}
    targets = {t.capture: t for t in _targets(project, captures) if (t.camera, t.projector) == pair}
    views = [replace(view, targets=targets.get(view.name)) for view in views]
    with because_of(said):
        starts = starts_of(views, calibration, progress.part(0.5, 0.6))
        found = register(views, calibration, starts, by=by, progress=progress.part(0.6, 0.8))
    for name, (off, sigma) in (apart(views, calibration, found) if by != "surface" else {}).items():
        text = (
            f"by its targets it stands {off:.2g} ± {sigma:.1g} mm from where its surface has it: the object moved "
            "against its board, or bends; fix it there, or merge by the surface"
        )
        said[name] = (*said[name], text)
    everywhere = at_stations(calibration, found, pair[0])
    cloud, image, sources = joined(phases, [capture.name for capture in captures], everywhere, progress.part(0.8, 1.0))
    cloud = judge_points(cloud, said, "photogrammetric", calibration)
    sigmas = found.sigmas(calibration.covariance)
    with suppress(InputError):  # the project may only be read
        save_archive(result_path(project, KEPT), (found, sigmas, signature_of(pair_of(calibration, *pair))))
    return Merged(cloud, image, sources, found, sigmas)


def kept_registration(
    project: Project, calibration: PhotogrammetricCalibration
) -> tuple[Registration, np.ndarray] | None:
    """Give the poses that captures were merged by last, and their sigmas, if it was by this calibration."""
    path = result_path(project, KEPT)
    with suppress(InputError):
        if path.exists():
            found, sigmas, signature = load_archive(path, tuple)
            if any(
                signature == signature_of(pair_of(calibration, camera, projector))
                for camera in calibration.cameras
                for projector in calibration.projectors
            ):
                return found, sigmas
    return None


def _targets(project: Project, captures: Sequence[Capture]) -> list[TargetSet]:
    """Targets of the captures that name a board; those of the calibration help to tell which way round it lies."""
    boards = [c for c in captures if c.testfield is not None]
    if len(boards) < 2:
        return []
    named = {c.path for c in boards}
    with suppress(InputError):  # then the surface may do
        return measured_targets(project, [*boards, *(c for c in boards_of(project) if c.path not in named)])
    return []


def _common(captures: Sequence[Capture], calibration: PhotogrammetricCalibration) -> tuple[str, str]:
    for pair in captures[0].pairs:
        if set(pair) <= set(calibration.devices) and all(pair in capture.pairs for capture in captures):
            return pair
    told = ", ".join(capture.name for capture in captures)
    raise InputError(told, "were not taken by one calibrated camera and projector", "merge captures by the same pair")


def _phases(
    project: Project, captures: Sequence[Capture], calibration: PhotogrammetricCalibration, progress: Progress
) -> list[list[PhaseMap]]:
    """Phase maps of every capture by the devices that the calibration knows."""
    found: dict[str, list[PhaseMap]] = {capture.name: [] for capture in captures}
    for capture, phase in phase_maps(project, captures, progress):
        if {phase.camera, phase.projector} <= set(calibration.devices):
            found[capture.name].append(phase)
    return list(found.values())


def merge_figures(merged: Merged) -> Figures:
    """What `merge --json` writes."""
    found = merged.registration
    counts = (
        np.bincount(merged.cloud.source.ravel(), minlength=len(merged.sources))
        if merged.cloud.source is not None
        else ()
    )
    return {
        "points": int(merged.cloud.xyz_mm.shape[1]),
        "sources": [
            {"camera": camera, "capture": capture, "points": int(n)}
            for (camera, capture), n in zip(merged.sources, counts, strict=True)
        ],
        "views": [
            {
                "capture": name,
                "rotation": pose.rotation.tolist(),
                "translation_mm": pose.translation_mm.tolist(),
                "sigma_rotation_urad": (1e6 * sigma[:3]).tolist(),
                "sigma_translation_mm": sigma[3:].tolist(),
            }
            for name, pose, sigma in zip(found.captures[1:], found.poses[1:], merged.pose_sigmas, strict=True)
        ],
        "overlaps": [picked(o, "captures kind number misfit") for o in found.overlaps],
        "verdict": verdict_figures(merged.cloud.verdict),
    }


def merge_words(merged: Merged) -> list[str]:
    """The same in lines."""
    found, told = merged.registration, []
    for name, pose, sigma in zip(found.captures[1:], found.poses[1:], merged.pose_sigmas, strict=True):
        turn = np.degrees(np.linalg.norm(rotation_vector_from_matrix(pose.rotation)))
        shift = fixed(float(np.linalg.norm(sigma[3:])), 3)
        mrad = 1e3 * np.linalg.norm(sigma[:3])
        told.append(f"{name}: turned {turn:.2f}° against {found.captures[0]}, sigma {mrad:.2f} mrad and {shift} mm")
    for o in found.overlaps:
        told.append(f"{' and '.join(o.captures)}: {o.number} {o.kind} in common, misfit {o.misfit:.2f} of their noise")
    return told
