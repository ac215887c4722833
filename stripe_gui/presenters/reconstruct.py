"""The points of a capture as maps: depth, shaded surface, sigma."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QCoreApplication

from core.model import Floats, Method
from core.pipeline import METHODS
from core.progress import SILENT, Progress
from stripe_gui.presenters.decode import MapView, percentile, round_up
from stripe_gui.presenters.folder import ProjectFolder, written_ns
from stripe_gui.presenters.work import cloud_file

translate = QCoreApplication.translate
KINDS = ("shaded", "depth", "sigma")


@dataclass(frozen=True)
class Points:
    """Points in the camera's frame, shape (H, W, 3) in mm, and the sigma of their Z where it is known, (H, W)."""

    xyz_mm: Floats
    sigma_mm: Floats | None

    @property
    def count(self) -> int:
        """How many pixels have a point."""
        return int(np.count_nonzero(np.isfinite(self.xyz_mm[..., 2])))


def kind_name(kind: str) -> str:
    """Give a map's name in the operator's language."""
    return {
        "shaded": translate("Reconstruct", "Shaded surface"),
        "depth": translate("Reconstruct", "Depth Z"),
        "sigma": translate("Reconstruct", "σ of Z"),
    }[kind]


def methods_of(folder: ProjectFolder) -> list[Method]:
    """Give the methods that the project has a calibration of."""
    return [m for m in METHODS if folder.result_file(f"{m}.npz").exists()]


def points_state(folder: ProjectFolder, capture: str, method: str) -> str:
    """Say whether a capture's points are there: "none", "stale" (calibrated or captured anew since) or "current"."""
    written = written_ns(cloud_file(folder.project, capture, method))
    entry = folder.entry(capture)
    if written is None or entry is None:
        return "none"
    newest = max(entry.changed_ns, written_ns(folder.result_file(f"{method}.npz")) or 0)
    return "current" if written >= newest else "stale"


def load_points(path: Path, progress: Progress = SILENT) -> Points:
    """Read points that `work.reconstruct` kept."""
    progress.check()
    with np.load(path, allow_pickle=False) as stored:
        sigma = stored["sigma"][..., 2] if "sigma" in stored else stored.get("sigma_depth")
        return Points(stored["xyz"], sigma)


def map_view(points: Points, kind: str) -> MapView | None:
    """Make a map; None where the points do not have it."""
    z = points.xyz_mm[..., 2]
    if kind == "sigma":
        if points.sigma_mm is None:
            return None
        return MapView(points.sigma_mm, (0.0, round_up(percentile(points.sigma_mm, 98))), "map", "mm", 4)
    if kind == "depth":
        return MapView(z, (percentile(z, 1), percentile(z, 99)), "map", "mm", 3)
    return MapView(shade(points.xyz_mm), (0.0, 1.0), "grey", "", 2)


def shade(xyz_mm: NDArray) -> NDArray[np.float32]:
    """Light the surface from the upper left of the camera, shape (H, W), 0 to 1; NaN without a neighbour."""
    du = np.full_like(xyz_mm, np.nan)
    dv = np.full_like(xyz_mm, np.nan)
    du[:, 1:-1] = xyz_mm[:, 2:] - xyz_mm[:, :-2]
    dv[1:-1] = xyz_mm[2:] - xyz_mm[:-2]
    normal = np.cross(dv, du)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    normal *= np.where(normal[..., 2:] < 0, -1, 1)  # towards the camera
    light = np.array([-0.5, 0.5, 0.7], np.float32)
    lit = normal @ (light / np.linalg.norm(light))
    return np.clip(lit, 0.0, 1.0).astype(np.float32)
