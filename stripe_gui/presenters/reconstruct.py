"""The points of a capture as maps (shaded height, height, depth, sigma) and as a cloud in space."""

from __future__ import annotations

import json
from dataclasses import dataclass
from math import ceil, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QCoreApplication

from core.evaluate import heights
from core.model import Capture, Floats, Method
from core.pipeline import METHODS, points_file
from core.pipeline.differences import differences
from core.pipeline.inputs import reconstructed_from
from core.pipeline.runs import calibration_hashes
from core.progress import SILENT, Progress
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.maps import MapView, hill_shade, lit_colours, percentile, round_up
from stripe_gui.presenters.status import graph_of
from stripe_gui.widgets.colours import lookup

translate = QCoreApplication.translate
KINDS = ("shaded", "height", "depth", "sigma")
MOST_DRAWN = 400_000  # points in space: more turn slowly where the processor draws them


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
        "shaded": translate("Reconstruct", "Shaded height"),
        "height": translate("Reconstruct", "Height over the mean plane"),
        "depth": translate("Reconstruct", "Depth Z"),
        "sigma": translate("Reconstruct", "σ of Z"),
        "space": translate("Reconstruct", "Points in space"),
    }[kind]


def methods_of(folder: ProjectFolder) -> list[Method]:
    """Give the methods that the project has a calibration of."""
    return [m for m in METHODS if folder.result_file(f"{m}.npz").exists()]


def points_of(folder: ProjectFolder, capture: str, method: Method, pair: tuple[str, str]) -> tuple[str, Path]:
    """Say whether a capture's points are there: "none", "stale" or "current"; the core knows. Give the file, too."""
    entry = folder.entry(capture)
    if entry is None or entry.capture is None:
        return "none", Path()
    path = points_file(folder.project, entry.capture, method, *pair)
    if not path.exists():
        return "none", path
    if path == points_file(folder.project, entry.capture, method):
        state = graph_of(folder).points(entry.capture, method).state
    else:
        now = reconstructed_from(folder.project, entry.capture, calibration_hashes(folder.project, [method]))
        then = json.loads(path.with_suffix(".json").read_text())["made_from"]
        state = "outdated" if differences(then, now) else "current"
    return ("current" if state == "current" else "stale"), path


def devices_of(capture: Capture | None) -> dict[str, str]:
    """Name the camera and the projector of a series, as the core wants them."""
    return {"camera": capture.camera, "projector": capture.projector} if capture is not None else {}


def load_points(path: Path, progress: Progress = SILENT) -> Points:
    """Read points that `work.reconstruct` kept."""
    progress.check()
    with np.load(path, allow_pickle=False) as stored:
        whole = stored.get("sigma", stored.get("sigma_xyz"))
        sigma = stored.get("sigma_depth") if whole is None else whole[..., 2]
        return Points(stored["xyz"], sigma)


def map_view(points: Points, kind: str, progress: Progress = SILENT) -> MapView | None:
    """Make a map; None where the points do not have it."""
    z = points.xyz_mm[..., 2]
    if kind == "sigma":
        if points.sigma_mm is None:
            return None
        return MapView(points.sigma_mm, (0.0, round_up(percentile(points.sigma_mm, 98))), "map", "mm", 4)
    if kind == "depth":
        return MapView(z, (percentile(z, 1), percentile(z, 99)), "map", "mm", 3)
    height = heights(points.xyz_mm)
    progress.check()
    levels = (percentile(height, 1), percentile(height, 99))
    colours = lit_colours(height, levels, lookup("map"), hill_shade(points.xyz_mm)) if kind == "shaded" else None
    return MapView(height, levels, "map", "mm", 3, colours)


@dataclass(frozen=True)
class Cloud:
    """Points to be drawn in space: places, shape (n, 3), about their middle, right, away and up from the camera, mm."""

    places_mm: NDArray[np.float32]
    colours: NDArray[np.float32]  # (n, 4), 0 to 1
    size_mm: float  # of the cloud, edge to edge
    spacing_mm: float  # between neighbours


def cloud_of(points: Points, progress: Progress = SILENT) -> Cloud:
    """Choose so many points that drawing stays fluent, coloured by height and lit."""
    view = map_view(points, "shaded", progress)
    step = max(1, ceil(sqrt(points.count / MOST_DRAWN)))
    assert view is not None
    assert view.colours is not None  # a shaded map has them
    xyz, colours = points.xyz_mm[::step, ::step], view.colours[::step, ::step]
    valid = np.isfinite(xyz).all(axis=-1)
    places = np.asarray(xyz[valid] @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), np.float32)  # X, -Z, Y
    if not len(places):
        return Cloud(places, np.zeros((0, 4), np.float32), 1.0, 1.0)
    low, high = np.percentile(places, (1, 99), axis=0)
    size = float(np.linalg.norm(high - low)) or 1.0
    apart = np.linalg.norm(np.diff(xyz, axis=1), axis=-1)
    apart = apart[np.isfinite(apart)]
    spacing = float(np.median(apart)) if len(apart) else size / 100
    middle = ((low + high) / 2).astype(np.float32)
    return Cloud(places - middle, (colours[valid] / 255).astype(np.float32), size, spacing)
