"""The points of a capture as maps (shaded height, height, depth, sigma) and as a cloud in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, sqrt
from pathlib import Path

import numpy as np
from PySide6.QtGui import QColor

from core.evaluate import heights
from core.fields import kept_object
from core.lazy import dataclass
from core.model import Capture, Floats, Method, PointCloud, Verdict
from core.pipeline.folders import points_file
from core.progress import SILENT, Progress
from stripe_gui.presenters.folder import CaptureEntry, ProjectFolder
from stripe_gui.presenters.maps import MapView, hill_shade, lit_colours, percentile, round_up
from stripe_gui.presenters.space import Scene, seen
from stripe_gui.presenters.status import graph_of
from stripe_gui.presenters.told import translate
from stripe_gui.widgets.colours import lookup

KINDS = ("shaded", "height", "depth", "sigma", "space")
JOINT_KINDS = ("joint-depth", "joint-source", "joint-sight", "joint-sigma")
PATCHES = ("#2f7fd0", "#e08a1e", "#3aa655", "#c94f8a", "#8a63d2", "#7a7a7a")  # told apart on light and dark
MOST_DRAWN = 400_000  # points in space: more turn slowly where the processor draws them


@dataclass(frozen=True)
class Points:
    """Points in the camera's frame, shape (H, W, 3) in mm, the sigma of their Z where it is known, (H, W), and what is
    to be thought of them, where somebody judged them.
    """

    xyz_mm: Floats
    sigma_mm: Floats | None
    verdict: Verdict | None = None

    @property
    def count(self) -> int:
        return int(np.count_nonzero(np.isfinite(self.xyz_mm[..., 2])))


def kind_name(kind: str) -> str:
    """Give the name of a map, or of a way to colour the points of all cameras, in the operator's language."""
    return {
        "shaded": translate("Reconstruct", "Shaded height"),
        "height": translate("Reconstruct", "Height over the mean plane"),
        "depth": translate("Reconstruct", "Depth Z"),
        "sigma": translate("Reconstruct", "σ of Z"),
        "space": translate("Reconstruct", "Points in space"),
        "joint-depth": translate("Reconstruct", "All cameras: depth Z"),
        "joint-source": translate("Reconstruct", "All cameras: by camera"),
        "joint-sight": translate("Reconstruct", "All cameras: by how they are seen"),
        "joint-sigma": translate("Reconstruct", "All cameras: σ of Z"),
    }[kind]


def points_of(folder: ProjectFolder, capture: str, method: Method, pair: tuple[str, str]) -> tuple[str, Path]:
    """Say whether a capture's points are there: "none", "stale" or "current"; the core knows. Give the file, too."""
    entry = folder.entry(capture)
    if entry is None or entry.capture is None:
        return "none", Path()
    path = points_file(folder.project, entry.capture, method, *pair)
    state = graph_of(folder).points(entry.capture, path).state
    return {"absent": "none", "current": "current"}.get(state, "stale"), path


def devices_of(capture: Capture | None) -> dict[str, str]:
    """Name the camera and the projector of a series, as the core wants them."""
    return {"camera": capture.camera, "projector": capture.projector} if capture is not None else {}


def cameras_of(entry: CaptureEntry | None) -> list[str]:
    """Name the cameras that took a capture."""
    whole = None if entry is None else entry.capture
    return [] if whole is None else list(dict.fromkeys(camera for camera, _ in whole.pairs))


def load_points(path: Path, progress: Progress = SILENT) -> Points:
    """Read points that `work.reconstruct` kept."""
    progress.check()
    with np.load(path, allow_pickle=False) as stored:
        whole = stored.get("sigma", stored.get("sigma_xyz"))
        sigma = stored.get("sigma_depth") if whole is None else whole[..., 2]
        return Points(stored["xyz"], sigma, _kept_verdict(kept_object(path.with_suffix(".json")).get("verdict")))


def _kept_verdict(kept: object) -> Verdict | None:
    """Take a verdict from the file beside points; None where the file, which anybody may have written, has none."""
    found = kept if isinstance(kept, dict) else {}
    state, because = found.get("state"), found.get("because")
    sentences = [text for text in because if isinstance(text, str)] if isinstance(because, list) else []
    if state not in ("passed", "doubtful", "failed") or sentences != because:
        return None
    return Verdict(state, tuple(sentences))


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


def space_of(points: Points, progress: Progress = SILENT) -> Scene:
    """Choose so many points that drawing stays fluent, coloured by height and lit."""
    view = map_view(points, "shaded", progress)
    step = max(1, ceil(sqrt(points.count / MOST_DRAWN)))
    assert view is not None
    assert view.colours is not None  # a shaded map has them
    xyz, colours = points.xyz_mm[::step, ::step], view.colours[::step, ::step]
    valid = np.isfinite(xyz).all(axis=-1)
    apart = np.linalg.norm(np.diff(xyz, axis=1), axis=-1)
    apart = apart[np.isfinite(apart)]
    return Scene(seen(xyz[valid]), colours[valid, :3], spacing_mm=float(np.median(apart)) if len(apart) else 0.0)


def joint_scene(cloud: PointCloud, kind: str, cameras: Sequence[str]) -> tuple[Scene, str]:
    """Colour the points of all cameras, and say what the colours mean, as rich text."""
    xyz, step = cloud.xyz_mm[0], max(1, ceil(cloud.xyz_mm.shape[1] / MOST_DRAWN))
    assert cloud.sigma_mm is not None
    assert cloud.sight is not None
    assert cloud.source is not None
    if kind in ("joint-source", "joint-sight"):
        of = cloud.source[0] if kind == "joint-source" else cloud.sight[0]
        table = np.array([(c.red(), c.green(), c.blue()) for c in map(QColor, PATCHES)], np.uint8)
        colours = table[of % len(PATCHES)]
        words = dict(enumerate(cameras)) if kind == "joint-source" else sight_words()
        counts = np.bincount(of, minlength=max(words) + 1)
        text = "&emsp;".join(
            f'<span style="color:{PATCHES[i % len(PATCHES)]}">■</span> {word} {counts[i]}'
            for i, word in words.items()
            if counts[i]
        )
    else:
        z = cloud.sigma_mm[0, :, 2] if kind == "joint-sigma" else xyz[:, 2]
        low, high = (0.0, round_up(percentile(z, 98))) if kind == "joint-sigma" else np.nanpercentile(z, (1, 99))
        index = np.clip((z - low) / ((high - low) or 1.0) * 255, 0, 255).astype(np.uint8)
        colours = lookup("map")[index]
        text = translate("Reconstruct", "dark {low:g} to bright {high:g} mm, median {median:.4g} mm")
        text = text.format(low=round(float(low), 3), high=round(float(high), 3), median=float(np.median(z)))
    size = float(np.linalg.norm(np.ptp(np.percentile(xyz, (5, 95), axis=0), axis=0)))
    return Scene(seen(xyz[::step]), colours[::step], spacing_mm=size / sqrt(len(xyz) / step)), text


def merged_scene(cloud: PointCloud, sources: Sequence[tuple[str, str]]) -> tuple[Scene, str]:
    """Colour the points of several captures: those of one by it, what several have made in one colour."""
    several = len({camera for camera, _ in sources if " + " not in camera}) > 1
    named = [f"{capture}, {camera}" if several else capture for camera, capture in sources]
    alone = [k for k, (camera, capture) in enumerate(sources) if " + " not in camera + capture]
    index = np.full(len(sources), len(alone))
    index[alone] = np.arange(len(alone))
    assert cloud.source is not None
    words = [*(named[k] for k in alone), translate("Reconstruct", "by several")]
    return joint_scene(replace(cloud, source=index[cloud.source]), "joint-source", words)


def sight_words() -> dict[int, str]:
    """Say how points were seen, by `core.reconstruct.Sight`."""
    from core.reconstruct import Sight  # only now: its room loads the kernels

    return {
        Sight.OWN: translate("Reconstruct", "by one camera"),
        Sight.JOINT: translate("Reconstruct", "by several"),
        Sight.HIDDEN: translate("Reconstruct", "hidden from others"),
        Sight.DISAGREE: translate("Reconstruct", "rays disagree"),
        Sight.TEXTURE: translate("Reconstruct", "by texture"),
    }
