"""Intersection with 4 and 3 observations against cv2 and against the copy of its own input and output."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from core.model import PhaseMap, PointCloud
from core.reconstruct import reconstruct
from tests.benchmarks.scenes import phase_of, plane_points, rig
from tests.benchmarks.timing import Contestant, Row, floor, race


def run() -> list[Row]:
    """At 748x576; cv2 gets pinhole devices' ideal image coordinates with distortion zero, so that it can be right."""
    calibration = rig(748, 576)
    truth = plane_points(calibration)
    phase = phase_of(calibration, truth)

    def right(cloud: PointCloud) -> str:
        error = np.abs(cloud.xyz_mm - truth)
        found = np.isfinite(error)
        assert found.mean() > 0.5
        assert np.nanmax(error) < 0.05
        return f"largest error {1e3 * np.nanmax(error):.1f} um"

    def ours(name: str, seen: PhaseMap) -> Contestant:
        return Contestant(name, lambda: reconstruct(seen, calibration), right)

    nan = np.full_like(phase.v, np.nan)
    single = replace(phase, v=nan, sigma_v=nan)
    size, n = "748x576", phase.u.size
    rows = race("intersection, 4", size, n, "pixels", [ours("stripe workbench", phase), _cv2(n)])
    copies = floor([phase.u, phase.sigma_u], 28 * n)
    return rows + race("intersection, 3", size, n, "pixels", [*copies, ours("stripe workbench", single)])


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
        assert error < 0.5
        return f"largest error {1e3 * error:.1f} um, no sigmas"

    return Contestant("cv2 undistortPoints x2, triangulatePoints", work, right, warm=False)
