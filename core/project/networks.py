"""A network folder: targets measured elsewhere, adjusted here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress
from pathlib import Path

import numpy as np

from core.atomic import atomic_write, write_json
from core.errors import InputError
from core.fields import Fields, read_document, read_table
from core.geometry import LENSES, lens_of
from core.model import Array, Network, NetworkDevice, NetworkScale
from core.project.captures import VERSION
from core.project.rigs import device_to_dict, read_device, read_length

SEVERAL, TINY = 8, 0.02  # observations of a device that reach over so little of its image tell nothing
APART = 20.0  # sigmas between the images of two points: they are at different places

_Seen = tuple[float, float, float]  # u, v and sigma, px


def read_network(folder: Path) -> Network:
    """Read network.json, points.csv and observations.csv; every station is free unless devices are rigid.

    Raises
    ------
    InputError
        Naming the file and the line: an unknown device, station, point or parameter, one observed twice, no number.
    """
    folder = Path(folder)
    fields = read_document(folder / "network.json", "stripe-network")
    devices = {name: _device(fields.nested("devices").nested(name)) for name in fields.nested("devices").data}
    stations: dict[str, str] = {}
    for name in fields.nested("stations").data:
        stations[name] = fields.nested("stations").nested(name).text("device", among=list(devices))
    if not devices or not stations:
        raise InputError(folder / "network.json", "no devices or no stations", "list at least one of each")
    points = _points(folder / "points.csv")
    names, index = [{name: i for i, name in enumerate(of)} for of in (points, stations)]
    seen = _observations(folder / "observations.csv", index, names)
    xyz, point_sigma = np.hsplit(np.array(list(points.values())).reshape(-1, 6), [3])
    station, point = np.array(list(seen), np.int64).reshape(-1, 2).T
    u, v, sigma = np.array(list(seen.values())).reshape(-1, 3).T
    held_mm = np.where((point_sigma == 0).all(axis=1)[:, None], xyz, np.nan)
    _check_held_apart(folder, seen, tuple(names), tuple(stations), held_mm)
    _check_pixels(folder, devices, np.array(list(stations.values()))[station], u, v)
    scale = fields.optional("scale")
    return Network(
        devices,
        tuple(stations),
        tuple(stations.values()),
        _rigid_groups(fields, stations),
        tuple(names),
        np.ascontiguousarray(xyz),
        np.ascontiguousarray(station),
        np.ascontiguousarray(point),
        np.column_stack([u, v]),
        np.column_stack([sigma, sigma]),
        _distance(scale, names) if scale else None,
        tuple(_distance(bar, names) for bar in fields.objects("lengths", "lengths, entry", [])),
        point_sigma_mm=np.ascontiguousarray(point_sigma) if np.isfinite(point_sigma).any() else None,
    )


def _points(path: Path) -> dict[str, list[float]]:
    """Read X, Y, Z of every point and their sigmas, 0 where held and infinite where free."""
    points: dict[str, list[float]] = {}
    sigmas = tuple(f"sigma_{axis}_mm" for axis in "xyz")
    for row in read_table(path, ("point", "x_mm", "y_mm", "z_mm"), texts=("point",), optional=sigmas):
        name = row.text("point")
        if name in points:
            raise InputError(row.where, f"point {name!r} is there already", "remove one of the two")
        known = [row.real(column, least=0.0, default=np.inf) for column in sigmas]
        points[name] = [row.real(f"{axis}_mm") for axis in "xyz"] + known
    if len(points) > 1 and len({tuple(known[:3]) for known in points.values()}) == 1:
        raise InputError(path, f"all {len(points)} points are at one place", "give every point its own coordinates")
    return points


def _observations(path: Path, stations: dict[str, int], points: dict[str, int]) -> dict[tuple[int, int], _Seen]:
    """Read u, v and sigma by the numbers of station and point."""
    seen: dict[tuple[int, int], _Seen] = {}
    for row in read_table(path, ("station", "point", "u", "v", "sigma_px"), texts=("station", "point")):
        pair = _known(row, "station", stations, "network.json"), _known(row, "point", points, "points.csv")
        if pair in seen:
            seen_in = f"point {row.text('point')!r} is there already in station {row.text('station')!r}"
            raise InputError(row.where, seen_in, "remove one of the two")
        seen[pair] = row.data["u"], row.data["v"], row.real("sigma_px", above=0.0)
    return seen


def _check_pixels(folder: Path, devices: Mapping[str, NetworkDevice], by: Array, u: Array, v: Array) -> None:
    """Refuse coordinates, each `by` a device, that fill so little of the image that they must be millimetres."""
    for name, device in devices.items():
        reach = [float(np.ptp(each[by == name])) if np.any(by == name) else np.inf for each in (u, v)]
        size = device.spec.width, device.spec.height
        if np.count_nonzero(by == name) >= SEVERAL and all(r < TINY * n for r, n in zip(reach, size, strict=True)):
            told = (
                f"u and v of device {name!r} reach over {reach[0]:.3g} x {reach[1]:.3g} of its {size[0]} x {size[1]} px"
            )
            raise InputError(folder / "observations.csv", told, "give u and v in pixels, not in mm")


def _check_held_apart(
    folder: Path,
    seen: Mapping[tuple[int, int], _Seen],
    points: Sequence[str],
    stations: Sequence[str],
    held_mm: Array,
) -> None:
    """Refuse points held at one place that an image shows at several; `held_mm` (n, 3) is NaN where free."""
    first: dict[tuple[int, bytes], tuple[int, float, float, float]] = {}
    held = set(np.flatnonzero(np.isfinite(held_mm).all(axis=1)).tolist())
    for (s, p), (u, v, sigma) in seen.items() if held else ():
        if p not in held:
            continue
        other, u0, v0, sigma0 = first.setdefault((s, held_mm[p].tobytes()), (p, u, v, sigma))
        if (apart := float(np.hypot(u - u0, v - v0))) > APART * float(np.hypot(sigma, sigma0)):
            both = f"{points[other]!r} and {points[p]!r}"
            told = f"{both} are held at one place, and seen {apart:.3g} px apart in {stations[s]!r}"
            raise InputError(folder / "points.csv", told, "correct the coordinates of one of them")


def _distance(bar: Fields, names: dict[str, int]) -> NetworkScale:
    start, stop = _known(bar, "from", names, "points.csv"), _known(bar, "to", names, "points.csv")
    if start == stop:
        raise bar.refuse("to", bar.data["to"], "name two different points")
    return NetworkScale(start, stop, *read_length(bar))


def write_network(folder: Path, network: Network) -> None:
    """Write a network as three files (each with one sigma for u and v: their quadratic mean)."""
    folder = Path(folder)
    known = network.point_sigma_mm
    points = ["point,x_mm,y_mm,z_mm" + ("" if known is None else ",sigma_x_mm,sigma_y_mm,sigma_z_mm")]
    for i, (name, xyz) in enumerate(zip(network.point_names, network.point_xyz_mm, strict=True)):
        sigmas = [] if known is None else [f"{s:.10g}" if np.isfinite(s) else "" for s in known[i]]
        points.append(",".join([name, *(f"{x:.10g}" for x in xyz), *sigmas]))
    lines = ["station,point,u,v,sigma_px"]
    sigma = np.sqrt(np.mean(network.observation_sigma**2, axis=1))
    for s, p, uv, sd in zip(
        network.observation_station, network.observation_point, network.observation_uv, sigma, strict=True
    ):
        lines.append(f"{network.station_names[s]},{network.point_names[p]},{uv[0]:.10g},{uv[1]:.10g},{sd:.10g}")
    for file_name, rows in (("points.csv", points), ("observations.csv", lines)):
        with atomic_write(folder / file_name) as file:
            file.write(("\n".join(rows) + "\n").encode())
    rigid = len(set(network.station_pose)) < len(network.station_pose)
    plain = known is None and not rigid and all(d.spec.interior is None for d in network.devices.values())
    data: dict[str, object] = {"format": "stripe-network", "version": VERSION if plain else 2}
    data["devices"] = {name: _device_to_dict(name, network, rigid) for name in network.devices}
    stations: dict[str, dict[str, object]] = {}
    for name, device, pose in zip(network.station_names, network.station_device, network.station_pose, strict=True):
        stations[name] = {"device": device, **({"pose": str(pose)} if rigid else {})}
    data["stations"] = stations
    if network.scale is not None:
        data["scale"] = _distance_to_dict(network, network.scale)
    if network.lengths:
        data["lengths"] = [_distance_to_dict(network, bar) for bar in network.lengths]
    write_json(folder / "network.json", data)


def _device_to_dict(name: str, network: Network, rigid: bool) -> dict[str, object]:
    device = network.devices[name]
    data = device_to_dict(device.spec)
    if device.estimate is not None:
        data["estimate"] = list(device.estimate)
    first = next(iter(network.devices))
    return {**data, "rigid_with": first} if rigid and name != first else data


def _distance_to_dict(network: Network, bar: NetworkScale) -> dict[str, object]:
    ends = {"from": network.point_names[bar.start], "to": network.point_names[bar.stop]}
    return {**ends, "length_mm": bar.length_mm, "sigma_mm": bar.sigma_mm}


def _device(fields: Fields) -> NetworkDevice:
    spec = read_device(fields)
    names = lens_of(spec).names
    if fields.data.get("estimate") is None:
        return NetworkDevice(spec)
    estimate = tuple(fields.items("estimate"))
    for name in estimate:
        if estimate.count(name) > 1:
            raise fields.refuse("estimate", list(estimate), f"name {name} once")
        if name not in names:
            others = ", ".join(f'"{model}"' for model in LENSES if model != spec.model)
            remedy = f'choose among {", ".join(names)}, or say "interior": {{"model": …}} of the lens ({others})'
            raise fields.refuse("estimate", name, remedy)
    return NetworkDevice(spec, tuple(n for n in names if n in estimate))


def _rigid_groups(fields: Fields, stations: dict[str, str]) -> tuple[int, ...]:
    """Number the poses: stations of rigid devices share one by the same "pose", or each device's first, second ..."""
    devices, held = fields.nested("devices"), {}
    for name in devices.data:
        held[name] = devices.nested(name).text("rigid_with", default=None, among=list(devices.data))
        if held[name] == name:
            raise devices.nested(name).refuse("rigid_with", name, "name another device")
    if not any(held.values()):
        return tuple(range(len(stations)))

    def chief(name: str) -> str:
        seen = [name]
        while (other := held[seen[-1]]) is not None and other not in seen:
            seen.append(other)
        return min(seen[seen.index(other) :]) if other is not None else seen[-1]

    poses = {n: fields.nested("stations").nested(n).text("pose", default=None) for n in stations}
    counts: dict[str, int] = {}
    keys: list[object] = []
    for name, device in stations.items():
        counts[device] = counts.get(device, 0) + 1
        alone = held[device] is None and device not in held.values()
        keys.append(name if alone else (chief(device), poses[name] or counts[device]))
    if not any(poses.values()):
        for name, other in held.items():
            if other is not None and counts.get(name) != counts.get(other):
                seen = f"{counts.get(name, 0)} stations of {name}, {counts.get(other, 0)} of {other}"
                remedy = 'give every station a "pose": the same text where they were taken at once'
                raise InputError(fields.where, f"{name} is rigid with {other}, but there are {seen}", remedy)
    for name in filter(held.get, counts):
        by = [device == name for device in stations.values()]
        if not set(compress(keys, by)) & set(compress(keys, (not own for own in by))):
            seen = f'{name} is rigid with {held[name]}, but no station of another device shares a "pose" with its own'
            remedy = 'give stations that were taken at once the same "pose", or leave "rigid_with" out'
            raise InputError(fields.where, seen, remedy)
    numbers: dict[object, int] = {}
    return tuple(numbers.setdefault(key, len(numbers)) for key in keys)


def _known(row: Fields, key: str, names: dict[str, int], file: str) -> int:
    name = str(row.data.get(key))
    if name not in names:
        raise row.refuse(key, name, f"use a name that {file} has")
    return names[name]
