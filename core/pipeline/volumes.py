"""Calibrations over the working volume, and without single captures: how sure each is, by how much two differ."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from core.errors import InputError
from core.figures import verdict_figures
from core.geometry import pair_named, pair_of
from core.model import (
    Adjustment,
    Array,
    Concern,
    Network,
    Pair,
    PhotogrammetricCalibration,
    Project,
    Verdict,
    verdict_of,
)
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.method import ADJUSTMENT
from core.pipeline.runs import archive_of, calibration_file
from core.progress import SILENT, Progress
from core.project import load_archive, read_project


def volume_figures(
    project: Project, run: int | None = None, camera: str = "", projector: str = ""
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Say how sure a calibration is of the points it gives and of where its devices see them, by depth.

    Figures: of several devices "camera" and "projector"; under "depths" for every depth r.m.s. sigmas over the grid:
    `sigma_mm` of a point's place in the camera's frame, `form_sigma_mm` after the best movement of all points as one,
    and of both devices' images `camera_px` and `projector_lines`, after the best place of the device. Noise of a
    capture is no part of them. The "verdict" is on the calibration: unless it is passed, its sigmas tell too little.
    Maps: the same over the grid, (depths, rows, columns), NaN where the projector lights nothing; `uv`, `xyz_mm`. A
    calibration that tells no sigmas is an InputError.
    """
    calibration, adjustment = _kept(project, run)
    pair, depths, named = _pair_of(calibration, adjustment, camera, projector)
    if not pair.covariance.any():
        seen = "the calibration is another program's, which tells no sigmas"
        raise InputError(project.path, seen, "calibrate here, or import a file that has parameter_covariance")
    figures, maps = _figures_of(pair, depths, named)
    return {**figures, "verdict": verdict_figures(calibration.verdict)}, maps


def volume_of_calibration(
    calibration: PhotogrammetricCalibration, adjustment: Adjustment | None
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Say the same of the first pair of a calibration at hand, which has sigmas."""
    return _figures_of(*_pair_of(calibration, adjustment, "", ""))


def _figures_of(pair: Pair, depths: Array, named: dict[str, str]) -> tuple[dict[str, Any], dict[str, Array]]:
    from core.checks.volume import form_of_fields, image_fields, point_fields, sigmas_of, volume_of

    volume = volume_of(pair, depths)
    fields, split = point_fields(pair, volume), len(pair.camera.interior.vector)
    end = split + len(pair.projector.interior.vector)
    lit = pair.projector_from_camera.apply(volume.xyz_mm)
    values = {
        "sigma_mm": sigmas_of(fields),
        "form_sigma_mm": sigmas_of(form_of_fields(fields, volume.xyz_mm)),
        "camera_px": sigmas_of(image_fields(pair.camera, pair.covariance[:split, :split], volume.xyz_mm)),
        "projector_lines": sigmas_of(image_fields(pair.projector, pair.covariance[split:end, split:end], lit)),
    }
    maps = {name: volume.grid(v) for name, v in {**values, "uv": volume.uv, "xyz_mm": volume.xyz_mm}.items()}
    return {**named, "depths": _by_depth(depths, {name: maps[name] for name in values})}, maps


def difference_figures(
    project: Project, other: Path | int, run: int | None = None, camera: str = "", projector: str = ""
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Set a calibration beside another one of the same devices, over the first one's working volume.

    `other` is another project, or a kept run of this one; `run` is taken in place of the calibration in use. Figures:
    `significant` by the chi-square test of `statistic` with `dof` against `limit`, both calibrations taken as
    independent, None where one of them tells no sigmas; under "depths" r.m.s. and largest `difference_mm`, its
    `sigma_mm`, where it is known, the one over the other as `in_sigmas`, and the same of `form`, what is left after the
    best movement of all points as one. Maps: the same of every node, and `shift_mm` and `form_shift_mm` as vectors.
    """
    from core.checks.volume import difference

    calibration, adjustment = _kept(project, run)
    pair, depths, named = _pair_of(calibration, adjustment, camera, projector)
    names = camera or calibration.camera_name, projector or calibration.projector_name
    second = pair_named(_kept(project, other)[0], *names) if isinstance(other, int) else _of_folder(other, pair, names)
    found = difference(pair, second, depths)
    sizes = {"difference_mm": np.linalg.norm(found.shift_mm, axis=1), "form_mm": np.linalg.norm(found.form_mm, axis=1)}
    test = {"statistic": found.statistic, "dof": found.dof, "limit": found.limit, "significant": found.significant}
    if pair.covariance.any() and second.covariance.any():
        sizes |= {"sigma_mm": found.sigma_mm, "form_sigma_mm": found.form_sigma_mm}
        sizes["in_sigmas"] = sizes["difference_mm"] / sizes["sigma_mm"]
        sizes["form_in_sigmas"] = sizes["form_mm"] / sizes["form_sigma_mm"]
    else:
        test = {**dict.fromkeys(test), "dof": 0}
    vectors = {"shift_mm": found.shift_mm, "form_shift_mm": found.form_mm}
    places = {"uv": found.volume.uv, "xyz_mm": found.volume.xyz_mm}
    maps = {name: found.volume.grid(values) for name, values in {**sizes, **vectors, **places}.items()}
    return {**named, **test, "depths": _by_depth(depths, {name: maps[name] for name in sizes})}, maps


def left_out_figures(project: Project, run: int | None = None, progress: Progress = SILENT) -> list[dict[str, Any]]:
    """Leave the captures of a calibration out in turn, see `core.calibrate.leave_captures_out`."""
    from core.calibrate import leave_captures_out

    network = _network(project, run)
    return [{**asdict(one), "off": one.off} for one in leave_captures_out(network, progress)]


def left_out_verdict(found: list[dict[str, Any]]) -> Verdict:
    """Judge the captures of `left_out_figures`."""
    concerns = [
        Concern(
            "doubtful",
            f"{one['capture']} does not fit the others: F {one['statistic']:.2f}, limit {one['limit']:.2f}; look at "
            "its residuals, then capture it again or leave it out",
        )
        for one in found
        if one["off"]
    ]
    untested = ", ".join(one["capture"] for one in found if not np.isfinite(one["limit"]))
    if untested:
        concerns.append(Concern("doubtful", f"{untested}: too much is determined by this alone; capture more poses"))
    most = max(one["statistic"] / one["limit"] for one in found)
    return verdict_of(
        concerns, [f"all {len(found)} captures are as the others predict; F is at most {most:.0%} of its limit"]
    )


def next_pose_figures(project: Project, run: int | None = None, progress: Progress = SILENT) -> list[dict[str, Any]]:
    """Give the poses of the board to capture next, see `core.calibrate.next_poses`."""
    from core.calibrate import next_poses

    return [{**asdict(one), "words": one.words} for one in next_poses(_network(project, run), progress=progress)]


def _network(project: Project, run: int | None) -> Network:
    """Give the network that a calibration was adjusted from."""
    adjustment = _kept(project, run)[1]
    if adjustment is None or not len(adjustment.residuals):
        raise InputError(project.path, "the calibration is another program's", "calibrate here first")
    return adjustment.network


def _by_depth(depths: Array, maps: dict[str, Array]) -> list[dict[str, Any]]:
    """Give r.m.s. and largest values of maps at every depth that has any."""
    rows = []
    for k, (depth, *layers) in enumerate(zip(depths, *maps.values(), strict=True)):
        if np.isfinite(layers[0]).any():
            rms = {name: float(np.sqrt(np.nanmean(v**2))) for name, v in zip(maps, layers, strict=True)}
            most = {f"{name}_max": float(np.nanmax(v)) for name, v in zip(maps, layers, strict=True)}
            count = int(np.isfinite(layers[0]).sum())
            rows.append({"layer": k, "depth_mm": float(depth), "nodes": count, **rms, **most})
    return rows


def _pair_of(
    calibration: PhotogrammetricCalibration, adjustment: Adjustment | None, camera: str, projector: str
) -> tuple[Pair, Array, dict[str, str]]:
    """Give a pair of a calibration, the depths of its working volume, and its names where there are several."""
    from core.checks.volume import working_depths

    pair = pair_of(calibration, camera, projector)
    camera, projector = camera or calibration.camera_name, projector or calibration.projector_name
    named = {"camera": camera, "projector": projector} if len(calibration.devices) > 2 else {}
    return pair, working_depths(pair, adjustment, camera), named


def _kept(project: Project, run: int | None) -> tuple[PhotogrammetricCalibration, Adjustment | None]:
    """Read the calibration in use, or that of a kept run, with its adjustment."""
    if run is None:
        calibration, path = photogrammetric_calibration(project), calibration_file(project, ADJUSTMENT)
    else:
        kept = archive_of(project, "photogrammetric", "photogrammetric.npz", run)
        if kept is None:
            raise InputError(
                project.path, f"no photogrammetric calibration of run {run}", "`stripe-core runs` lists all"
            )
        calibration = load_archive(kept, PhotogrammetricCalibration)
        path = archive_of(project, "photogrammetric", ADJUSTMENT, run)
    return calibration, None if path is None else load_archive(path, Adjustment)


def _of_folder(folder: Path, like: Pair, names: tuple[str, str]) -> Pair:
    """Give the pair of another project's calibration in use; its devices must be of the same size."""
    other = pair_named(photogrammetric_calibration(read_project(folder)), *names)
    for name, one, two in (("camera", like.camera, other.camera), ("projector", like.projector, other.projector)):
        sizes = [f"{d.spec.width} x {d.spec.height} px" for d in (one, two)]
        if sizes[0] != sizes[1]:
            raise InputError(folder, f"its {name} has {sizes[1]}, the other one {sizes[0]}", "compare one rig's")
    return other
