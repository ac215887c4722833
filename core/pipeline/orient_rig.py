"""All devices of a capture corrected together: what is kept of it, and what is said."""

from __future__ import annotations

from pathlib import Path

from core.errors import listed
from core.model import Capture, Figures, PhotogrammetricCalibration, Project, RigCorrection
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.folders import find_capture, result_path
from core.pipeline.orient import Look, kept_correction, signature_of, still_used
from core.pipeline.state.inputs import decoded_from
from core.progress import SILENT, Progress
from core.project import save_archive
from core.project.contents import hash_value

TOGETHER = ".all.npz"  # what the names of these results end in


def are_together(project: Project, name: str) -> bool:
    """Whether three calibrated devices took part in a capture, which `correct_together` corrects."""
    return bool(_together(Look(project, find_capture(project, name), photogrammetric_calibration(project))))


def correct_together(project: Project, name: str, progress: Progress = SILENT) -> RigCorrection | None:
    """Correct and keep the orientations of all devices of a capture; None if it has not three that are calibrated.

    TooLittleSeenError if no two have enough pixels with both coordinates.
    """
    from core.orient import correct_rig

    calibration = photogrammetric_calibration(project)
    look = Look(project, find_capture(project, name), calibration)
    if not (pairs := _together(look)):
        return None
    parts = zip(pairs, progress.part(0.0, 0.5).parts(len(pairs)), strict=True)
    kept = _kept(project, look.capture)
    with still_used(kept, lambda: _signature(project, look.capture, calibration)):
        seen = {pair: look.phase(look.series(*pair), part) for pair, part in parts}
        found = correct_rig(seen, calibration, capture=look.capture.name, progress=progress.part(0.5, 1.0))
    save_archive(kept, (found, _signature(project, look.capture, calibration)))
    return found


def oriented_together(
    project: Project, capture: Capture, calibration: PhotogrammetricCalibration
) -> PhotogrammetricCalibration:
    """Give a calibration with all devices where a kept result of this capture has them.

    InputError if none is kept for the capture, or it is of another calibration or other frames.
    """
    sign = _signature(project, capture, calibration)
    found = kept_correction(project, capture, _kept(project, capture), sign, "orientation of all devices")
    corrected: PhotogrammetricCalibration = found.calibration
    return corrected


def together_words(found: RigCorrection) -> list[str]:
    """Say how the devices have moved."""
    base = next(iter(found.calibration.orientations.values())).base
    shown, pairs = [*dict.fromkeys(name for pair in found.pairs for name in pair)], len(found.pairs)
    lines = [f"{found.capture}: {listed(shown)} together, against {base}, by {pairs} pair{'s' * (pairs > 1)}"]
    if base not in shown:
        lines.append(
            f"{base} shows nothing: how all of them stand to it is known by the calibration and likely drifts alone"
        )
    figures = together_figures(found)

    def three(name: str, key: str, sigma: str, scale: float = 1.0) -> str:
        each = zip("XYZ", figures[name][key], figures[name][sigma], strict=True)
        return ", ".join(f"{axis} {scale * value:+.1f} ± {scale * s:.1f}" for axis, value, s in each)

    for name in found.devices:
        turned, shifted = three(name, "rotation_urad", "sigma_urad"), three(name, "shift_mm", "sigma_mm", 1e3)
        lines.append(f"{name}: turned, µrad: {turned}; shifted, µm: {shifted}")
    return [*lines, "shape corrected, scale not: the size of the whole rig and c cannot be seen"]


def together_figures(found: RigCorrection) -> Figures:
    """What `orient --correct --json` writes of all devices."""
    return {
        name: {
            "rotation_urad": (1e6 * found.rotation_rad[i]).tolist(),
            "sigma_urad": (1e6 * found.sigma[i, :3]).tolist(),
            "shift_mm": found.shift_mm[i].tolist(),
            "sigma_mm": found.sigma[i, 3:].tolist(),
        }
        for i, name in enumerate(found.devices)
    }


def _together(look: Look) -> list[tuple[str, str]]:
    """Pairs of calibrated devices, if these are three or more."""
    pairs = [pair for pair in look.pairs if set(pair) <= set(look.calibration.devices)]
    return pairs if len({device for pair in pairs for device in pair}) > 2 else []


def _signature(project: Project, capture: Capture, calibration: PhotogrammetricCalibration) -> str:
    frames = [decoded_from(project, each) for each in capture.series]
    return hash_value([signature_of(calibration), frames])


def _kept(project: Project, capture: Capture) -> Path:
    return result_path(project, "orientations") / f"{capture.name}{TOGETHER}"
