"""Forward intersection where the lenses are none that the kernel knows."""

from __future__ import annotations

import numpy as np
import pytest

from core.geometry import (
    Pose,
    matrix_from_axis_angle,
    project,
    ray_directions,
)
from core.model import AdjustedDevice, DeviceSpec, Interior, PhaseMap
from core.reconstruct import reconstruct
from tests.calibrated import calibration_of_pair

CAMERA, LAMP = DeviceSpec(160, 120, (0.03, 0.03), 12.0), DeviceSpec(320, 240, (0.03, 0.03), 20.0)
EYE = Interior(12.1, 0.02, -0.03, (-0.09, 0.07, 8e-4, -6e-4, -0.03, 0, 0, 0, 0.003), 0.0, "brown")
BEAM = Interior(20.2, -0.05, 0.1, (-0.08, 0.05, -5e-4, 4e-4, 0.02, 0, 0, 0, -0.002), 0.0, "brown")
POSE = Pose(matrix_from_axis_angle([0.02, 1.0, 0.01], -0.4), np.array([-240.0, 5.0, -50.0]))


@pytest.fixture
def seen() -> tuple[np.ndarray, np.ndarray]:
    """Where every pixel's ray meets a plane that is inclined, and the lines that light it there."""
    pixels = np.stack(np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height)), axis=-1)
    rays = ray_directions(CAMERA, EYE, pixels)
    normal = np.array([0.2, -0.1, 1.0])
    points = rays * (-600.0 / (rays @ normal))[..., None]
    return points, project(LAMP, BEAM, points, POSE)


def cloud_of(lines: np.ndarray, sigma: float, axes: str = "uv"):  # type: ignore[no-untyped-def]
    lit = np.all((lines > 0) & (lines < [LAMP.width - 1, LAMP.height - 1]), axis=-1)
    u, v = (np.where(lit & (axis in axes), lines[..., k], np.nan).astype(np.float32) for k, axis in enumerate("uv"))
    s = np.where(lit, sigma, np.nan).astype(np.float32)
    phase = PhaseMap(u, v, s, s, s, s, np.zeros(s.shape, np.uint8))
    devices = (AdjustedDevice(spec, i, np.zeros(12), (0, 0), 0) for spec, i in ((CAMERA, EYE), (LAMP, BEAM)))
    return reconstruct(phase, calibration_of_pair(*devices, POSE, np.zeros((30, 30)))), lit


@pytest.mark.parametrize("axes", ["uv", "u"])
def test_points_are_where_the_rays_met_the_plane(seen, axes) -> None:
    points, lines = seen
    cloud, lit = cloud_of(lines, 0.01, axes)
    assert np.isfinite(cloud.xyz_mm[lit]).all()
    assert lit.mean() > 0.5
    # lines are float32: 320 of them to 2e-5, some 1e-5 of the depth's 600 mm
    assert np.abs(cloud.xyz_mm[lit] - points[lit]).max() < 0.02


def test_sigma_of_depth_is_what_noise_makes(seen) -> None:
    points, lines = seen
    rng = np.random.default_rng(3)
    cloud, lit = cloud_of(lines + rng.normal(scale=0.05, size=lines.shape), 0.05)
    both = lit & np.isfinite(cloud.xyz_mm[..., 2])
    ratio = (cloud.xyz_mm[both][:, 2] - points[both][:, 2]) / cloud.sigma_depth_mm[both]
    assert np.std(ratio) == pytest.approx(1.0, abs=0.03)  # some 15000 pixels: 0.006
