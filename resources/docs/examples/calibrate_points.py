"""
Calibrating from points of any detector
=======================================

The coordinates of a board's points (corners, markers, centres of dots) in camera and projector, for several positions
of the board, give the interior orientation of both devices, their relative orientation, and the covariance of it all.
Any pair of coordinates then gives a point in space with its covariance.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from core.api import calibrate_points, project_points, triangulate
from core.geometry import Pose
from core.model import DeviceSpec, Interior

camera = DeviceSpec(1280, 1024, (0.0048, 0.0048), 12.0)
projector = DeviceSpec(1280, 800, (0.0076, 0.0076), 14.0)
true_camera = Interior(12.08, 0.02, -0.03, (-1.2e-3, 8e-6, 0.0, 0.0, 0.0, 0.0), camera.zero_radius_mm)
true_projector = Interior(14.11, -0.05, 0.4, (4e-4, 0.0, 0.0, 0.0, 0.0, 0.0), projector.zero_radius_mm)

# %%
# The projector stands 150 mm to the right, turned inwards; the board is seen in 14 positions, some of them rolled.
projector_from_camera = Pose(Rotation.from_euler("y", -14, degrees=True).as_matrix(), np.array([-150.0, 0.0, -20.0]))
row, col = (a.ravel() for a in np.mgrid[0:9, 0:11])
board = np.column_stack([25.0 * (col - 5), 25.0 * (4 - row), 0.0 * row])
rng = np.random.default_rng(3)
seen, lit = [], []
for k in range(14):
    tilt = Rotation.from_euler("zxy", [90 * (k % 4), *rng.uniform(-28, 28, 2)], degrees=True)
    camera_from_board = Pose(tilt.as_matrix(), np.array([*rng.uniform(-25, 25, 2), -640 + rng.uniform(-50, 50)]))
    points = camera_from_board.apply(board)
    seen.append(project_points((camera, true_camera), points).uv + rng.normal(0, 0.03, (len(board), 2)))
    at = project_points((projector, true_projector), points, projector_from_camera).uv
    lit.append(at + rng.normal(0, 0.05, (len(board), 2)))

found = calibrate_points(
    camera, projector, board, seen, lit, camera_sigma_px=0.03, projector_sigma_lines=0.05, length=(0, 10, 250.0, 0.005)
)

# %%
# The difference from the truth, in standard deviations.
c, sigma = found.camera.interior.c_mm, found.camera.sigma[0]
print(f"camera: c = {c:.4f} ± {sigma:.4f} mm, true {true_camera.c_mm}")
points = np.array([0.0, 0.0, -640.0]) + board
uv = project_points((camera, true_camera), points).uv
both = triangulate(found, uv, project_points((projector, true_projector), points, projector_from_camera).uv)
error = both.xyz_mm - points

plt.figure(figsize=(6, 3), layout="constrained")
plt.plot(1000 * error[:, 2], ".", label="error of Z")
for sign in (-1, 1):
    plt.plot(sign * 1000 * both.sigma_mm[:, 2], "k-", lw=0.8, label="±σ predicted" if sign > 0 else None)
plt.xlabel("point")
plt.ylabel("µm")
plt.legend()
plt.show()
