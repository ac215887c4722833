"""XYZ: a line ``x y z`` for each point, mm."""

from __future__ import annotations

from typing import BinaryIO

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, points_and_grey, write_lines


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    points, _ = points_and_grey(cloud, None)
    write_lines(file, "%.9g %.9g %.9g", points)
    return len(points)


EXPORTER = Exporter(".xyz", "points", _write)
