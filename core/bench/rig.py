"""The true rig: camera and projector as they really are, and how they stand to each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from core.bench.optics import Lcd, Lens
from core.bench.sensor import Sensor
from core.geometry import Pose
from core.lazy import dataclass
from core.model import DeviceSpec, Interior

# Brenner, Böhm, Gühring (1999): the adjusted parameters of the published rig, taken as the truth here
# fmt: off
CAMERA_1999 = (
    12.102765, -0.081293, -0.114492,
    -0.603793e-3, 0.308968e-5, -0.143177e-1, 0.308307e-4, -0.121978e-3, -0.757670e-4,
)
PROJECTOR_1999 = (
    181.915599, 1.178883, 0.331241,
    0.555660e-6, -0.266407e-9, 0.200536e-3, 0.133679e-3, 0.204489e-5, 0.980716e-5,
)
# fmt: on


@dataclass(frozen=True)
class Rig:
    """Camera, projector and their electronics."""

    #: camera, projector: what the maker's sheet says
    camera: DeviceSpec
    #: camera_interior, projector_interior: what is true
    camera_interior: Interior
    projector: DeviceSpec
    projector_interior: Interior
    projector_from_camera: Pose
    camera_from_volume: Pose  #: the measuring volume's frame: origin at its middle, y up, z towards the rig
    #: lcd, lens, sensor: optics and electronics
    lcd: Lcd
    lens: Lens
    sensor: Sensor
    reference_mm: float = 600.0  #: distance from the projector at which white gives `sensor.white_level`
    subsamples: int = 3  #: rays per pixel along one axis


def look_at(centre_mm: ArrayLike, target_mm: ArrayLike = (0.0, 0.0, 0.0)) -> Pose:
    """Pose ``device_from_volume`` of an upright device at a place (shape (3,)) that looks at a target (shape (3,)).

    Examples
    --------
    >>> camera_from_volume = look_at([0.0, 0.0, 600.0])
    >>> camera_from_volume.apply([1.0, 2.0, 3.0])
    array([   1.,    2., -597.])
    """
    centre = np.asarray(centre_mm, np.float64)
    z = centre - np.asarray(target_mm, np.float64)
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    return Pose(R, -R @ centre)


def converging_pair(base_mm: float, distance_mm: float) -> tuple[Pose, Pose]:
    """Stand camera (left) and projector (right) at equal distances from the origin of the volume, looking at it."""
    height = float(np.sqrt(distance_mm**2 - base_mm**2 / 4))
    camera = look_at([-base_mm / 2, 0.0, height])
    projector = look_at([base_mm / 2, 0.0, height])
    return camera, projector @ camera.inverse()


def interior(spec: DeviceSpec, values: ArrayLike) -> Interior:
    """Interior orientation of a device from (c, x0, y0, A1..A6), r0 as the interchange format has it."""
    return Interior.from_vector(np.asarray(values, np.float64), spec.zero_radius_mm)
