"""Views of one surface in closed form: a rig before a height field, with noise and a calibration's errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline

from core.geometry import (
    Pose,
    matrix_from_rotation_vector,
    pair_of,
    perturbed,
    project,
    ray_directions,
)
from core.model import AdjustedDevice, DeviceSpec, Interior, Pair, PhaseMap, PhotogrammetricCalibration, TargetSet
from tests.calibrated import calibration_of_pair

CAMERA = DeviceSpec(200, 150, (0.02, 0.02), 12.0)
PROJECTOR = DeviceSpec(640, 640, (0.09, 0.09), 182.0)
SIGMAS = np.array(
    [
        *(2e-3, 1.5e-3, 1.5e-3, 2e-5, 4e-7, 1e-5, 1e-5, 4e-6, 4e-6),  # of the camera's lens
        *(3e-2, 3e-2, 3e-2, 3e-7, 3e-11, 1e-5, 1e-5, 6e-8, 6e-8),  # of the projector's
        *(5e-5, 8e-5, 3e-5, 0.02, 0.02, 0.03),  # of their orientation
    ]
)
NOISE = 0.03  # lines
SIZE_MM = 70.0  # of the object, from its middle
Height = Callable[[np.ndarray, np.ndarray], np.ndarray]
_GRID = np.linspace(-80, 80, 41)
PAINT = RectBivariateSpline(_GRID, _GRID, np.random.default_rng(3).uniform(40, 160, (41, 41)))  # its grey values
TARGETS = [(row, col) for row in range(4) for col in range(4)]


def calibration() -> PhotogrammetricCalibration:
    """A rig whose parameters' errors hang together in some way."""
    place = np.array([250.0, 20.0, 0.0])
    z = (place - (0.0, 0.0, -600.0)) / np.linalg.norm(place - (0.0, 0.0, -600.0))
    x = np.cross((0.0, 1.0, 0.0), z) / np.linalg.norm(np.cross((0.0, 1.0, 0.0), z))
    R = np.stack([x, np.cross(z, x), z])
    lens = Interior(12.1, -0.08, -0.11, (-0.6e-3, 0.3e-5, 0.0, 0.0, -1.2e-4, -0.8e-4), CAMERA.zero_radius_mm)
    lamp = Interior(182.0, 1.2, 0.3, (0.5e-6, -0.3e-9, 0.0, 0.0, 0.0, 0.0), PROJECTOR.zero_radius_mm)
    devices = [AdjustedDevice(s, o, np.zeros(9), (0.0, 0.0), 0) for s, o in ((CAMERA, lens), (PROJECTOR, lamp))]
    mixing = np.random.default_rng(5).normal(size=(24, 24)) / 3 + np.eye(24)
    mixed = mixing @ mixing.T
    C = mixed / np.sqrt(np.outer(np.diag(mixed), np.diag(mixed))) * np.outer(SIGMAS, SIGMAS)
    return calibration_of_pair(*devices, Pose(R, -R @ place), C)


def relief(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the object, mm: waves that differ in both directions, on a dome."""
    return 7 * np.sin(x / 16 + 0.4) * np.cos(y / 13) + 4 * np.sin(y / 22 + 1) - (x**2 + y**2) / 500


def station(turn: tuple[float, float, float], away: float = 600.0) -> Pose:
    """Camera from object: the object turned by degrees about x, y, z, at a distance."""
    turns = [matrix_from_rotation_vector(np.radians(a) * axis) for a, axis in zip(turn, np.eye(3), strict=True)]
    return Pose(turns[0] @ turns[1] @ turns[2], np.array([0.0, 0.0, -away]))


@dataclass(frozen=True)
class Observed:
    phase: PhaseMap
    truth: np.ndarray  # (H, W, 3) in the object's frame
    targets: TargetSet


def observe(true: Pair, pose: Pose, rng: np.random.Generator, relief: Height = relief) -> Observed:
    """What a rig, as it truly is, sees of the object."""
    back, spec = pose.inverse(), true.camera.spec
    uv = np.stack(np.meshgrid(np.arange(spec.width), np.arange(spec.height)), axis=-1).astype(float)
    d = ray_directions(spec, true.camera.interior, uv) @ back.rotation.T
    t = (0.0 - back.translation_mm[2]) / d[..., 2]
    for _ in range(24):
        X = back.translation_mm + d * t[..., None]
        t = t + 0.7 * (relief(*np.clip(X[..., :2], -100, 100).T).T - X[..., 2]) / d[..., 2]
    X = back.translation_mm + d * t[..., None]
    X[np.abs(X[..., :2]).max(axis=-1) > SIZE_MM] = np.nan
    lines = _lines(true, pose.apply(X)) + NOISE * rng.standard_normal((*t.shape, 2))
    u, v = np.moveaxis(lines.astype(np.float32), -1, 0)
    sigma, plain = np.where(np.isfinite(u), np.float32(NOISE), np.float32(np.nan)), np.full(u.shape, 100, np.float32)
    image = PAINT.ev(*np.moveaxis(np.nan_to_num(X[..., :2]), -1, 0)).astype(np.float32)
    phase = PhaseMap(u, v, sigma, sigma.copy(), plain, image, np.zeros(u.shape, np.uint8))
    grid = np.array([(15.0 * c - 22, 15.0 * r - 22) for r, c in TARGETS])
    marks = pose.apply(np.column_stack([grid, relief(*grid.T)]))
    n, both = len(marks), np.array(TARGETS)
    seen = project(spec, true.camera.interior, marks) + 0.02 * rng.standard_normal((n, 2))
    lit = _lines(true, marks) + 0.02 * rng.standard_normal((n, 2))
    cov, lines_sigma, none = np.tile(0.02**2 * np.eye(2), (n, 1, 1)), np.full((n, 2), 0.02), np.zeros((n, 2))
    return Observed(phase, X, TargetSet("view", both[:, 0], both[:, 1], seen, cov, lit, lines_sigma, none, none[:, 0]))


def _lines(true: Pair, points: np.ndarray) -> np.ndarray:
    return project(true.projector.spec, true.projector.interior, points, true.projector_from_camera)


def draw(found: PhotogrammetricCalibration, rng: np.random.Generator) -> Pair:
    """A rig that the calibration may have come from."""
    pair = pair_of(found)
    return perturbed(pair, rng.multivariate_normal(np.zeros(24), pair.covariance))
