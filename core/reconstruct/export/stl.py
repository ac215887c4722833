"""STL: the surface as triangles, binary, in mm; it holds no colours."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, points_and_grey
from core.reconstruct.export.mesh import triangles

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    points, _ = points_and_grey(cloud, None)
    corners = points[triangles(cloud)]
    facets = np.zeros(len(corners), _FACET)
    facets["corners"] = corners
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    facets["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    file.write(b"binary STL, mm, camera frame: X right, Y up, the camera looks along -Z".ljust(80))
    file.write(len(facets).to_bytes(4, "little"))
    file.write(facets.tobytes())
    return len(points)


EXPORTER = Exporter(".stl", "mesh", _write)
