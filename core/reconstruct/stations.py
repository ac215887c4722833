"""A rig at several stations as one rig: its devices once for each, with all that is known of where they stood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.geometry import Pose, rotation_vector_from_matrix
from core.geometry.pairs import names_of, orientation_names
from core.model import (
    AdjustedDevice,
    Array,
    Floats,
    Orientation,
    PhaseMap,
    PhotogrammetricCalibration,
    PointCloud,
    Registration,
)
from core.progress import SILENT, Progress
from core.reconstruct.joint import each_once, in_one_frame, intersect_each
from core.reconstruct.overlaps import Seen, averaged
from core.reconstruct.placed import moved, placed


def device_at(name: str, station: int) -> str:
    """What a device is called at a station: at the first one as ever."""
    return f"{name}@{station}" if station else name


def at_stations(
    calibration: PhotogrammetricCalibration, registration: Registration, camera: str
) -> PhotogrammetricCalibration:
    """Give a calibration in which every device stands at every station of a registration of one of its cameras.

    Its covariance is of the calibration's errors, which all stations share, and of the noise of the registration.
    """
    base = next((n for n in calibration.devices if n not in calibration.orientations), camera)
    k, m = len(calibration.covariance), len(registration.covariance)
    devices: dict[str, AdjustedDevice] = {}
    for station in range(len(registration.poses)):
        devices |= {device_at(name, station): device for name, device in calibration.devices.items()}

    def poses(step: Array) -> dict[str, Pose]:
        """Poses of all devices but the base after a step (k + m,) of the calibration and the registration."""
        own = moved(placed(calibration), calibration, step[:k])
        changes = (registration.by_calibration @ step[:k] + step[k:]).reshape(-1, 6)
        found: dict[str, Pose] = {}
        for station, pose in enumerate(registration.poses):
            there = pose if station == 0 else pose.changed(changes[station - 1])
            from_base = own[camera].from_base.inverse() @ there @ own[camera].from_base
            found |= {device_at(name, station): d.from_base @ from_base for name, d in own.items()}
        return {name: pose for name, pose in found.items() if name != base}

    C = np.zeros((k + m, k + m))
    C[:k, :k], C[k:, k:] = calibration.covariance, registration.covariance
    here = poses(np.zeros(k + m))
    inner = {name: names_of(name, device) for name, device in devices.items()}
    names = [n for own in inner.values() for n in own] + [n for name in here for n in orientation_names(name)]
    place, own_place = ({n: i for i, n in enumerate(all_of)} for all_of in (names, calibration.parameter_names))
    T = np.zeros((len(names), k + m))
    for station in range(len(registration.poses)):
        for name, device in calibration.devices.items():
            there = inner[device_at(name, station)]
            T[[place[n] for n in there], [own_place[n] for n in names_of(name, device)]] = 1.0
    for j in np.flatnonzero(np.diagonal(C) > 0):
        step = np.zeros(k + m)
        step[j] = np.sqrt(C[j, j])
        up, down = poses(step), poses(-step)
        for name in here:
            turn = rotation_vector_from_matrix(up[name].rotation @ down[name].rotation.T)
            change = np.concatenate([turn, up[name].translation_mm - down[name].translation_mm])
            T[[place[n] for n in orientation_names(name)], j] = change / (2 * step[j])
    return replace(
        calibration,
        devices=devices,
        cameras=tuple(device_at(n, s) for s in range(len(registration.poses)) for n in calibration.cameras),
        orientations={name: Orientation(base, pose) for name, pose in here.items()},
        covariance=T @ C @ T.T,
        parameter_names=tuple(names),
    )


def joined(
    phases: Sequence[Sequence[PhaseMap]],
    stations: Sequence[str],
    calibration: PhotogrammetricCalibration,
    progress: Progress = SILENT,
) -> tuple[PointCloud, Floats, tuple[tuple[str, str], ...]]:
    """Points of every station by all devices there, each place once, with sigmas along the axes of the common frame.

    The calibration is that `at_stations`. Cloud (1, n, 3) and image (1, n) come with the cameras and stations that have
    a part in a point; the cloud's `source` is the position among these.
    """
    devices, views, images, names = placed(calibration), [], [], []
    for k, (own, station) in enumerate(zip(phases, stations, strict=True)):
        progress(k / len(stations), f"intersecting {station}")
        there = [replace(p, camera=device_at(p.camera, k), projector=device_at(p.projector, k)) for p in own]
        seen = {phase.camera: phase for phase in there}
        clouds = each_once(intersect_each(there, calibration, [*seen], along="base"))
        views += [Seen(cloud, devices[name], k) for name, cloud in clouds.items()]
        images += [seen[name].image for name in clouds]
        of = {device_at(p.camera, k): p.camera for p in own}
        names += [(of[name], station) for name in clouds]
    means = zip(views, averaged(views), images, strict=True)
    cloud, image = in_one_frame((view.camera, mean, made, image) for view, (mean, made), image in means)
    assert cloud.source is not None
    combinations, source = np.unique(cloud.source, return_inverse=True)
    told = tuple(_told([name for i, name in enumerate(names) if bits >> i & 1]) for bits in combinations.tolist())
    kind = np.uint8 if len(told) <= 256 else np.uint16
    return replace(cloud, source=source.reshape(cloud.source.shape).astype(kind)), image, told


def _told(made_by: Sequence[tuple[str, str]]) -> tuple[str, str]:
    cameras, stations = (" + ".join(dict.fromkeys(column)) for column in zip(*made_by, strict=True))
    return cameras, stations
