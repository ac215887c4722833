"""All devices corrected together: captures of a ball in closed form, by rigs drawn from what is known before."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from core.errors import TooLittleSeenError
from core.geometry import Pose, calibration_of, changed, project, ray_directions, rotation_vector_from_matrix
from core.model import AdjustedDevice, DeviceSpec, Interior, PhaseMap, PhotogrammetricCalibration
from core.orient import OrientOptions, correct_rig, find_motion
from core.pipeline.orient_rig import together_words
from core.reconstruct import seen_by_other

CAMERA, PROJECTOR = DeviceSpec(120, 96, (0.05, 0.05), 12.0), DeviceSpec(640, 640, (0.09, 0.09), 180.0)
PLACES = {"left": (-250.0, 10.0, 620.0), "right": (240.0, -20.0, 600.0), "top": (30.0, 230.0, 610.0)}
RADIUS_MM, NOISE = 250.0, 0.02  # of the ball; lines
PRIOR = OrientOptions(rotation_prior_rad=5e-4, shift_prior_mm=0.1, most_places=800)
TURN, SHIFT = 1e-4, 0.03  # sigmas of the calibration
Seen = dict[tuple[str, str], PhaseMap]


def looking(centre: tuple[float, float, float]) -> Pose:
    z = np.array(centre) / np.linalg.norm(centre)
    x = np.cross([0.0, 1.0, 0.0], z) / np.linalg.norm(np.cross([0.0, 1.0, 0.0], z))
    R = np.stack([x, np.cross(z, x), z])
    return Pose(R, -R @ np.array(centre))


def calibration() -> PhotogrammetricCalibration:
    """Three cameras round a projector, their errors independent."""
    places = {**PLACES, "projector": (20.0, -30.0, 640.0)}
    base = looking(places["left"])
    devices = {
        name: AdjustedDevice(spec, Interior(spec.nominal_c_mm), np.zeros(9), (0.0, 0.0), 0)
        for name, spec in [*((name, CAMERA) for name in PLACES), ("projector", PROJECTOR)]
    }
    poses = {name: looking(at) @ base.inverse() for name, at in places.items() if name != "left"}
    sigma = [0.002, 0.002, 0.002, *[0.0] * 6] * 3 + [0.02, 0.02, 0.02, *[0.0] * 6] + ([TURN] * 3 + [SHIFT] * 3) * 3
    return calibration_of(devices, poses, np.diag(sigma) ** 2, cameras=tuple(PLACES))


def seen_by(rig: PhotogrammetricCalibration, rng: np.random.Generator) -> Seen:
    """What every two devices see of the ball, whose nearest place is in the middle of all."""
    middle = looking(PLACES["left"]).apply([0.0, 0.0, -RADIUS_MM])
    poses = {"left": Pose(), **{name: known.device_from_base for name, known in rig.orientations.items()}}
    found: Seen = {}
    for name in PLACES:
        pixels = np.stack(np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height)), axis=-1)
        d, centre = ray_directions(CAMERA, rig.devices[name].interior, pixels), poses[name].apply(middle)
        half, square = d @ centre, np.sum(d * d, axis=-1)
        with np.errstate(invalid="ignore"):
            away = (half - np.sqrt(half**2 - square * (centre @ centre - RADIUS_MM**2))) / square
        X = poses[name].inverse().apply(d * away[..., None])
        uv = project(PROJECTOR, rig.devices["projector"].interior, X, poses["projector"])
        lit = np.all((uv > 0) & (uv < 639), axis=-1)
        uv = np.where(lit[..., None], uv + rng.normal(0, NOISE, uv.shape), np.nan).astype(np.float32)
        sigma, none = np.where(lit, np.float32(NOISE), np.float32(np.nan)), np.zeros(lit.shape, np.float32)
        flags = none.astype(np.uint8)
        found[name, "projector"] = PhaseMap(*np.moveaxis(uv, -1, 0), sigma, sigma, none, none, flags, camera=name)
    cameras = {(a, b): seen_by_other(found[a, "projector"], found[b, "projector"]) for a, b in combinations(PLACES, 2)}
    return found | cameras


def drifted(
    found: PhotogrammetricCalibration, rng: np.random.Generator, sigma: tuple[float, float]
) -> PhotogrammetricCalibration:
    """Turn and shift all devices but the first in its frame, the mean distance from it kept."""
    poses = {name: known.device_from_base for name, known in found.orientations.items()}
    turns, shifts = (rng.normal(0, s, (len(poses), 3)) for s in sigma)
    at = np.array([pose.origin_mm for pose in poses.values()])
    shifts -= at * np.sum(shifts * at) / np.sum(at * at)
    for name, turn, shift in zip(poses, turns, shifts, strict=True):
        pose = poses[name]
        R = pose.changed(np.array([*(-pose.rotation @ turn), 0, 0, 0])).rotation
        poses[name] = Pose(R, -R @ (pose.origin_mm + shift))
    moved = {name: replace(found.orientations[name], device_from_base=pose) for name, pose in poses.items()}
    return replace(found, orientations=moved)


def apart(one: PhotogrammetricCalibration, other: PhotogrammetricCalibration) -> np.ndarray:
    """The difference in the parameters of their covariance."""
    parts = [one.devices[name].interior.vector - other.devices[name].interior.vector for name in one.devices]
    for name, known in one.orientations.items():
        here, there = known.device_from_base, other.orientations[name].device_from_base
        parts += [rotation_vector_from_matrix(here.rotation @ there.rotation.T)]
        parts += [here.translation_mm - there.translation_mm]
    return np.concatenate(parts)


def test_all_devices_are_where_the_covariance_says() -> None:
    """Chi-squared of 30 is about half of that, for the noise of labels counts as often as there are cameras."""
    rng, known, squares, ratios = np.random.default_rng(4), calibration(), [], []
    C = known.covariance
    use = np.flatnonzero(np.diagonal(C) > 0)
    for _ in range(4):
        true = drifted(
            changed(known, np.sqrt(np.diagonal(C)) * rng.standard_normal(len(C))),
            rng,
            (PRIOR.rotation_prior_rad, PRIOR.shift_prior_mm),
        )
        found = correct_rig(seen_by(true, rng), known, options=PRIOR)
        scale = np.sqrt(np.diagonal(found.calibration.covariance)[use])
        error = apart(found.calibration, true)[use] / scale
        correlation = found.calibration.covariance[np.ix_(use, use)] / np.outer(scale, scale)
        squares.append(error @ np.linalg.solve(correlation, error) / len(use))
        ratios.append(error)
    assert 0.3 < np.mean(squares) < 1 + 4 * np.sqrt(2 / (4 * len(use)))
    assert 0.7 < np.sqrt(np.mean(np.square(ratios))) < 1.3


def test_one_device_that_turned_is_told_from_those_at_rest() -> None:
    """By one pair its turn is open by 0.2 to 0.5 mrad, as turns look like shifts; by all 0.1 mrad."""
    rng, known = np.random.default_rng(5), calibration()
    turn = np.array([3e-4, 8e-4, 2e-4])
    pose = known.orientations["projector"].device_from_base
    R = pose.changed(np.array([*(-pose.rotation @ turn), 0, 0, 0])).rotation
    there = replace(known.orientations["projector"], device_from_base=Pose(R, -R @ pose.origin_mm))
    true = replace(known, orientations={**known.orientations, "projector": there})
    seen = seen_by(true, rng)
    found = correct_rig(seen, known)
    off = np.concatenate([found.rotation_rad, found.shift_mm], axis=1)
    off[found.devices.index("projector"), :3] -= turn
    assert np.abs(off / found.sigma).max() < 4
    alone = find_motion(seen["left", "projector"], known)
    by_pair = np.sqrt(np.diagonal(alone.covariance))
    assert np.all(found.sigma[found.devices.index("projector"), :3] < 0.6 * by_pair[:3])
    assert len(found.pairs) == 6


def test_pairs_that_see_too_little_are_left_out() -> None:
    known, seen = calibration(), seen_by(calibration(), np.random.default_rng(6))
    dark = {pair: replace(phase, v=np.full_like(phase.v, np.nan)) for pair, phase in seen.items()}
    for pair in (("left", "projector"), ("right", "top")):
        found = correct_rig({**dark, pair: seen[pair]}, known)
        assert found.pairs == (pair,)
        told = together_words(found)  # of the two, and of the camera that all refer to where it shows nothing
        assert told[0] == f"capture: {pair[0]}, {pair[1]} together, against left, by 1 pair"
        assert told[1].startswith("left shows nothing") is ("left" not in pair)
    with pytest.raises(TooLittleSeenError):
        correct_rig(dark, known)
