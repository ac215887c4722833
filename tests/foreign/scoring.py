"""What the program's commands say about a project, against what its laboratory knows."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.cli import main
from tests.foreign.projects import FLIP, Laboratory, between
from tests.foreign.scenes import Surface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Points:
    """Depths of the relief: valid part of what is lit, r.m.s. error, over its sigma, and what pixels do not share."""

    valid: float
    error_mm: float
    ratio: float
    noise_ratio: float  # of what a cubic in place and depth, as calibrations err by, leaves, over the phase's noise


@dataclass(frozen=True)
class Score:
    """Errors over stated sigmas: of parameters (r.m.s. over devices), of points, of planes."""

    verdict: str
    stations: int
    image_points: int
    parameters: dict[str, float]  # r.m.s. of error/sigma by device
    worst: tuple[str, float]
    base_mm: float  # largest error of a device's position against the base
    points: dict[str, Points]  # by camera
    planes: dict[str, float]  # observed over predicted r.m.s.


def command(*words: str | Path, out: Path | None = None) -> Any:
    """Run a command in this process; its figures."""
    more = ["--json", str(out)] if out else []
    assert main([str(word) for word in words] + more) == 0, words
    return json.loads(out.read_text()) if out else None


def score(laboratory: Laboratory, folder: Path) -> Score:
    """Calibrate, evaluate and reconstruct by command, and compare."""
    made = folder.parent / f"{folder.name}-figures"
    made.mkdir(exist_ok=True)
    figures = command("calibrate", folder, "--method", "photogrammetric", out=made / "calibrate.json")
    figures = figures["photogrammetric"]
    ratios = {
        name: device_ratios(laboratory, name, figures["devices"][name])
        for name in (*laboratory.cameras, *laboratory.projectors)
    }
    rows = command("evaluate", folder, out=made / "evaluate.json")["planes"]
    planes = {
        " ".join(filter(None, (row["capture"], row.get("camera"), row.get("projector")))): row["rms_mm"]
        / row["predicted_rms_mm"]
        for row in rows
    }
    named = {f"{name}.{key}": ratio for name, all_ in ratios.items() for key, ratio in all_.items()}
    worst = max(named, key=lambda name: abs(named[name]))
    return Score(
        figures["verdict"]["state"],
        figures["stations"],
        figures["image_points"],
        {name: rms(np.array(list(all_.values()))) for name, all_ in ratios.items()},
        (worst, named[worst]),
        placed(laboratory, figures["orientations"]),
        {camera: points(laboratory, folder, made, camera) for camera in laboratory.cameras},
        planes,
    )


def device_ratios(laboratory: Laboratory, name: str, figures: dict[str, Any]) -> dict[str, float]:
    """(found - true) / sigma of the nine parameters of one device."""
    device = (laboratory.cameras | laboratory.projectors)[name]
    true = device.interior(figures["r0_mm"])
    return {key: (figures[key]["value"] - true[key]) / figures[key]["sigma"] for key in true}


def placed(laboratory: Laboratory, orientations: dict[str, Any]) -> float:
    """Largest error of a translation, mm."""
    devices = laboratory.cameras | laboratory.projectors
    errors = [
        np.abs(np.array(o["translation_mm"]) - between(devices[o["from"]], devices[name])[1]).max()
        for name, o in orientations.items()
    ]
    return float(max(errors))


def points(laboratory: Laboratory, folder: Path, made: Path, camera: str) -> Points:
    """The relief by one camera and the first projector."""
    file = made / f"relief-{camera}.npz"
    projector = next(iter(laboratory.projectors))
    more = [] if laboratory.single else ["--camera", camera, "--projector", projector, "--rays", "pair"]
    command("reconstruct", folder, "relief", *more, "--out", file)
    with np.load(file) as stored:
        xyz, sigma, noise = stored["xyz"], stored["sigma"], stored["sigma_depth"]
    view = laboratory.cameras[camera]
    world = laboratory.seen(laboratory.relief(), camera).points()
    true = view.place.to_own(world) @ FLIP
    lit = inside(laboratory, laboratory.relief(), world)
    good = np.isfinite(xyz[..., 2]) & lit
    z = xyz[..., 2][good] - true[..., 2][good]
    own = (z - smooth(z, xyz[good])) / noise[good]
    return Points(float(good.sum() / lit.sum()), rms(z), rms(z / sigma[..., 2][good]), rms(own))


def smooth(values: Array, xyz: Array) -> Array:
    """Cubic in three coordinates, fitted to values (n,) at points (n, 3)."""
    x = np.c_[np.ones(len(xyz)), (xyz - xyz.mean(axis=0)) / np.ptp(xyz, axis=0)]
    terms = np.stack([x[:, i] * x[:, j] * x[:, k] for i, j, k in combinations_with_replacement(range(4), 3)], axis=1)
    return terms @ np.linalg.lstsq(terms, values, rcond=None)[0]


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def inside(laboratory: Laboratory, surface: Surface, world: Array) -> NDArray[np.bool_]:
    """Where the first projector shines, away from its rim."""
    projector = next(iter(laboratory.projectors.values()))
    u, v = np.moveaxis(projector.image(world), -1, 0)
    rim = 4
    with np.errstate(invalid="ignore"):
        return (u > rim) & (u < projector.width - 1 - rim) & (v > rim) & (v < projector.height - 1 - rim)
