"""All devices of a rig corrected together, by what every two of them show of one capture.

What two devices show (`RigMotion.shown`) is ``x = G (δ + E m) + noise``, of the calibration's errors δ and movements m
of the devices: a linear observation of all parameters of the rig, whose covariance and likely drifts are observations,
too. Two devices hardly tell turns from shifts, and do not show how long their base is; three that do not stand in one
line show the ratios of their bases, and each holds the others. What remains unseen is the size of the whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from core.errors import AdjustmentError, TooLittleSeenError
from core.geometry import changed, orientation_names, pair_derivatives, pair_of
from core.lazy import dataclass
from core.model import Array, PhaseMap, PhotogrammetricCalibration, RigCorrection, RigMotion
from core.orient.freedom import DEFAULT, OrientOptions, turns_and_shifts
from core.orient.motion import find_motion
from core.progress import SILENT, Progress

SETTLED = 0.01  # standard deviations of what is known before, and no further round


def correct_rig(
    seen: Mapping[tuple[str, str], PhaseMap],
    calibration: PhotogrammetricCalibration,
    *,
    capture: str = "capture",
    options: OrientOptions = DEFAULT,
    progress: Progress = SILENT,
) -> RigCorrection:
    """Correct the orientations of all devices of a rig together.

    Parameters
    ----------
    seen : mapping
        By camera and projector, or two cameras, what the one saw of the other's coordinates.

    Raises
    ------
    TooLittleSeenError
        If no two devices have enough pixels with both coordinates.
    AdjustmentError
        If the rig is another one altogether, or does not come to rest.

    Notes
    -----
    Two cameras are held against each other by labels that each of them also has of the projector. Such noise is not
    independent: every pair's counts as often as there are cameras, which by Cauchy and Schwarz is not too little.
    """
    C, often = calibration.covariance, len({name for pair in seen for name in pair if name in calibration.cameras})
    change = np.zeros(len(C))
    for round_, part in enumerate(progress.parts(options.rounds)):
        found, G = _shown(seen, changed(calibration, change), capture, options, part)
        watched = {name for motion in found for name in (motion.camera, motion.projector)}
        drifts = _drifts(calibration, [name for name in calibration.orientations if name in watched], options)
        before = C + drifts.by @ drifts.covariance @ drifts.by.T
        noise = np.zeros((5 * len(found), 5 * len(found)))
        for i, motion in enumerate(found):
            noise[5 * i : 5 * i + 5, 5 * i : 5 * i + 5] = often * motion.noise
        x = np.concatenate([motion.shown for motion in found]) + G @ change
        weight = np.linalg.inv(noise + G @ before @ G.T)
        last, change = change, before @ G.T @ weight @ x
        step = np.abs(change - last) / np.sqrt(np.maximum(np.diagonal(before), np.finfo(float).tiny))
        if step.max() < SETTLED:
            break
        if round_ == options.rounds - 1:
            said = f"orientations still change by {step.max():.2g} standard deviations after {options.rounds} rounds"
            raise AdjustmentError(capture, said, "calibrate again: the rig is no longer what it was")
    gain = before @ G.T @ weight
    left = np.eye(len(C)) - gain @ G
    moved = drifts.covariance @ drifts.by.T @ G.T @ weight
    covariance = drifts.covariance - moved @ G @ drifts.by @ drifts.covariance
    each = (moved @ x).reshape(-1, 6)
    return RigCorrection(
        capture=capture,
        calibration=changed(calibration, change, left @ before @ left.T + gain @ noise @ gain.T),
        devices=tuple(name for name in calibration.orientations if name in watched),
        rotation_rad=each[:, :3],
        shift_mm=each[:, 3:],
        sigma=np.sqrt(np.maximum(np.diagonal(covariance), 0.0)).reshape(-1, 6),
        pairs=tuple((motion.camera, motion.projector) for motion in found),
    )


def _shown(
    seen: Mapping[tuple[str, str], PhaseMap],
    calibration: PhotogrammetricCalibration,
    capture: str,
    options: OrientOptions,
    progress: Progress,
) -> tuple[list[RigMotion], Array]:
    """What all pairs show from where the devices are taken to be, and how it changes with all parameters (5n, k)."""
    found, by, why = [], [], TooLittleSeenError(capture, "no two devices are known", "calibrate them")
    for i, ((one, two), phase) in enumerate(seen.items()):
        progress(i / len(seen), f"holding {two} against {one}")
        progress.check()
        try:
            motion = find_motion(phase, pair_of(calibration, one, two), capture=capture, options=options)
        except TooLittleSeenError as error:
            why = error
            continue
        found.append(motion)
        by.append(motion.by_calibration @ pair_derivatives(calibration, one, two))
    if not found:
        raise why
    return found, np.concatenate(by)


@dataclass(frozen=True)
class _Drifts:
    """Movements of d devices: their covariance (6d, 6d), and the change of all parameters with them (k, 6d)."""

    covariance: Array
    by: Array


def _drifts(calibration: PhotogrammetricCalibration, devices: Sequence[str], options: OrientOptions) -> _Drifts:
    """By how much devices turn and shift, but for what only makes the whole rig larger or smaller."""
    place = {name: i for i, name in enumerate(calibration.parameter_names)}
    count = len(devices)
    by, larger = np.zeros((len(place), 6 * count)), np.zeros((count, 6))
    for j, name in enumerate(devices):
        orientation = calibration.orientations[name]
        own = np.ix_([place[n] for n in orientation_names(name)], range(6 * j, 6 * j + 6))
        by[own] = np.linalg.inv(turns_and_shifts(orientation.device_from_base))
        larger[j, 3:] = orientation.device_from_base.origin_mm / options.shift_prior_mm
    sigma = np.tile(np.repeat([options.rotation_prior_rad, options.shift_prior_mm], 3), count)
    scale = larger.ravel() / np.linalg.norm(larger)
    return _Drifts(np.outer(sigma, sigma) * (np.eye(6 * count) - np.outer(scale, scale)), by)
