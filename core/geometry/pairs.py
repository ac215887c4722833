"""One camera with one projector, taken out of a calibration of many devices with all that is known of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from core.errors import InputError
from core.geometry.lens import lens_of
from core.geometry.rotation import Pose, cross_matrix
from core.model import (
    AdjustedDevice,
    Adjustment,
    Array,
    Capture,
    Orientation,
    Pair,
    PhaseMap,
    PhotogrammetricCalibration,
)

ORIENTATION = ("rx", "ry", "rz", "tx", "ty", "tz")


def names_of(name: str, device: AdjustedDevice) -> tuple[str, ...]:
    """Names of a device's interior parameters in a covariance, such as "camera.c"."""
    return tuple(f"{name}.{p}" for p in lens_of(device.interior).names)


def orientation_names(name: str) -> tuple[str, ...]:
    """Names of a device's orientation in a covariance, such as "projector.rx"."""
    return tuple(f"{name}.{p}" for p in ORIENTATION)


def orientation_variances(found: PhotogrammetricCalibration | Adjustment, name: str) -> Array:
    """Variances (6,) of a device's orientation, rad² and mm²."""
    first = found.parameter_names.index(f"{name}.rx")
    covariance = found.parameter_cov if isinstance(found, Adjustment) else found.covariance
    return np.diagonal(covariance)[first : first + 6]


def held_axes(device_from_base: Pose, variances: Array) -> tuple[str, ...]:
    """Axes, of "xyz", along which a place is held at 0 because it was never observed: it has no variance (6,) then."""
    places = zip("xyz", device_from_base.translation_mm, variances[3:], strict=True)
    return tuple(axis for axis, place, variance in places if place == 0 and variance == 0)


def relative_derivatives(base_shift: Array, relative: Pose) -> tuple[Array, Array]:
    """Change (6, 6) of ``other_from_base`` with the orientations of base and other to a third frame.

    `base_shift` is the translation of ``base_from_third``, mm, `relative` is ``other_from_base``. Rotation vectors turn
    from the left.
    """
    R, arm = relative.rotation, relative.rotation @ base_shift
    cross = cross_matrix(arm)
    M_base, M_other = np.zeros((6, 6)), np.eye(6)
    M_base[:3, :3], M_base[3:, 3:], M_base[3:, :3] = -R, -R, -cross @ R
    M_other[3:, :3] = cross
    return M_base, M_other


def pair_of(calibration: PhotogrammetricCalibration | Pair, camera: str = "", projector: str = "") -> Pair:
    """Take one camera and one projector out of a calibration, those meant where none is named.

    Raises
    ------
    InputError
        If the calibration has no such device, or the two were not tied to each other.
    """
    if isinstance(calibration, Pair):
        return calibration
    camera, projector = camera or calibration.camera_name, projector or calibration.projector_name
    for name in (camera, projector):
        if name not in calibration.devices:
            if not calibration.projectors:
                seen = f"is of {' and '.join(calibration.cameras)}; no projector is calibrated"
                remedy = (
                    "calibrate the projector too, which takes its pitch_mm and nominal_c_mm: cameras alone can "
                    "reconstruct, evaluate and report"
                )
                raise InputError("calibration", seen, remedy)
            raise InputError("calibration", f"has no device {name!r}", f"it knows {', '.join(calibration.devices)}")
    to_camera, to_projector = (calibration.orientations.get(name) for name in (camera, projector))
    bases = {camera if to_camera is None else to_camera.base, projector if to_projector is None else to_projector.base}
    if len(bases) > 1:
        raise InputError(
            "calibration",
            f"{camera} and {projector} were not tied to each other",
            "capture the board where both see it, and calibrate again",
        )
    camera_from_base = Pose() if to_camera is None else to_camera.device_from_base
    projector_from_base = Pose() if to_projector is None else to_projector.device_from_base
    relative = projector_from_base @ camera_from_base.inverse()
    L = pair_derivatives(calibration, camera, projector)
    devices = calibration.devices
    return Pair(devices[camera], devices[projector], relative, L @ calibration.covariance @ L.T)


def pair_derivatives(calibration: PhotogrammetricCalibration, camera: str, projector: str) -> Array:
    """How the parameters of a pair, in the order of its covariance, change with the calibration's, (k, p)."""
    to_camera, to_projector = (calibration.orientations.get(name) for name in (camera, projector))
    camera_from_base = Pose() if to_camera is None else to_camera.device_from_base
    projector_from_base = Pose() if to_projector is None else to_projector.device_from_base
    place = {name: i for i, name in enumerate(calibration.parameter_names)}
    own = [n for name in (camera, projector) for n in names_of(name, calibration.devices[name])]
    L = np.zeros((len(own) + 6, len(place)))
    L[np.arange(len(own)), [place[name] for name in own]] = 1.0
    relative = projector_from_base @ camera_from_base.inverse()
    by_camera, by_projector = relative_derivatives(camera_from_base.translation_mm, relative)
    for name, known, M in ((camera, to_camera, by_camera), (projector, to_projector, by_projector)):
        if known is not None:
            L[len(own) :, [place[n] for n in orientation_names(name)]] = M
    return L


def pair_for(phase: PhaseMap | Capture, calibration: PhotogrammetricCalibration | Pair) -> Pair:
    """Take the pair out of a calibration that a phase map or capture names, see `pair_named`."""
    return calibration if isinstance(calibration, Pair) else pair_named(calibration, phase.camera, phase.projector)


def camera_for(phase: PhaseMap | Capture, calibration: PhotogrammetricCalibration | Pair) -> AdjustedDevice:
    """Take the camera that a phase map or capture names out of a calibration, which may be of cameras alone."""
    if isinstance(calibration, Pair):
        return calibration.camera
    return calibration.devices[_meant(calibration, phase.camera, phase.projector)[0] or calibration.camera_name]


def pair_named(calibration: PhotogrammetricCalibration, camera: str, projector: str) -> Pair:
    """Take these two out of a calibration; the only one of a kind where either name is just "camera" or "projector"."""
    return pair_of(calibration, *_meant(calibration, camera, projector))


def knows(calibration: PhotogrammetricCalibration, camera: str, projector: str) -> bool:
    """Whether `pair_named` finds both in a calibration."""
    return set(_meant(calibration, camera, projector)) <= {"", *calibration.devices}


def _meant(calibration: PhotogrammetricCalibration, *names: str) -> list[str]:
    """Give the names to look for, "" for the only one."""
    kinds = (calibration.cameras, "camera"), (calibration.projectors, "projector")
    found = zip(names, kinds, strict=True)
    return ["" if len(known) == 1 and usual in (name, *known) else name for name, (known, usual) in found]


def calibration_of(
    devices: Mapping[str, AdjustedDevice], from_first: Mapping[str, Pose], covariance: Array, **figures: Any
) -> PhotogrammetricCalibration:
    """Make the calibration of devices by name, with the poses of all others from the first.

    `covariance` is of the devices' parameters, and then of the orientations. `figures` are further fields, "cameras"
    at least; those of the adjustment are 0, and sigma0 is 1, unless given.
    """
    counts = dict.fromkeys(("stations", "image_points", "object_points", "redundancy"), 0)
    unadjusted: dict[str, Any] = {"sigma0": 1.0, **counts, "object_sigma_rms_um": (0.0, 0.0, 0.0)}
    parameters = [n for name, device in devices.items() for n in names_of(name, device)]
    return PhotogrammetricCalibration(
        devices=devices,
        orientations={name: Orientation(next(iter(devices)), pose) for name, pose in from_first.items()},
        covariance=covariance,
        parameter_names=(*parameters, *(n for name in from_first for n in orientation_names(name))),
        **(unadjusted | figures),
    )


def changed(
    calibration: PhotogrammetricCalibration, change: Array, covariance: Array | None = None
) -> PhotogrammetricCalibration:
    """Add a change, shape (k,) in the order of the covariance, to all devices and orientations."""
    by = dict(zip(calibration.parameter_names, change, strict=True))

    def of(names: tuple[str, ...]) -> Array:
        return np.array([by[name] for name in names])

    devices = {
        name: replace(device, interior=device.interior.changed(of(names_of(name, device))))
        for name, device in calibration.devices.items()
    }
    orientations = {
        name: replace(known, device_from_base=known.device_from_base.changed(of(orientation_names(name))))
        for name, known in calibration.orientations.items()
    }
    covariance = calibration.covariance if covariance is None else covariance
    return replace(calibration, devices=devices, orientations=orientations, covariance=covariance)


def perturbed(pair: Pair, change: Array) -> Pair:
    """Add a change, shape (k,) in the order of the covariance, to camera, projector and their orientation."""
    camera, projector = pair.camera, pair.projector
    k = len(camera.interior.vector)
    of_camera, of_projector, of_pose = np.split(change, [k, k + len(projector.interior.vector)])
    return Pair(
        replace(camera, interior=camera.interior.changed(of_camera)),
        replace(projector, interior=projector.interior.changed(of_projector)),
        pair.projector_from_camera.changed(of_pose),
        pair.covariance,
    )
