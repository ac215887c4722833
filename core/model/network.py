"""Image observations to be adjusted, and who their stations and points are where they come from a project."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model.arrays import Array, Ints
from core.model.rig import DeviceSpec


@dataclass(frozen=True)
class TargetId:
    """A target of a testfield."""

    row: int
    col: int

    def __str__(self) -> str:
        """Give the name of its point."""
        return f"{self.row}/{self.col}"


@dataclass(frozen=True)
class StationId:
    """A device before the board of one capture; `by` is the device it was matched with, where there are several."""

    capture: str
    device: str
    by: str = ""

    def __str__(self) -> str:
        """Give the name of the station."""
        return f"{self.capture}/{self.device}" + (f" by {self.by}" if self.by else "")


@dataclass(frozen=True)
class NetworkDevice:
    """A device of a network and which of its parameters are estimated: names of its lens's, None for the usual ones.

    Those that its `spec` knows before with a sigma of 0 are held all the same. `along` adjusts its place along the axis
    of a coordinate never observed, too, which is held at 0 otherwise.
    """

    spec: DeviceSpec
    estimate: tuple[str, ...] | None = None
    along: bool = False


@dataclass(frozen=True)
class NetworkScale:
    """A measured distance between two points of a network (indices into its points)."""

    start: int
    stop: int
    length_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class Network:
    """Image observations to be adjusted: stations (one device at one place each), points, and who saw what where.

    Stations that share a `station_pose` number belong to one pose of a rigid rig: within a pose the first device's
    orientation is free and every other device has one constant orientation relative to it. Where every station has a
    pose number of its own, all stations are free.
    """

    devices: Mapping[str, NetworkDevice]
    station_names: tuple[str, ...]
    station_device: tuple[str, ...]
    station_pose: tuple[int, ...]
    point_names: tuple[str, ...]
    point_xyz_mm: Array  # (n, 3) approximate
    observation_station: Ints  # (m,)
    observation_point: Ints  # (m,)
    observation_uv: Array  # (m, 2) px or lines; NaN in one coordinate: that one was not observed
    observation_sigma: Array  # (m, 2) px or lines
    scale: NetworkScale | None = None
    lengths: tuple[NetworkScale, ...] = ()  # further measured distances
    station_ids: tuple[StationId, ...] = ()  # of every station, where they are captures of a project
    point_ids: tuple[TargetId, ...] = ()  # of every point, where they are targets of a testfield
    point_sigma_mm: Array | None = None  # (n, 3) of points known before: 0 held, infinite not known; None for no point

    @property
    def made_by(self) -> dict[str, NDArray[np.bool_]]:
        """For each device which observations it made, (m,)."""
        device = np.array(self.station_device)[self.observation_station]
        return {name: device == name for name in self.devices}

    @property
    def bases(self) -> dict[str, str]:
        """For each device the one it is held rigidly to: the first of those it shares poses with, or itself."""
        base = {name: name for name in self.devices}
        rank = {name: k for k, name in enumerate(self.devices)}
        together: dict[int, set[str]] = {}
        for device, pose in zip(self.station_device, self.station_pose, strict=True):
            together.setdefault(pose, set()).add(device)
        for group in together.values():
            merged = {base[name] for name in group}
            chief = min(merged, key=rank.__getitem__)
            base = {name: chief if b in merged else b for name, b in base.items()}
        return base
