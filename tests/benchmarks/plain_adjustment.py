"""What a user would write: `scipy.optimize.least_squares` with the sparsity of the Jacobian, and no covariances."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import coo_matrix
from scipy.spatial.transform import Rotation


def adjusted_points(data: dict[str, np.ndarray]) -> np.ndarray:
    """Adjust all devices, poses and points from their starting values; give the points, shape (n, 3)."""
    devices, stations, points = (len(data[name]) for name in ("interior", "rotation", "points"))
    poses = np.hstack([Rotation.from_matrix(data["rotation"]).as_rotvec(), data["shift"]])
    start = np.concatenate([data["interior"].ravel(), poses.ravel(), data["points"].ravel()])
    device, station, point = data["device"][data["station"]], data["station"], data["point"]

    def residuals(x: np.ndarray) -> np.ndarray:
        interior, pose, xyz = np.split(x, [8 * devices, 8 * devices + 6 * stations])
        fx, fy, cx, cy, k1, k2, p1, p2 = interior.reshape(-1, 8)[device].T
        pose = pose.reshape(-1, 6)[station]
        X, Y, Z = (Rotation.from_rotvec(pose[:, :3]).apply(xyz.reshape(-1, 3)[point]) + pose[:, 3:]).T
        a, b = X / Z, Y / Z
        r2 = a * a + b * b
        radial = 1 + r2 * (k1 + r2 * k2)
        u = fx * (a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a * a)) + cx
        v = fy * (b * radial + p1 * (r2 + 2 * b * b) + 2 * p2 * a * b) + cy
        return np.concatenate([u, v]) - data["uv"].T.ravel()

    columns = np.hstack(
        [
            8 * device[:, None] + np.arange(8),
            8 * devices + 6 * station[:, None] + np.arange(6),
            8 * devices + 6 * stations + 3 * point[:, None] + np.arange(3),
        ]
    )
    columns = np.vstack([columns, columns])
    rows = np.repeat(np.arange(len(columns)), columns.shape[1])
    pattern = coo_matrix((np.ones(rows.size, bool), (rows, columns.ravel())), (len(columns), start.size))
    found = least_squares(residuals, start, jac_sparsity=pattern, x_scale="jac", ftol=1e-6)
    return found.x[-3 * points :].reshape(-1, 3)
