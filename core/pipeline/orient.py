"""Beside the road: has the rig moved since its calibration? From any one capture with columns and rows."""

from __future__ import annotations

import hashlib
from pathlib import Path

from core.errors import InputError
from core.geometry import pair_of
from core.model import Figures, Pair, PhotogrammetricCalibration, Project, RigMotion
from core.pipeline.calibrate import load_calibrations
from core.pipeline.decode import decode_images
from core.pipeline.folders import find_capture, result_path
from core.progress import SILENT, Progress
from core.project import iterate_images, load_archive, save_archive


def orient_capture(
    project: Project, name: str, *, correct: bool = False, significance: float = 1e-3, progress: Progress = SILENT
) -> RigMotion:
    """Say whether the projector still stands where the calibration put it, by one capture.

    Parameters
    ----------
    project : Project
    name : str
        The capture: its name, or its folder.
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
    calibration = _calibration(project)
    capture = find_capture(project, name)
    phase = decode_images(capture, list(iterate_images(capture, project.camera)), project, progress.part(0.0, 0.3))
    options = OrientOptions(significance=significance)
    motion = find_motion(phase, calibration, capture=capture.name, options=options, progress=progress.part(0.3, 1.0))
    if correct:
        save_archive(_kept(project, capture.name), (motion, _signature(calibration)))
    return motion


def oriented(project: Project, capture: str, calibration: PhotogrammetricCalibration) -> Pair:
    """Give camera and projector of a calibration with the projector where a kept result of this capture has it.

    Raises
    ------
    InputError
        If no corrected orientation is kept for the capture, or it belongs to another calibration.
    """
    from core.orient import corrected_pair

    path = _kept(project, capture)
    again = f"run `stripe-core orient {project.path} {capture} --correct` first"
    if not path.exists():
        raise InputError(path, "no corrected orientation is kept for this capture", again)
    motion, signature = load_archive(path, tuple)
    if signature != _signature(calibration):
        raise InputError(path, "was found with another calibration", again)
    return corrected_pair(pair_of(calibration), motion)


def motion_figures(motion: RigMotion) -> Figures:
    """What `orient --json` writes."""
    sigma = motion.covariance.diagonal() ** 0.5
    return {
        "capture": motion.capture,
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

    if not motion.moved:
        return [f"{motion.capture}: no sign that the rig has moved (p = {motion.p:.2g}, {motion.pixels} pixels)"]
    return [
        f"{motion.capture}: the projector has moved against the camera (p = {motion.p:.2g}, {motion.pixels} pixels)",
        f"turned, µrad: {three('rotation_urad', 'sigma_urad')}",
        f"shifted across the base, µm: {three('shift_mm', 'sigma_mm', 1e3)}",
        f"depth changes by {motion.depth_change_mm:+.3f} ± {motion.depth_sigma_mm:.3f} mm (median over the pixels)",
        f"shape is corrected; not seen: {', '.join(motion.unobserved)}, so scale and distance are not",
    ]


def _calibration(project: Project) -> PhotogrammetricCalibration:
    found = load_calibrations(project).get("photogrammetric")
    if not isinstance(found, PhotogrammetricCalibration):
        raise InputError(
            project.path,
            "no photogrammetric calibration",
            "run `stripe-core calibrate --method photogrammetric` on it first",
        )
    return found


def _signature(calibration: PhotogrammetricCalibration) -> str:
    """What tells one calibration from another: its orientation's digits."""
    pair = pair_of(calibration)
    pose, interiors = pair.projector_from_camera, (pair.camera.interior.vector, pair.projector.interior.vector)
    return hashlib.sha256(b"".join(a.tobytes() for a in (pose.rotation, pose.translation_mm, *interiors))).hexdigest()


def _kept(project: Project, capture: str) -> Path:
    return result_path(project, "orientations") / f"{capture}.npz"
