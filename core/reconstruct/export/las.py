"""LAS 1.2 of the ASPRS: points with intensity and colours (record format 2); in mm, to a tenth of a micrometre.

The format has no unit of its own where no coordinate system is given; the numbers are those of all other files here.
"""

from __future__ import annotations

import struct
from typing import BinaryIO

import numpy as np

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, points_and_grey

HEADER = 227
SCALE_MM = 1e-4
_RECORD = np.dtype(
    [
        ("xyz", "<i4", 3),
        ("intensity", "<u2"),
        ("returns", "u1"),
        ("classification", "u1"),
        ("angle", "i1"),
        ("user", "u1"),
        ("source", "<u2"),
        ("rgb", "<u2", 3),
    ]
)


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    points, grey = points_and_grey(cloud, image)
    xyz = points.astype(np.float64)
    least = xyz.min(axis=0) if len(xyz) else np.zeros(3)
    most = xyz.max(axis=0) if len(xyz) else np.zeros(3)
    offset = np.floor((least + most) / 2)
    scale = SCALE_MM
    while len(xyz) and np.max(most - least) / scale > 2**31 - 2:
        scale *= 10
    records = np.zeros(len(xyz), _RECORD)
    records["xyz"] = np.round((xyz - offset) / scale)
    records["returns"] = 1 | 1 << 3  # the first of one
    if grey is not None:
        records["intensity"] = grey.astype(np.uint16) * 257
        records["rgb"] = grey[:, None].astype(np.uint16) * 257
    stored = records["xyz"] * scale + offset
    if len(xyz):
        least, most = stored.min(axis=0), stored.max(axis=0)
    head = struct.pack(
        "<4sHHIHH8sBB32s32sHHHIIBHI5I",
        b"LASF", 0, 0, 0, 0, 0, b"", 1, 2, b"OTHER", b"stripe-core", 1, 2000, HEADER, HEADER, 0, 2, _RECORD.itemsize,
        len(xyz), len(xyz), 0, 0, 0, 0,
    )  # fmt: skip
    bounds = [v for pair in zip(most, least, strict=True) for v in pair]
    file.write(head + struct.pack("<12d", scale, scale, scale, *offset, *bounds))
    file.write(records.tobytes())
    return len(points)


EXPORTER = Exporter(".las", "points", _write)
