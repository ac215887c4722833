"""A rig with the published numbers and a coarser camera, and what it measures on known surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from core.geometry import Pose, project, ray_directions
from core.model import AdjustedDevice, DeviceSpec, Interior, PhaseMap, PhotogrammetricCalibration
from tests.calibrated import calibration_of_pair

CAMERA = DeviceSpec(94, 72, (0.064, 0.064), 12.0)
PROJECTOR = DeviceSpec(640, 640, (0.09, 0.09), 182.0)
CAMERA_A = (-0.603793e-3, 0.308968e-5, -0.143177e-1, 0.308307e-4, -0.121978e-3, -0.757670e-4)
PROJECTOR_A = (0.555660e-6, -0.266407e-9, 0.200536e-3, 0.133679e-3, 0.204489e-5, 0.980716e-5)


def looking_at_600(place: tuple[float, float, float]) -> Pose:
    """A projector at a place in the camera's frame (mm) that looks at (0, 0, -600)."""
    z = np.array(place) - (0.0, 0.0, -600.0)
    z /= np.linalg.norm(z)
    x = np.cross((0.0, 1.0, 0.0), z)
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    return Pose(R, -R @ np.array(place))


@dataclass(frozen=True)
class Rig:
    """Camera and projector, and their true phase maps."""

    calibration: PhotogrammetricCalibration

    def rays(self) -> np.ndarray:
        spec = self.calibration.camera.spec
        uv = np.stack(np.meshgrid(np.arange(spec.width), np.arange(spec.height)), axis=-1)
        return ray_directions(spec, self.calibration.camera.interior, uv)

    def lines(self, points: np.ndarray) -> np.ndarray:
        c = self.calibration
        return project(c.projector.spec, c.projector.interior, points, c.projector_from_camera)

    def plane(self, normal: tuple[float, float, float] = (0.1, -0.2, 1.0), z: float = -600.0) -> np.ndarray:
        """Points (H, W, 3) where the rays meet a plane through (0, 0, z)."""
        rays = self.rays()
        return rays * (normal[2] * z / (rays @ np.array(normal)))[..., None]

    def phase(self, points: np.ndarray, sigma: float = 0.03, noise: np.random.Generator | None = None) -> PhaseMap:
        uv = self.lines(points)
        uv[~np.all((uv >= 0) & (uv <= (PROJECTOR.width - 1, PROJECTOR.height - 1)), axis=-1)] = np.nan  # not lit
        if noise is not None:
            uv = uv + noise.normal(0, sigma, uv.shape)
        u, v = uv.astype(np.float32).transpose(2, 0, 1)
        sigma_u = np.where(np.isfinite(u), sigma, np.nan).astype(np.float32)
        grey = np.full(u.shape, 100, np.float32)
        return PhaseMap(u, v, sigma_u, sigma_u.copy(), grey, grey, np.zeros(u.shape, np.uint8))


def only(phase: PhaseMap, axis: str) -> PhaseMap:
    """The same phase map as a capture without the other axis would give it."""
    nan = np.full_like(phase.u, np.nan)
    return replace(phase, v=nan, sigma_v=nan) if axis == "u" else replace(phase, u=nan, sigma_u=nan)


@pytest.fixture
def without() -> Callable[[PhaseMap, str], PhaseMap]:
    return lambda phase, axis: only(phase, "u" if axis == "v" else "v")


@pytest.fixture
def make_rig() -> Callable[..., Rig]:
    def make(
        place: tuple[float, float, float] = (250.0, 20.0, 0.0),
        camera_a: tuple[float, ...] = CAMERA_A,
        projector_a: tuple[float, ...] = PROJECTOR_A,
        covariance: np.ndarray | None = None,
    ) -> Rig:
        interior = Interior(12.102765, -0.081293, -0.114492, camera_a, CAMERA.zero_radius_mm)  # type: ignore[arg-type]
        lamp = Interior(181.915599, 1.178883, 0.331241, projector_a, PROJECTOR.zero_radius_mm)  # type: ignore[arg-type]
        devices = [
            AdjustedDevice(spec, o, np.zeros(9), (0.0, 0.0), 0) for spec, o in ((CAMERA, interior), (PROJECTOR, lamp))
        ]
        cov = np.zeros((24, 24)) if covariance is None else covariance
        return Rig(calibration_of_pair(*devices, looking_at_600(place), cov))

    return make


@pytest.fixture
def rig(make_rig: Callable[..., Rig]) -> Rig:
    return make_rig()
