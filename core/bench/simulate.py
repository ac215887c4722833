"""From a scenario to a project on disk, as a rig would have left it, with the truth beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from core.atomic import undone_on_failure
from core.bench.experiment import Experiment, Shot
from core.bench.faults import fault
from core.bench.scenarios import experiment
from core.bench.truth import true_targets
from core.errors import InputError
from core.geometry import Pose
from core.model import Interior, Seed, Subject
from core.parallel import THREADS
from core.patterns import Pattern, SequenceSpec
from core.progress import SILENT, Progress
from core.project import write_image, write_json, write_picks, write_project, write_testfield
from core.project.captures import write_capture_json
from core.project.images import Image


def simulate(
    out: Path,
    scenario: str = "paper",
    seed: int = 0,
    progress: Progress = SILENT,
    *,
    faults: Mapping[str, Sequence[str]] | None = None,
    sequence: SequenceSpec | None = None,
) -> Path:
    """Simulate a whole experiment, one of `scenarios()`, and write it as a project; equal seeds give equal files.

    Parameters
    ----------
    out : Path
        The project's folder; made if need be. It must not hold a project yet.
    faults : mapping
        Names of faults to switch on, by capture.
    sequence : SequenceSpec, optional
        What the projector shows in every capture; without it what the scenario says.

    Returns
    -------
    project : Path
        Holds project.json, testfield.csv, plate.csv, captures/ and truth.json: what is really so, for tests and for
        comparison only.

    Raises
    ------
    InputError
        For an unknown scenario, capture or fault, or a folder that holds a project already.
    Cancelled
        Nothing is left of it then, nor where anything else fails.
    """
    e = experiment(scenario, seed, sequence)
    wrong = faults or {}
    for name, fault_names in wrong.items():
        e.shot(name)
        for fault_name in fault_names:
            fault(fault_name)
    out = Path(out)
    if (out / "project.json").exists():
        raise InputError(out, "holds a project already", "choose a new folder or remove that one")
    with undone_on_failure(out):
        for name, testfield in e.testfields.items():
            write_testfield(out / name, testfield, f"nominal targets, {e.plan.title}")
        with ThreadPoolExecutor(THREADS) as pool:
            for k, shot in enumerate(e.shots):
                progress(k / len(e.shots), f"simulating {shot.name}")
                _write_shot(out / "captures" / shot.name, e, shot, wrong.get(shot.name, ()), pool, progress)
        write_json(out / "truth.json", truth_of(e))
        extra: dict[str, Any] = {} if e.plan.reference is None else {"reference": e.plan.reference}
        names = [f"captures/{shot.name}" for shot in e.shots]
        cameras = {name: view.rig.camera for name, view in e.views.items()}
        lamps = {name: light.rig.projector for name, light in e.lights.items()}
        write_project(out, e.plan.title, cameras, lamps, e.scale, names, sequence=sequence, **extra)
    progress(1.0, "simulated")
    return out


def _write_shot(
    folder: Path, e: Experiment, shot: Shot, faults: Sequence[str], pool: ThreadPoolExecutor, progress: Progress
) -> None:
    quiet = Progress(cancelled=progress.cancelled)
    named: list[tuple[str, Pattern, Image]] = []
    devices: list[dict[str, str]] = []
    seeds: list[Seed] = []
    lights, cameras = e.lights, e.views
    for lamp, light in lights.items():
        for camera, view in light.views.items():
            seen = view.shot(shot.name)
            frames = view.take(seen, faults, progress=quiet)
            names = {"camera": camera} if len(cameras) > 1 else {}
            names |= {"projector": lamp} if len(lights) > 1 else {}
            prefix = "".join(f"{name}-" for name in names.values())
            named += [(f"{prefix}{k:03d}{e.plan.ending}", pattern, image) for k, (pattern, image) in enumerate(frames)]
            devices += [names] * len(frames)
            if light is e:
                seeds += [replace(seed, camera=names.get("camera", "")) for seed in seen.seeds]
    # a simulation can be repeated: no need to wait for the disk after every frame
    for job in [pool.submit(write_image, folder / name, image, False) for name, _, image in named]:
        job.result()
    if seeds:
        write_picks(folder / "picks.json", seeds)
    write_capture_json(
        folder,
        Subject(shot.role, shot.name, shot.z_mm, shot.angle_deg, shot.testfield),
        [(name, pattern) for name, pattern, _ in named],
        more=devices if any(devices) else None,
    )


def truth_of(e: Experiment) -> dict[str, Any]:
    """Everything that is true of an experiment, as plain numbers: the content of truth.json."""
    rig = e.rig
    boards = {s.testfield: s.scene.board.targets for s in e.shots if s.testfield is not None}
    return {
        "format": "stripe-truth",
        "version": 1,
        "scenario": e.plan.name,
        "seed": e.seed,
        "camera": _interior(rig.camera_interior),
        "projector": _interior(rig.projector_interior),
        "projector_from_camera": _pose(rig.projector_from_camera),
        **_views(e),
        "noise": {
            "read": rig.sensor.read_noise,
            "shot_gain": rig.sensor.shot_gain,
            "jitter_px": rig.sensor.jitter_px,
            "bits": rig.sensor.bits,
        },
        "testfields": {
            name: [
                {"row": int(r), "col": int(c), "xyz_mm": xyz.tolist()}
                for r, c, xyz in zip(t.row, t.col, t.xyz_mm, strict=True)
            ]
            for name, t in boards.items()
            if t is not None
        },
        "captures": {shot.name: _capture(e, shot) for shot in e.shots},
    }


def _views(e: Experiment) -> dict[str, Any]:
    """What is true of every camera where there are several, and of every further projector, under its name."""
    found = {}
    if e.plan.others:
        for name, view in e.views.items():
            moved = view.rig.camera_from_volume @ e.rig.camera_from_volume.inverse()
            poses = {"projector_from_camera": _pose(view.rig.projector_from_camera), "camera_from_first": _pose(moved)}
            found[name] = {**_interior(view.rig.camera_interior), **poses}
    if e.plan.lamps:
        for name, light in e.lights.items():
            pose = {"projector_from_camera": _pose(light.rig.projector_from_camera)}
            found[name] = {**_interior(light.rig.projector_interior), **pose}
    return found


def _capture(e: Experiment, shot: Shot) -> dict[str, Any]:
    pose = shot.scene.camera_from_board
    truth: dict[str, Any] = {"role": shot.role, "camera_from_board": _pose(pose)}
    if shot.testfield is not None:
        t = true_targets(e.rig, shot.scene)
        truth["visible"] = [[int(r), int(c)] for r, c in zip(t.row[t.visible], t.col[t.visible], strict=True)]
    if shot.name in e.depth_true_mm:
        truth["z_mm"] = e.depth_true_mm[shot.name]
    if shot.role == "plane":
        normal = pose.rotation[:, 2]
        truth["plane"] = [*normal.tolist(), float(normal @ pose.translation_mm)]  # n . X = d, camera's frame
    for sphere in shot.scene.spheres:
        truth["sphere"] = {"centre_mm": pose.apply(sphere.centre_mm).tolist(), "radius_mm": sphere.radius_mm}
    for block in shot.scene.blocks:
        truth["step_mm"] = block.upper_mm[2] - block.lower_mm[2]
    return truth


def _interior(interior: Interior) -> dict[str, float]:
    c, x0, y0, *a = interior.vector.tolist()
    return {"c_mm": c, "x0_mm": x0, "y0_mm": y0, **{f"A{k}": v for k, v in enumerate(a, 1)}, "r0_mm": interior.r0_mm}


def _pose(pose: Pose) -> dict[str, Any]:
    return {"rotation": np.asarray(pose.rotation).tolist(), "translation_mm": np.asarray(pose.translation_mm).tolist()}
