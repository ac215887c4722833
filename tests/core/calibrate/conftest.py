"""Simulated networks: truth through `core.geometry.project`, which shares no code with the adjustment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from core.geometry import Pose, matrix_from_axis_angle, project
from core.model import DeviceSpec, Interior, Network, NetworkDevice, NetworkScale

CAMERA = DeviceSpec(748, 576, (0.008, 0.008), 12.0)
CAMERA_TRUTH = Interior(
    12.102765,
    -0.081293,
    -0.114492,
    (-0.603793e-3, 0.308968e-5, -0.143177e-1, 0.308307e-4, -0.121978e-3, -0.757670e-4),
    CAMERA.zero_radius_mm,
)
PROJECTOR = DeviceSpec(640, 640, (0.09, 0.09), 182.0)
PROJECTOR_TRUTH = Interior(
    181.915599,
    1.178883,
    0.331241,
    (0.555660e-6, -0.266407e-9, 0.200536e-3, 0.133679e-3, 0.204489e-5, 0.980716e-5),
    PROJECTOR.zero_radius_mm,
)
PROJECTOR_FROM_CAMERA = Pose(matrix_from_axis_angle([0.05, 1.0, 0.02], -0.42), np.array([-240.0, 15.0, -80.0]))


@dataclass(frozen=True)
class Simulated:
    """A network and the truth it was made from."""

    network: Network
    interior: dict[str, Interior]
    stations: tuple[Pose, ...]
    points_mm: np.ndarray
    projector_from_camera: Pose = PROJECTOR_FROM_CAMERA


def board(
    rows: int, cols: int, extent_mm: float, depth_mm: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Nominal flat board and its true shape, dots off their nominal places in all three coordinates."""
    y, x = np.meshgrid(np.linspace(-0.35, 0.35, rows), np.linspace(-0.5, 0.5, cols), indexing="ij")
    nominal = np.stack([x.ravel(), -y.ravel(), 0 * x.ravel()], axis=1) * extent_mm
    bend = depth_mm * (nominal[:, 0] ** 2 + 0.5 * nominal[:, 0] * nominal[:, 1]) / extent_mm**2 * 4
    truth = nominal + rng.normal(scale=0.1, size=nominal.shape)
    truth[:, 2] += bend
    return nominal, truth


def camera_poses(count: int, distance_mm: float, tilt_deg: float, rolled: bool, rng: np.random.Generator) -> list[Pose]:
    """Camera positions around a board, inclined to all sides; every second one rolled by 90° if asked."""
    poses = []
    for k in range(count):
        azimuth = 2 * np.pi * k / count + 0.3
        tilt = np.radians(tilt_deg) * (0.15 if k % 5 == 4 else rng.uniform(0.8, 1.1))
        R = matrix_from_axis_angle([np.cos(azimuth), np.sin(azimuth), 0], tilt)
        roll = np.pi / 2 * (k % 4) if rolled else 0.0
        R = matrix_from_axis_angle([0, 0, 1], roll + rng.normal(scale=0.05)) @ R
        shift = np.array([*rng.normal(scale=0.02 * distance_mm, size=2), -distance_mm * rng.uniform(0.95, 1.05)])
        poses.append(Pose(R, shift))
    return poses


@pytest.fixture(scope="session")
def simulate() -> Callable[..., Simulated]:
    """Give the function that simulates a network."""
    return simulated_network


def simulated_network(
    *,
    seed: int = 0,
    poses: int = 12,
    rows: int = 6,
    cols: int = 8,
    use: tuple[str, ...] = ("camera", "projector"),
    rigid: bool = True,
    scale: bool = True,
    rolled: bool = True,
    tilt_deg: float = 32.0,
    depth_mm: float = 3.0,
    approximation_mm: float | None = None,
    sigma_px: dict[str, float] | None = None,
    noise: float = 1.0,
    camera: DeviceSpec = CAMERA,
    camera_truth: Interior = CAMERA_TRUTH,
    projector: DeviceSpec = PROJECTOR,
    projector_truth: Interior = PROJECTOR_TRUTH,
    estimate: tuple[str, ...] | None = None,
    distance_mm: float = 600.0,
    extent_mm: float = 250.0,
    camera_poses_given: list[Pose] | None = None,
) -> Simulated:
    """Board before camera and projector; `noise` multiplies the noise drawn, not the sigmas told.

    The approximate points are a flat board, or with `approximation_mm` the true ones with errors of that size.
    """
    rng = np.random.default_rng(seed)
    nominal, truth = board(rows, cols, extent_mm, depth_mm, rng)
    if approximation_mm is not None:
        nominal = truth + rng.normal(scale=approximation_mm, size=truth.shape)
    sigma = {"camera": 0.02, "projector": 0.03} | (sigma_px or {})
    specs, interiors = (
        {"camera": camera, "projector": projector},
        {"camera": camera_truth, "projector": projector_truth},
    )
    views = camera_poses_given or camera_poses(poses, distance_mm, tilt_deg, rolled, rng)
    names, owners, groups, stations, rows_ = [], [], [], [], []
    for k, camera_from_board in enumerate(views):
        for name in use:
            pose = camera_from_board if name == "camera" else PROJECTOR_FROM_CAMERA @ camera_from_board
            uv = project(specs[name], interiors[name], truth, pose)
            w, h = specs[name].width, specs[name].height
            inside = (uv[:, 0] > 0) & (uv[:, 0] < w - 1) & (uv[:, 1] > 0) & (uv[:, 1] < h - 1)
            seen = np.flatnonzero(inside)
            uv = uv[seen] + noise * rng.normal(scale=sigma[name], size=(len(seen), 2))
            rows_.append((np.full(len(seen), len(names)), seen, uv, np.full((len(seen), 2), sigma[name])))
            names.append(f"{k + 1}/{name}")
            owners.append(name)
            groups.append(k if rigid else len(groups))
            stations.append(pose)
    bar = None
    if scale:
        ends = 2 * cols + 2, len(truth) - 2 * cols - 3  # well inside, where both devices see
        length = float(np.linalg.norm(truth[ends[0]] - truth[ends[1]]))
        bar = NetworkScale(*ends, length + noise * rng.normal(scale=0.005), 0.005)
    devices = {name: NetworkDevice(specs[name]) for name in use}
    if estimate is not None:
        devices = {name: replace(d, estimate=estimate) for name, d in devices.items()}
    network = Network(
        devices=devices,
        station_names=tuple(names),
        station_device=tuple(owners),
        station_pose=tuple(groups),
        point_names=tuple(f"P{i}" for i in range(len(truth))),
        point_xyz_mm=nominal,
        observation_station=np.concatenate([r[0] for r in rows_]),
        observation_point=np.concatenate([r[1] for r in rows_]),
        observation_uv=np.concatenate([r[2] for r in rows_]),
        observation_sigma=np.concatenate([r[3] for r in rows_]),
        scale=bar,
    )
    return Simulated(network, {n: interiors[n] for n in use}, tuple(stations), truth)
