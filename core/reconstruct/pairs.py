"""Which camera and projector of a calibration a phase map belongs to."""

from __future__ import annotations

from core.geometry import pair_of
from core.model import Pair, PhaseMap, PhotogrammetricCalibration


def pair_for(phase: PhaseMap, calibration: PhotogrammetricCalibration | Pair) -> Pair:
    """Take the pair out of a calibration that a phase map names; the only one where there is no choice.

    Raises
    ------
    InputError
        If the calibration does not know it.
    """
    if isinstance(calibration, Pair):
        return calibration
    camera = phase.camera if len(calibration.cameras) > 1 else ""
    projector = phase.projector if len(calibration.projectors) > 1 else ""
    return pair_of(calibration, camera, projector)
