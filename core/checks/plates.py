"""Where the targets of boards stood, seen by the calibrated camera and projector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from core.geometry import project, ray_directions
from core.model import Array, DeviceSpec, Interior, PhotogrammetricCalibration, TargetSet, Testfield

START = 50.0  # focal lengths: where the search for a point on a ray begins
STEPS = 25
LEAST = 4  # targets that make a plate


@dataclass(frozen=True)
class Plates:
    """Boards at known positions, their targets in the camera's frame in mm.

    `xyz_mm` has the shape (plates, targets, 3), NaN where a target was not measured; `nominal_mm` (targets, 3) those on
    the board. `off_lines` (plates,) is the r.m.s. of what the fourth observation of each point leaves over, in
    projector lines, NaN where one axis was decoded; `off_sigmas` the same in its sigmas.
    """

    names: tuple[str, ...]
    z_mm: Array
    nominal_mm: Array
    xyz_mm: Array
    off_lines: Array
    off_sigmas: Array


def see_plates(
    calibration: PhotogrammetricCalibration,
    targets: Sequence[TargetSet],
    z_mm: Mapping[str, float],
    board: Testfield,
) -> Plates:
    """Intersect the targets of every plate that has some."""
    index = board.index()
    names, z, xyz, lines, sigmas = [], [], [], [], []
    for t in targets:
        if t.capture not in z_mm or len(t.row) < LEAST:
            continue
        points, off, sigma = intersect_targets(calibration, t)
        placed = np.full((len(board.row), 3), np.nan)
        for k, key in enumerate(zip(t.row.tolist(), t.col.tolist(), strict=True)):
            if key in index:
                placed[index[key]] = points[k]
        if np.isfinite(placed[:, 0]).sum() >= LEAST:
            names.append(t.capture)
            z.append(z_mm[t.capture])
            xyz.append(placed)
            lines.append(float(np.sqrt(np.nanmean(off**2))) if np.isfinite(off).any() else np.nan)
            ratio = off / sigma
            sigmas.append(float(np.sqrt(np.nanmedian(ratio**2) / 0.4549)) if np.isfinite(ratio).any() else np.nan)
    shape = (len(names), len(board.row), 3)
    return Plates(
        tuple(names), np.array(z), board.xyz_mm, np.reshape(np.array(xyz), shape), np.array(lines), np.array(sigmas)
    )


def pose_plates(
    spec: DeviceSpec, interior: Interior, targets: Sequence[TargetSet], z_mm: Mapping[str, float], board: Testfield
) -> Plates:
    """Place the nominal board in front of the camera alone, where there is no calibrated projector."""
    index = board.index()
    names, z, xyz = [], [], []
    for t in targets:
        keys = list(zip(t.row.tolist(), t.col.tolist(), strict=True))
        use = np.asarray(np.array([key in index for key in keys]) & np.isfinite(t.camera_uv).all(axis=1))
        if use.sum() < LEAST:
            continue
        nominal = board.xyz_mm[[index[key] for key, used in zip(keys, use.tolist(), strict=True) if used]]
        tangents = ray_directions(spec, interior, t.camera_uv[use])[:, :2] * (1.0, -1.0)
        found, rotation, shift = cv2.solvePnP(nominal, np.ascontiguousarray(tangents), np.eye(3), None)
        if found:
            names.append(t.capture)
            z.append(z_mm[t.capture])
            xyz.append((board.xyz_mm @ cv2.Rodrigues(rotation)[0].T + shift.ravel()) * (1.0, -1.0, -1.0))
    unknown = np.full(len(names), np.nan)
    stacked = np.reshape(np.array(xyz), (len(names), len(board.row), 3))
    return Plates(tuple(names), np.array(z), board.xyz_mm, stacked, unknown, unknown)


def intersect_targets(calibration: PhotogrammetricCalibration, t: TargetSet) -> tuple[Array, Array, Array]:
    """Give the points of targets, (n, 3) mm, and the fourth observation's residual and sigma, (n,) lines."""
    spec, interior = calibration.camera.spec, calibration.camera.interior
    rays = ray_directions(spec, interior, t.camera_uv)
    other = calibration.projector.spec, calibration.projector.interior
    depth = np.full(len(rays), START * spec.nominal_c_mm)
    weight = 1.0 / np.maximum(t.projector_sigma, 1e-4) ** 2
    weight = np.asarray(np.where(np.isfinite(t.projector_uv) & np.isfinite(weight), weight, 0.0))
    seen = np.where(weight > 0, t.projector_uv, 0.0)
    for _ in range(STEPS):
        at, slope = _along(calibration, other, rays, depth)
        rest = np.where(weight > 0, seen - at, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.sum(weight * slope * rest, axis=1) / np.sum(weight * slope**2, axis=1)
        step = np.clip(np.where(np.isfinite(step), step, 0.0), -0.3 * depth, 0.5 * depth)
        depth = depth + step
        if np.all(np.abs(step) < 1e-7 * depth):
            break
    at, slope = _along(calibration, other, rays, depth)
    valid = np.asarray((weight > 0).any(axis=1) & np.isfinite(at).all(axis=1))
    both = np.asarray((weight > 0).all(axis=1) & valid)
    rest = np.where(both[:, None], seen - at, np.nan)
    across = np.stack([-slope[:, 1], slope[:, 0]], axis=1) / np.linalg.norm(slope, axis=1)[:, None]
    off = np.sum(rest * across, axis=1)
    sigma = np.sqrt(np.sum((across * t.projector_sigma) ** 2, axis=1))
    return np.where(valid[:, None], rays * depth[:, None], np.nan), off, sigma


def _along(
    calibration: PhotogrammetricCalibration, other: tuple[DeviceSpec, Interior], rays: Array, depth: Array
) -> tuple[Array, Array]:
    """Projector coordinates, (n, 2), of points on rays at depths, and their derivatives by the depth."""
    step = 1e-4 * depth
    pose = calibration.projector_from_camera
    low = project(*other, rays * (depth - step)[:, None], pose)
    high = project(*other, rays * (depth + step)[:, None], pose)
    return (low + high) / 2, (high - low) / (2 * step)[:, None]
