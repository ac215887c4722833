"""Beside the road: has the rig moved since its calibration? From any one capture with columns and rows."""

from __future__ import annotations

import hashlib
from pathlib import Path

from core.errors import InputError
from core.geometry import pair_for
from core.model import Capture, Figures, Pair, PhotogrammetricCalibration, Project, RigMotion
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.decode import decode_images, one_series
from core.pipeline.folders import find_capture, result_path
from core.progress import SILENT, Progress
from core.project import iterate_images, load_archive, save_archive


def orient_capture(
    project: Project,
    name: str,
    *,
    camera: str = "",
    projector: str = "",
    correct: bool = False,
    significance: float = 1e-3,
    progress: Progress = SILENT,
) -> RigMotion:
    """Say whether the projector still stands where the calibration put it, by one capture.

    Parameters
    ----------
    project : Project
    name : str
        The capture: its name, or its folder.
    camera, projector : str
        Which pair, where the capture holds frames of several.
    correct : bool
        Keep the corrected orientation, for `reconstruct_capture(..., orient=True)`. The calibration stays as it is.
    significance : float
        Share of captures of an unmoved rig that may be called moved.
    progress : Progress

    Raises
    ------
    InputError
        If there is no photogrammetric calibration, or too few pixels have both projector coordinates.
    """
    from core.orient import OrientOptions, find_motion

    if not 0 < significance < 1:
        raise InputError("the significance", f"is {significance:g}", "give a share between 0 and 1, such as 0.001")
    calibration = photogrammetric_calibration(project)
    capture = one_series(find_capture(project, name), camera, projector)
    images = list(iterate_images(capture, project.rig.cameras[capture.camera]))
    phase = decode_images(capture, images, project, progress.part(0.0, 0.3))
    options = OrientOptions(significance=significance)
    motion = find_motion(phase, calibration, capture=capture.name, options=options, progress=progress.part(0.3, 1.0))
    if correct:
        save_archive(_kept(project, capture), (motion, _signature(pair_for(capture, calibration))))
    return motion


def orient_pairs(
    project: Project,
    name: str,
    *,
    camera: str = "",
    projector: str = "",
    correct: bool = False,
    significance: float = 1e-3,
    progress: Progress = SILENT,
) -> list[RigMotion]:
    """Say it of every camera and projector of a capture, or of those named; for the rest see `orient_capture`."""
    capture = find_capture(project, name)
    pairs = [pair for pair in capture.pairs if camera in ("", pair[0]) and projector in ("", pair[1])]
    if not pairs:
        one_series(capture, camera, projector)
    return [
        orient_capture(
            project,
            name,
            camera=pair[0],
            projector=pair[1],
            correct=correct,
            significance=significance / len(pairs),
            progress=progress.part(i / len(pairs), (i + 1) / len(pairs)),
        )
        for i, pair in enumerate(pairs)
    ]


def oriented(project: Project, capture: Capture, calibration: PhotogrammetricCalibration) -> Pair:
    """Give camera and projector of a calibration with the projector where a kept result of this capture has it.

    Raises
    ------
    InputError
        If no corrected orientation is kept for the capture, or it belongs to another calibration.
    """
    from core.orient import corrected_pair

    path, pair = _kept(project, capture), pair_for(capture, calibration)
    again = f"run `stripe-core orient {project.path} {capture.name} --correct` first"
    if not path.exists():
        raise InputError(path, "no corrected orientation is kept for this capture", again)
    motion, signature = load_archive(path, tuple)
    if signature != _signature(pair):
        raise InputError(path, "was found with another calibration", again)
    return corrected_pair(pair, motion)


def motions_figures(motions: list[RigMotion]) -> Figures:
    """What `orient --json` writes: of one pair its figures, of several those of each under "pairs".

    The p of all together is the least of them times their number (Bonferroni).
    """
    if len(motions) == 1:
        return motion_figures(motions[0])
    return {
        "capture": motions[0].capture,
        "moved": any(motion.moved for motion in motions),
        "p": min(1.0, len(motions) * min(motion.p for motion in motions)),
        "pairs": {f"{motion.camera}-{motion.projector}": motion_figures(motion) for motion in motions},
    }


def motion_figures(motion: RigMotion) -> Figures:
    """Give the figures of one pair."""
    sigma = motion.covariance.diagonal() ** 0.5
    return {
        "capture": motion.capture,
        "camera": motion.camera,
        "projector": motion.projector,
        "moved": motion.moved,
        "p": motion.p,
        "rotation_urad": [float(x) for x in 1e6 * motion.rotation_rad],
        "sigma_urad": [float(x) for x in 1e6 * sigma[:3]],
        "shift_mm": [float(x) for x in motion.shift_mm],
        "sigma_mm": [float(x) for x in sigma[3:]],
        "unobserved": list(motion.unobserved),
        "depth_change_mm": motion.depth_change_mm,
        "depth_sigma_mm": motion.depth_sigma_mm,
        "pixels": motion.pixels,
        "residual_rms": motion.residual_rms,
        "corrected_rms": motion.corrected_rms,
    }


def motion_words(motion: RigMotion) -> list[str]:
    """The same in sentences for people."""
    figures = motion_figures(motion)

    def three(key: str, sigma: str, scale: float = 1.0) -> str:
        return ", ".join(
            f"{axis} {scale * value:+.1f} ± {scale * s:.1f}"
            for axis, value, s in zip("XYZ", figures[key], figures[sigma], strict=True)
        )

    sure = f"p = {motion.p:.2g}, {motion.pixels} pixels"
    projector = "the projector" if motion.projector == "projector" else motion.projector
    camera = "the camera" if motion.camera == "camera" else motion.camera
    if not motion.moved:
        return [f"{motion.capture}: no sign that {projector} has moved against {camera} ({sure})"]
    return [
        f"{motion.capture}: {projector} has moved against {camera} ({sure})",
        f"turned, µrad: {three('rotation_urad', 'sigma_urad')}",
        f"shifted across the base, µm: {three('shift_mm', 'sigma_mm', 1e3)}",
        f"depth changes by {motion.depth_change_mm:+.3f} ± {motion.depth_sigma_mm:.3f} mm (median over the pixels)",
        f"shape is corrected; not seen: {', '.join(motion.unobserved)}, so scale and distance are not",
    ]


def _signature(pair: Pair) -> str:
    """What tells one calibration from another: the digits of its orientation and interiors."""
    pose, interiors = pair.projector_from_camera, (pair.camera.interior.vector, pair.projector.interior.vector)
    return hashlib.sha256(b"".join(a.tobytes() for a in (pose.rotation, pose.translation_mm, *interiors))).hexdigest()


def _kept(project: Project, capture: Capture) -> Path:
    of = "" if project.rig.is_pair else f".{capture.camera}-{capture.projector}"
    return result_path(project, "orientations") / f"{capture.name}{of}.npz"
