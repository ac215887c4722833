"""
A centre estimator
==================

One function finds the centre of a dot from its pixels; ``# estimator:`` in the testfield's file names it. This one uses
the centre of the contour that was fitted before. The built-in one uses the centroid of the grey values.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from core.measure import ESTIMATORS, measure_targets
from core.pipeline import decode_capture, simulate_project
from core.pipeline.folders import captures_of


def middle_of_contour(image, rays, profile, light, noise):
    """Give centres (m, 2) and covariances (m, 2, 2), px."""
    uv = rays.centre + np.einsum("mij,mj->mi", rays.ellipse, profile.contour[:, 1:3])
    return uv, np.broadcast_to(0.02**2 * np.eye(2), (len(uv), 2, 2))


ESTIMATORS["contour"] = middle_of_contour

# %%
# Both estimators on one image of the virtual bench.
project = simulate_project(Path(tempfile.mkdtemp()) / "quick", "quick")
capture = captures_of(project, "testfield")[0]
phase = decode_capture(capture.path)
one, other = (
    measure_targets(phase, replace(capture.testfield, estimator=name), capture.seeds, project.camera)
    for name in ("centroid", "contour")
)
names = [list(zip(t.row.tolist(), t.col.tolist(), strict=True)) for t in (one, other)]
both = [(one.camera_uv[names[0].index(n)], other.camera_uv[names[1].index(n)]) for n in names[0] if n in names[1]]
at, off = np.array([a for a, _ in both]), np.array([b - a for a, b in both])
assert np.abs(off).max() < 0.2  # px

plt.imshow(phase.image, cmap="gray")
plt.quiver(*at.T, *off.T, color="C1", angles="xy")
plt.title(f"contour minus centroid, r.m.s. {np.sqrt(np.mean(off**2)):.3f} px")
plt.show()
