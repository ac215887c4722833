"""
A project folder, from the virtual bench to points
==================================================

The virtual bench records a small project as a rig would. Calibration and reconstruction are then one call each. The
same calls work on any recorded project.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from core.evaluate import heights
from core.pipeline import calibrate_project, reconstruct_capture, simulate_project
from core.pipeline.folders import captures_of

folder = Path(tempfile.mkdtemp()) / "quick"
project = simulate_project(folder, "quick")
calibrations = calibrate_project(project)
camera = calibrations["photogrammetric"].camera
print(f"c = {camera.interior.c_mm:.4f} ± {camera.sigma[0]:.4f} mm")

# %%
# An object, decoded and reconstructed: points in the camera's frame with their standard deviations.
capture = captures_of(project, "object")[0]
phase, cloud = reconstruct_capture(project, capture.name)
print(capture.name, int(np.isfinite(cloud.xyz_mm[..., 2]).sum()), "points")

figure, axes = plt.subplots(1, 3, figsize=(11, 3), layout="constrained")
for axis, image, title in (
    (axes[0], phase.image, "evenly lit"),
    (axes[1], phase.u, "projector column [lines]"),
    (axes[2], heights(cloud.xyz_mm), "height over the mean plane [mm]"),
):
    figure.colorbar(axis.imshow(image, cmap="gray" if axis is axes[0] else "viridis"), ax=axis)
    axis.set_title(title)
plt.show()
