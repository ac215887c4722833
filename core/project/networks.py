"""A network folder: targets measured elsewhere, adjusted here."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from core.atomic import atomic_write, write_json
from core.errors import InputError
from core.fields import Fields
from core.model import INTERIOR_NAMES, Network, NetworkDevice, NetworkScale
from core.project.captures import VERSION, read_document, read_table
from core.project.rigs import device_to_dict, read_device


def read_network(folder: Path) -> Network:
    """Read network.json, points.csv and observations.csv; every station is free.

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
    names: dict[str, int] = {}
    xyz = []
    for row in read_table(folder / "points.csv", ("point", "x_mm", "y_mm", "z_mm"), texts=("point",)):
        name = row.text("point")
        if name in names:
            raise InputError(row.where, f"point {name!r} is there already", "remove one of the two")
        names[name] = len(names)
        xyz.append([row.real(f"{axis}_mm") for axis in "xyz"])
    index = {name: i for i, name in enumerate(stations)}
    station, point, uv, sigma = [], [], [], []
    seen: set[tuple[int, int]] = set()
    columns = ("station", "point", "u", "v", "sigma_px")
    for row in read_table(folder / "observations.csv", columns, texts=("station", "point")):
        pair = _known(row, "station", index, "network.json"), _known(row, "point", names, "points.csv")
        if pair in seen:
            seen_in = f"point {row.text('point')!r} is there already in station {row.text('station')!r}"
            raise InputError(row.where, seen_in, "remove one of the two")
        seen.add(pair)
        station.append(pair[0])
        point.append(pair[1])
        uv.append([row.real("u"), row.real("v")])
        sigma.append([row.real("sigma_px", above=0.0)] * 2)
    scale = None
    if fields.data.get("scale") is not None:
        bar = fields.nested("scale")
        start, stop = _known(bar, "from", names, "points.csv"), _known(bar, "to", names, "points.csv")
        if start == stop:
            raise bar.refuse("to", bar.data["to"], "name two different points")
        scale = NetworkScale(start, stop, bar.real("length_mm", 0.0), bar.real("sigma_mm", 0.0))
    return Network(
        devices,
        tuple(stations),
        tuple(stations.values()),
        tuple(range(len(stations))),
        tuple(names),
        np.array(xyz),
        np.array(station, np.int64),
        np.array(point, np.int64),
        np.array(uv),
        np.array(sigma),
        scale,
    )


def write_network(folder: Path, network: Network) -> None:
    """Write a network as three files (each with one sigma for u and v: their quadratic mean)."""
    folder = Path(folder)
    points = ["point,x_mm,y_mm,z_mm"]
    for name, xyz in zip(network.point_names, network.point_xyz_mm, strict=True):
        points.append(",".join([name, *(f"{x:.10g}" for x in xyz)]))
    lines = ["station,point,u,v,sigma_px"]
    sigma = np.sqrt(np.mean(network.observation_sigma**2, axis=1))
    for s, p, uv, sd in zip(
        network.observation_station, network.observation_point, network.observation_uv, sigma, strict=True
    ):
        lines.append(f"{network.station_names[s]},{network.point_names[p]},{uv[0]:.10g},{uv[1]:.10g},{sd:.10g}")
    for name, rows in (("points.csv", points), ("observations.csv", lines)):
        with atomic_write(folder / name) as file:
            file.write(("\n".join(rows) + "\n").encode())
    data: dict[str, object] = {"format": "stripe-network", "version": VERSION}
    data["devices"] = {n: {**device_to_dict(d.spec), "estimate": list(d.estimate)} for n, d in network.devices.items()}
    data["stations"] = {n: {"device": d} for n, d in zip(network.station_names, network.station_device, strict=True)}
    if network.scale is not None:
        bar = network.scale
        ends = {"from": network.point_names[bar.start], "to": network.point_names[bar.stop]}
        data["scale"] = {**ends, "length_mm": bar.length_mm, "sigma_mm": bar.sigma_mm}
    write_json(folder / "network.json", data)


def _device(fields: Fields) -> NetworkDevice:
    estimate = tuple(fields.items("estimate")) if "estimate" in fields.data else INTERIOR_NAMES
    for name in estimate:
        if name not in INTERIOR_NAMES:
            raise fields.refuse("estimate", name, f"choose among {', '.join(INTERIOR_NAMES)}")
    return NetworkDevice(read_device(fields), tuple(n for n in INTERIOR_NAMES if n in estimate))


def _known(row: Fields, key: str, names: dict[str, int], file: str) -> int:
    name = str(row.data.get(key))
    if name not in names:
        raise row.refuse(key, name, f"use a name that {file} has")
    return names[name]
