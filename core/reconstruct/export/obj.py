"""OBJ: vertices with colours (after the coordinates, 0 to 1) and triangles, in mm."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, points_and_grey, write_lines
from core.reconstruct.export.mesh import triangles


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    points, grey = points_and_grey(cloud, image)
    file.write(b"# mm, camera frame: X right, Y up, the camera looks along -Z\n")
    line = "v %.9g %.9g %.9g" + (" %.4f %.4f %.4f" if grey is not None else "")
    columns = points.astype(np.float64)
    if grey is not None:
        columns = np.hstack([columns, np.repeat(grey[:, None] / 255.0, 3, axis=1)])
    write_lines(file, line, columns)
    write_lines(file, "f %d %d %d", triangles(cloud) + 1)
    return len(points)


EXPORTER = Exporter(".obj", "mesh", _write)
