"""
A device's frame here and in OpenCV
===================================

Pixel coordinates are the same: u right, v down, the centre of the first pixel is (0, 0). The frames differ. Here X is
right, Y *up*, and the device looks along *-Z*; in OpenCV Y is down and Z forward. ``X_opencv = diag(1, -1, -1) X``
converts either way. Rotation angles about X keep their sign, those about Y and Z change it.
"""

import cv2
import matplotlib.pyplot as plt
import numpy as np

from core.api import OPENCV_FROM_OURS, project_points
from core.model import DeviceSpec, Interior

spec, interior = DeviceSpec(640, 480, (0.01, 0.01), 8.0), Interior(8.0)
points = np.array([[120.0, 60.0, -700.0], [-80.0, -90.0, -650.0]])  # one right and up, one left and down

# %%
# Both give the same pixels for the same points.
ours = project_points((spec, interior), points).uv
f = interior.c_mm / spec.pitch_mm[0]
K = np.array([[f, 0, (spec.width - 1) / 2], [0, f, (spec.height - 1) / 2], [0, 0, 1]])
theirs = cv2.projectPoints(OPENCV_FROM_OURS.apply(points), np.zeros(3), np.zeros(3), K, None)[0][:, 0]
print("ours", ours.tolist(), "OpenCV", theirs.tolist())
assert np.abs(ours - theirs).max() < 1e-6

# %%
# Both frames of a device that looks to the right.
figure = plt.figure(figsize=(9, 4), layout="constrained")
for k, (title, turn) in enumerate((("here", np.eye(3)), ("OpenCV", OPENCV_FROM_OURS.rotation))):
    axes = figure.add_subplot(1, 2, k + 1, projection="3d")
    corners = np.array([[-2.0, -1.5, -4], [2, -1.5, -4], [2, 1.5, -4], [-2, 1.5, -4]])
    # drawn with the line of sight to the right and up upwards: plot axes are (-Z, -X, Y), right-handed as the frame is
    for a, b in [*((np.zeros(3), c) for c in corners), *zip(corners, np.roll(corners, -1, axis=0), strict=True)]:
        axes.plot(*np.array([[-a[2], -b[2]], [-a[0], -b[0]], [a[1], b[1]]]), color="0.6", lw=0.8)
    for name, axis, colour in zip("XYZ", turn, ("C3", "C2", "C0"), strict=True):
        tip = 2.2 * axis
        axes.quiver(0, 0, 0, -tip[2], -tip[0], tip[1], color=colour)
        axes.text(-1.2 * tip[2], -1.2 * tip[0], 1.2 * tip[1], name, color=colour, fontsize=13)
    axes.set(title=title, xlim=(-2, 4), ylim=(-2, 2), zlim=(-2, 2))
    axes.set_axis_off()
    axes.set_box_aspect((6, 4, 4), zoom=1.05)
    axes.view_init(elev=18, azim=-62)
plt.show()
