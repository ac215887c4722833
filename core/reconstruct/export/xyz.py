"""XYZ: a line ``x y z`` for each point, mm."""

from __future__ import annotations

from typing import BinaryIO

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, points_and_grey

_ROWS = 20_000


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    points, _ = points_and_grey(cloud, None)
    for start in range(0, len(points), _ROWS):
        part = points[start : start + _ROWS].tolist()
        file.write(("\n".join(f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in part) + "\n").encode("ascii"))
    return len(points)


EXPORTER = Exporter(".xyz", "points", _write)
