"""A small ideal rig: no distortion, no blur, no noise, so that closed forms hold."""

from dataclasses import replace

import numpy as np
import pytest

from core.bench import Board, Lcd, Lens, Rig, Scene, Sensor
from core.geometry import Pose
from core.model import DeviceSpec, Interior

DISTANCE_MM = 500.0


@pytest.fixture
def ideal_rig() -> Rig:
    """Camera and projector beside each other, parallel; one projector line is one camera pixel at any distance."""
    camera = DeviceSpec(120, 80, (0.02, 0.02), 10.0)
    projector = DeviceSpec(96, 64, (0.2, 0.2), 100.0)
    return Rig(
        camera,
        Interior(10.0),
        projector,
        Interior(100.0),
        Pose(np.eye(3), np.array([-100.0, 0.0, 0.0])),  # the projector stands 100 mm to the right
        Pose(np.eye(3), np.array([0.0, 0.0, -DISTANCE_MM])),
        Lcd(fill=1.0, contrast=1e9, blur_lines=1e-4, defocus_lines=0.0, focus_mm=DISTANCE_MM),
        Lens(blur_px=0.0),
        Sensor(white_level=100.0, offset=0.0, read_noise=0.0, shot_gain=0.0),
        reference_mm=DISTANCE_MM,
    )


@pytest.fixture
def wall() -> Scene:
    """A white wall square to both axes."""
    return Scene(Board((400.0, 400.0)), Pose(np.eye(3), np.array([0.0, 0.0, -DISTANCE_MM])), ambient=0.0)


@pytest.fixture
def blurred(ideal_rig):
    """The ideal rig with changes to its optics."""

    def make(lens: float = 0.0, subsamples: int = 3, **lcd: float) -> Rig:
        return replace(ideal_rig, lens=Lens(lens), lcd=replace(ideal_rig.lcd, **lcd), subsamples=subsamples)

    return make
