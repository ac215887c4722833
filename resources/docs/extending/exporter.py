"""
A point file for another program
================================

The ending of the file's name selects the format of points: in ``reconstruct --out``, in the window and in ``batch``.
"""

import tempfile
from pathlib import Path

import numpy as np

from core.model import PointCloud
from core.reconstruct import EXPORTERS, exporter_for
from core.reconstruct.export import Exporter


def write_csv(file, cloud, image):
    """Write a line of X, Y, Z for every point; give the number of points."""
    points = cloud.xyz_mm[np.isfinite(cloud.xyz_mm).all(axis=-1)]
    file.write(b"x_mm,y_mm,z_mm\n")
    np.savetxt(file, points, "%.4f", delimiter=",")
    return len(points)


EXPORTERS[".csv"] = Exporter(".csv", "points", write_csv)

# %%
# Three points, one of them unknown.
xyz = np.array([[[0.0, 0.0, -600.0], [1.0, 0.0, -601.0], [np.nan] * 3]], np.float32)
out = Path(tempfile.mkdtemp()) / "points.csv"
with out.open("wb") as file:
    assert exporter_for(out).write(file, PointCloud(xyz), None) == 2
print(out.read_text())
