"""Intersection with 4 and 3 observations against cv2 and against the copy of its own input and output."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from core.model import PhaseMap, PointCloud
from core.reconstruct import reconstruct
from tests.benchmarks.scenes import phase_of, plane_points, rig, sizes
from tests.benchmarks.timing import OURS, Contestant, Row, floor, race

OUTPUT_BYTES = 28  # a pixel: xyz, their sigmas, sigma of the depth, float32


def run() -> list[Row]:
    """At all sizes; cv2 gets devices that its distortion model describes, so that it can be right."""
    return [row for size, (width, height) in sizes().items() for row in _at(size, width, height)]


def _at(size: str, width: int, height: int) -> list[Row]:
    calibration = rig(width, height)
    truth = plane_points(calibration)
    phase = phase_of(calibration, truth)

    def right(cloud: PointCloud) -> str:
        error = np.abs(cloud.xyz_mm - truth)
        found = np.isfinite(error)
        assert found.mean() > 0.5, f"only {found.mean():.0%} intersected"
        assert np.nanmax(error) < 0.05, f"a point is {np.nanmax(error):.3f} mm off"
        return f"largest error {1e3 * np.nanmax(error):.1f} um"

    def ours(seen: PhaseMap) -> Contestant:
        return Contestant(OURS, lambda: reconstruct(seen, calibration), right)

    nan = np.full_like(phase.v, np.nan)
    single = replace(phase, v=nan, sigma_v=nan)
    n = phase.u.size
    both = [phase.u, phase.v, phase.sigma_u, phase.sigma_v]
    rows = race("intersection, 4", size, n, "pixels", [ours(phase), *floor(both, OUTPUT_BYTES * n), _cv2(n)])
    return rows + race("intersection, 3", size, n, "pixels", [*floor(both[::2], OUTPUT_BYTES * n), ours(single)])


def _cv2(n: int) -> Contestant:
    """As many points, seen by two devices that OpenCV's distortion model describes."""
    rng = np.random.default_rng(0)
    K, distortion = np.array([[1500.0, 0, 374], [0, 1500, 288], [0, 0, 1]]), np.array([-0.1, 0.02, 1e-3, -1e-3, 0.0])
    points = rng.uniform([-100, -80, 550], [100, 80, 650], (n, 3))
    R, t = cv2.Rodrigues(np.array([0.0, 0.4, 0.0]))[0], np.array([-250.0, 0.0, 60.0])
    seen = [cv2.projectPoints(points, r, s, K, distortion)[0] for r, s in ((np.eye(3), np.zeros(3)), (R, t))]
    matrices = [np.hstack([np.eye(3), np.zeros((3, 1))]), np.hstack([R, t[:, None]])]

    def work() -> np.ndarray:
        rays = [cv2.undistortPoints(uv, K, distortion).reshape(-1, 2).T for uv in seen]
        found = cv2.triangulatePoints(*matrices, *rays)
        return (found[:3] / found[3]).T

    def right(found: np.ndarray) -> str:
        error = np.abs(found - points).max()
        assert error < 0.05, f"a point is {error:.3f} mm off"
        return f"largest error {1e3 * error:.1f} um, no sigmas"

    return Contestant("cv2 undistortPoints x2, triangulatePoints", work, right, warm=n < 1_000_000, peer=True)
