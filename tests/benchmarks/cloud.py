"""Depth look-up, and the whole way from frames in memory to points with sigmas, beside copies of their bytes."""

from __future__ import annotations

import numpy as np

from core.decode import decode
from core.geometry import Pose, ray_directions
from core.model import DepthCalibration, DeviceSpec, Interior, PhaseMap, PointCloud
from core.patterns import reference_sequence
from core.reconstruct import reconstruct
from tests.benchmarks.scenes import LINES, frames, phase_of, pixels, plane_points, rig, sizes
from tests.benchmarks.timing import OURS, Contestant, Row, floor, race

OUTPUT_BYTES = 16  # a pixel: xyz, sigma of the depth, float32
U_RANGE = 100.0, 500.0
COEFFICIENTS = 5.0, 60.0, 3.0, -1.0  # mm, of a middle pixel


def run() -> list[Row]:
    """At all image sizes."""
    return [row for size, shape in sizes().items() for row in (*_look_up(size, *shape), *_frames(size, *shape))]


def _look_up(size: str, width: int, height: int) -> list[Row]:
    camera = rig(width, height).camera
    calibration = _depth_calibration(camera.spec, camera.interior)
    share = np.linspace(0.02, 0.98, width * height, dtype=np.float32).reshape(height, width)
    u = np.float32(U_RANGE[0]) + share * np.float32(U_RANGE[1] - U_RANGE[0])
    sigma = np.full_like(u, 0.03)
    nothing = np.full_like(u, np.nan)
    phase = PhaseMap(u, nothing, sigma, nothing, sigma, sigma, np.zeros(u.shape, np.uint8))

    def right(cloud: PointCloud) -> str:
        """Compare with the definition, in plain numpy and double precision."""
        t = (u.astype(float) - np.mean(U_RANGE)) / (U_RANGE[1] - U_RANGE[0]) * 2
        z = sum(c.astype(float) * t**k for k, c in enumerate(calibration.coefficients))
        rays = ray_directions(camera.spec, camera.interior, pixels(camera.spec))
        pose = calibration.camera_from_plate
        plate = pose.translation_mm + z[..., None] * (pose.rotation @ calibration.axis_direction)
        normal = pose.rotation[:, 2]
        error = np.abs(cloud.xyz_mm - rays * ((plate @ normal) / (rays @ normal))[..., None])
        assert np.max(error) < 0.001, f"a point is {np.max(error):.4f} mm off"
        return f"largest error {1e3 * np.max(error):.2f} um"

    read = [u, sigma, calibration.coefficients, calibration.u_range]
    field = [
        *floor(read, OUTPUT_BYTES * u.size),
        Contestant(OURS, lambda: reconstruct(phase, calibration), right),
    ]
    return race("depth look-up", size, u.size, "pixels", field)


def _depth_calibration(spec: DeviceSpec, interior: Interior) -> DepthCalibration:
    """Cubic curves that differ a little from pixel to pixel, before a plate that moves not quite along its normal."""
    shape = (spec.height, spec.width)
    tilt = np.linspace(0.9, 1.1, spec.width)
    coefficients = np.array([np.broadcast_to(c * tilt, shape) for c in COEFFICIENTS], np.float32)
    u_range = np.array([np.full(shape, u) for u in U_RANGE], np.float32)
    c, s = np.cos(0.1), np.sin(0.1)
    plate = Pose(np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), np.array([0.0, 0.0, -600.0]))
    direction = np.array([0.02, -0.01, 1.0])
    depths = np.linspace(-50, 50, 5)
    return DepthCalibration(
        "u", depths, len(COEFFICIENTS) - 1, coefficients, u_range, 0.01, coefficients[0].size, spec, interior, plate,
        direction / np.linalg.norm(direction),
    )  # fmt: skip


def _frames(size: str, width: int, height: int) -> list[Row]:
    calibration = rig(width, height)
    truth = plane_points(calibration)
    seen = phase_of(calibration, truth)
    data = frames(reference_sequence(), width, height, places=(seen.u, seen.v))
    inside = np.all([(a > 4) & (a < LINES - 5) for a in (seen.u, seen.v)], axis=0)

    def work() -> PointCloud:
        return reconstruct(decode(data.patterns, data.images, lines=(LINES, LINES)), calibration)

    def right(cloud: PointCloud) -> str:
        """Errors are as large as the sigmas say: half of them below 0.674 sigma."""
        error = (cloud.xyz_mm[..., 2] - truth[..., 2])[inside]
        found = np.isfinite(error)
        normalised = np.median(np.abs(error[found] / cloud.sigma_depth_mm[inside][found])) / 0.6745
        assert found.mean() > 0.75, f"only {found.mean():.0%} of the lit pixels have points"
        assert 0.8 < normalised < 1.25, f"errors are {normalised:.2f} times what the sigmas say"
        gross = np.mean(np.abs(error[found]) > 2)
        assert gross < 1e-3, f"{gross:.1e} of the points are more than 2 mm off"
        middle = np.median(np.abs(error[found])) / 0.6745
        return f"sigma of Z {middle:.3f} mm, {normalised:.2f} of what is predicted"

    field = [*floor(data.images), Contestant(OURS, work, right)]
    return race("frames to points", f"{size} x 28", width * height, "pixels", field)
