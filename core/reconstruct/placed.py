"""The devices of a calibration as one camera sees them, and what moves when a parameter of the calibration moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from core.errors import InputError
from core.geometry import Pose
from core.geometry.pairs import names_of, orientation_names
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Interior, PhotogrammetricCalibration


@dataclass(frozen=True)
class Device:
    """A device and where it stands."""

    spec: DeviceSpec
    interior: Interior
    from_base: Pose


def placed(calibration: PhotogrammetricCalibration) -> dict[str, Device]:
    """Give all devices, with poses in the frame that the orientations refer to; InputError if not all are tied."""
    bases = {orientation.base for orientation in calibration.orientations.values()}
    if len(bases) > 1:
        remedy = "capture the board where all see it, and calibrate again"
        raise InputError("calibration", f"its devices stand in several frames: {', '.join(sorted(bases))}", remedy)
    poses = {name: orientation.device_from_base for name, orientation in calibration.orientations.items()}
    return {
        name: Device(device.spec, device.interior, poses.get(name, Pose()))
        for name, device in calibration.devices.items()
    }


def moved(devices: Mapping[str, Device], calibration: PhotogrammetricCalibration, step: Array) -> dict[str, Device]:
    """Change the devices by a step of the calibration's parameters, in the order of its covariance."""
    change = dict(zip(calibration.parameter_names, step, strict=True))
    found = {}
    for name, device in devices.items():
        own, pose = np.array([change[n] for n in names_of(name, calibration.devices[name])]), device.from_base
        if name in calibration.orientations:
            pose = pose.changed(np.array([change[n] for n in orientation_names(name)]))
        interior = device.interior.changed(own) if own.any() else device.interior  # the same one keeps its rays
        found[name] = replace(device, interior=interior, from_base=pose)
    return found
