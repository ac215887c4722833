"""Parts of a network: what can be adjusted, and what is named and left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.errors import AdjustmentError, InputError, listed
from core.geometry import lens_of
from core.model import Array, Concern, Network, NetworkScale

Bools = NDArray[np.bool_]
Warnings = list[Concern | str]  # of an adjustment; concerns put its result in doubt

LEAST_POINTS = 4  # that a free station must see: three leave up to four solutions
DATUM_POINTS = 3  # known ones that hold a field
ON_A_LINE = 0.01  # of their length, across: points that leave their stations free to turn about them


class LostEndError(AdjustmentError):
    """Too few images show an end of a measured distance."""


def selected(network: Network, observations: Bools) -> Network:
    """Keep those observations, shape (m,), and only the stations and points that still have some."""
    stations = np.unique(network.observation_station[observations])
    points = np.unique(network.observation_point[observations])
    new_station = np.full(len(network.station_names), -1)
    new_station[stations] = np.arange(len(stations))
    new_point = np.full(len(network.point_names), -1)
    new_point[points] = np.arange(len(points))

    def carried(distance: NetworkScale) -> NetworkScale:
        ends = int(new_point[distance.start]), int(new_point[distance.stop])
        if min(ends) < 0:
            lost = network.point_names[distance.start if ends[0] < 0 else distance.stop]
            raise LostEndError(
                f"point {lost}",
                "an end of the measured distance is not determined by the images",
                "observe it in at least two of them, or give another distance",
            )
        return replace(distance, start=ends[0], stop=ends[1])

    known = network.point_sigma_mm
    return replace(
        network,
        station_names=tuple(network.station_names[s] for s in stations),
        station_device=tuple(network.station_device[s] for s in stations),
        station_ids=tuple(network.station_ids[s] for s in stations if network.station_ids),
        point_ids=tuple(network.point_ids[p] for p in points if network.point_ids),
        station_pose=tuple(network.station_pose[s] for s in stations),
        point_names=tuple(network.point_names[p] for p in points),
        point_xyz_mm=network.point_xyz_mm[points],
        observation_station=new_station[network.observation_station[observations]],
        observation_point=new_point[network.observation_point[observations]],
        observation_uv=network.observation_uv[observations],
        observation_sigma=network.observation_sigma[observations],
        scale=None if network.scale is None else carried(network.scale),
        lengths=tuple(carried(distance) for distance in network.lengths),
        point_sigma_mm=None if known is None else known[points],
    )


def check_network(network: Network) -> None:
    """Refuse a network whose numbers mean nothing; the InputError names the device, station, point or observation."""
    for name, device in network.devices.items():
        names = lens_of(device.spec).names
        unknown = [p for p in device.estimate or () if p not in names]
        if unknown:
            raise InputError(f"device {name}", f"estimate names {unknown[0]!r}", f"use {', '.join(names)}")
    if len(network.observation_uv) == 0:
        raise InputError("the network", "has no observations", "add image points")
    bad = np.flatnonzero(~np.all(np.isfinite(network.point_xyz_mm), axis=1))
    if len(bad):
        raise InputError(
            f"point {network.point_names[bad[0]]}", "has no approximate coordinates", "give x, y and z in mm"
        )
    key = network.observation_station * len(network.point_names) + network.observation_point
    order = np.argsort(key, kind="stable")
    twice = order[1:][np.diff(key[order]) == 0]
    if len(twice):
        raise InputError(
            _observation(network, int(twice.min())), "is observed twice in this station", "keep one of the two"
        )
    seen = np.isfinite(network.observation_uv)
    none = np.flatnonzero(~seen.any(axis=1))
    if len(none):
        raise InputError(_observation(network, int(none[0])), "has neither u nor v", "leave the observation out")
    with np.errstate(invalid="ignore"):
        odd = np.any(seen & ~((network.observation_sigma > 0) & np.isfinite(network.observation_sigma)), axis=1)
    if odd.any():
        first = int(np.argmax(odd))
        raise InputError(
            _observation(network, first), f"has sigma {network.observation_sigma[first].tolist()}", "give a sigma > 0"
        )
    for distance in (*((network.scale,) if network.scale is not None else ()), *network.lengths):
        start, stop, length, sigma = distance.start, distance.stop, distance.length_mm, distance.sigma_mm
        if start == stop or not (length > 0 and sigma > 0):
            raise InputError(
                "the measured distance",
                f"is {length} mm ± {sigma} mm from {network.point_names[start]} to {network.point_names[stop]}",
                "give two different points, a length and a sigma above 0",
            )
    known = network.point_sigma_mm
    if known is not None and (known.shape != network.point_xyz_mm.shape or not np.all(known >= 0)):
        raise InputError("the points' sigmas", "are not all 0 or more", "give 0 to hold, infinity where not known")


def _observation(network: Network, row: int) -> str:
    station, point = network.observation_station[row], network.observation_point[row]
    return f"station {network.station_names[station]}, point {network.point_names[point]}"


def adjustable(network: Network) -> tuple[Network, Warnings]:
    """Leave out points seen from one place only and stations with too few points, until all can be adjusted.

    The warnings name what was left out. AdjustmentError if too little is left, or in parts that share no points.
    """
    warnings: Warnings = []
    if len(np.unique(network.observation_station)) < len(network.station_names):
        unused = np.setdiff1d(np.arange(len(network.station_names)), network.observation_station)
        warnings.append(f"left out, no observations: station {listed([network.station_names[s] for s in unused])}")
    while True:
        few, single = _weak_stations(network), np.empty(0, np.int64)
        keep = ~np.isin(network.observation_station, few)
        if len(few):
            names = listed([network.station_names[s] for s in few if s in network.observation_station])
            text = f"left out, fewer than {LEAST_POINTS} usable points: station {names}"
            warnings += [Concern("doubtful", text)] * bool(names)
        elif len(few := _stations_before_a_line(network)):
            keep = ~np.isin(network.observation_station, few)
            names = listed([network.station_names[s] for s in few])
            warnings.append(Concern("doubtful", f"left out, all its points lie on one line: station {names}"))
        else:
            single = _single_ray_points(network)
            keep = ~np.isin(network.observation_point, single)
            if len(single):
                names = listed([network.point_names[p] for p in single])
                warnings.append(f"left out, not seen by two rays: point {names}")
        if not keep.any():
            raise AdjustmentError(
                "the network",
                "no point is seen by two rays from stations with enough points",
                f"every station needs {LEAST_POINTS} points that another station sees too, or that are known",
            )
        if keep.all() and not len(few) and not len(single):
            _check_connected(network)
            return network, warnings
        network = selected(network, keep)


def _weak_stations(network: Network) -> NDArray[np.int64]:
    """Stations whose whole pose has fewer observed coordinates than four points give."""
    seen = np.isfinite(network.observation_uv).sum(axis=1)
    _, pose = np.unique(np.array(network.station_pose), return_inverse=True)
    coordinates = np.bincount(pose[network.observation_station], seen, minlength=pose.max() + 1)
    return np.flatnonzero(coordinates[pose] < 2 * LEAST_POINTS)


def _stations_before_a_line(network: Network) -> NDArray[np.int64]:
    """Stations of poses whose points lie on one line, about which they may turn; none where all points do."""
    _, pose = np.unique(np.array(network.station_pose), return_inverse=True)
    of, xyz = pose[network.observation_station], network.point_xyz_mm[network.observation_point]
    xyz = xyz - network.point_xyz_mm.mean(axis=0)
    count = np.bincount(of)

    def mean(values: Array) -> Array:
        return np.bincount(of, values) / count

    middle = np.stack([mean(a) for a in xyz.T], axis=1)
    squares = np.stack([mean(a * b) for a in xyz.T for b in xyz.T], axis=1).reshape(-1, 3, 3)
    moments = squares - middle[:, :, None] * middle[:, None]
    _, across, along = np.linalg.eigvalsh(moments).T
    lines = (along > 0) & (across < ON_A_LINE**2 * along)
    return np.flatnonzero(lines[pose]) if not lines.all() else np.empty(0, np.int64)


def _single_ray_points(network: Network) -> NDArray[np.int64]:
    """Points with fewer than two stations or fewer than three observed coordinates; what is known counts.

    Not, where points are known to give the datum and these are too few for it: one ray to one of two lets all turn.
    """
    n = len(network.point_names)
    if network.point_sigma_mm is not None:
        known = np.isfinite(network.point_sigma_mm).sum(axis=1)
    else:
        known = np.zeros(n, np.int64)
    stations = np.bincount(network.observation_point, minlength=n)
    coordinates = np.bincount(network.observation_point, np.isfinite(network.observation_uv).sum(axis=1), minlength=n)
    if np.count_nonzero(known == 3) < DATUM_POINTS:
        known = np.where((known == 3) & (stations < 2), 0, known)
    return np.flatnonzero((stations == 0) | ((stations < 2) & (known == 0)) | (coordinates + known < 3))


def known_points(network: Network) -> Bools:
    """Which points are known before in all three coordinates, shape (n,)."""
    if network.point_sigma_mm is None:
        return np.zeros(len(network.point_names), bool)
    return np.asarray(np.isfinite(network.point_sigma_mm).all(axis=1))


def _check_connected(network: Network) -> None:
    """Refuse a network that falls into parts without common points; known ones are common to all."""
    _, pose = np.unique(np.array(network.station_pose), return_inverse=True)
    part, known = np.arange(len(network.point_names)), known_points(network)
    while True:  # every pose hands the least number among its points to all of them
        lowest = np.full(pose.max() + 1, len(part))
        np.minimum.at(lowest, pose[network.observation_station], part[network.observation_point])
        spread = part.copy()
        np.minimum.at(spread, network.observation_point, lowest[pose[network.observation_station]])
        spread[known] = spread[known].min(initial=len(part))
        if np.array_equal(spread, part):
            break
        part = spread
    if np.all(part == part[0]):
        return
    station_part = lowest[pose]
    names = listed([network.station_names[s] for s in np.flatnonzero(station_part != station_part[0])])
    raise AdjustmentError(
        f"station {names}",
        "shares no points with the first station, directly or through others: the network is disconnected",
        "add images that see points of both parts, or adjust the parts separately",
    )
