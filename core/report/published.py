"""The printed results of an experiment that the rig repeats: data files in `resources/reference`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import field
from typing import Any

from core.errors import InputError
from core.lazy import dataclass
from core.model import Method
from core.resources import resource


@dataclass(frozen=True)
class Published:
    """Published values; what the publication does not tell, or we do not know, is None or absent."""

    name: str
    source: str
    #: by "camera" and "projector": c_mm, x0_mm, y0_mm, A1 … A6, residual_rms_um (x, y)
    devices: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    stations: int | None = None
    image_points: int | None = None
    object_sigma_rms_um: tuple[float, ...] | None = None
    #: by (method, angle in degrees): r.m.s. deviation of the plane-table
    rms_mm: Mapping[tuple[str, float], float] = field(default_factory=dict)
    max_mm: tuple[float, float] | None = None  #: least and greatest of the published maxima

    def parameter(self, kind: str | None, key: str) -> float | None:
        """Give a device's published parameter (a key of `devices`)."""
        value = self.devices.get(kind or "", {}).get(key)
        return None if value is None else float(value)

    def residual_um(self, kind: str | None, axis: int) -> float | None:
        """Give a device's published r.m.s. residual in µm, axis 0 for x and 1 for y."""
        value = self.devices.get(kind or "", {}).get("residual_rms_um")
        return None if value is None else float(value[axis])

    def plane_rms_mm(self, method: Method, angle_deg: float | None) -> float | None:
        """Give the published r.m.s. deviation of the plane-table at an angle, mm; angles agree within 0.05°."""
        if angle_deg is None:
            return None
        for (name, angle), rms in self.rms_mm.items():
            if name == method and abs(angle - angle_deg) < 0.05:
                return rms
        return None


def published_names() -> list[str]:
    """Names under which published results are known: the files of `resources/reference`."""
    return sorted(f.name.removesuffix(".json") for f in resource("reference").iterdir() if f.name.endswith(".json"))


def read_published(name: str) -> Published:
    """Read published results by name."""
    if name not in published_names():
        raise InputError(
            "project.json", f"reference is {name!r}", f"leave it out or use one of: {', '.join(published_names())}"
        )
    data = json.loads(resource("reference", f"{name}.json").read_text(encoding="utf-8"))
    table = data.get("plane_table", {})
    angles = table.get("angle_deg", [])
    rms = {
        (method, float(angle)): float(value)
        for method, values in table.get("rms_mm", {}).items()
        for angle, value in zip(angles, values, strict=True)
    }
    sigma, most = data.get("object_sigma_rms_um"), table.get("max_mm")
    return Published(
        name=data["name"],
        source=data["source"],
        devices=data.get("devices", {}),
        stations=data.get("stations"),
        image_points=data.get("image_points"),
        object_sigma_rms_um=None if sigma is None else tuple(sigma),
        rms_mm=rms,
        max_mm=None if most is None else (float(most[0]), float(most[1])),
    )
