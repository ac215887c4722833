"""PCD 0.7 of the Point Cloud Library, binary and organised: a record for every pixel, NaN where there is none; mm."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, count, grey_bytes


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    height, width = cloud.xyz_mm.shape[:2]
    fields = [(name, "<f4") for name in "xyz"]
    if image is not None:
        fields.append(("rgb", "<u4"))
    records = np.zeros(height * width, np.dtype(fields))
    points = np.where(cloud.valid[..., None], cloud.xyz_mm, np.nan).reshape(-1, 3)
    for i, name in enumerate("xyz"):
        records[name] = points[:, i]
    if image is not None:
        grey = grey_bytes(np.asarray(image, np.float32).ravel()).astype(np.uint32)
        records["rgb"] = grey << 16 | grey << 8 | grey  # the bits of a float, as the library has it
    names = " ".join(name for name, _ in fields)
    kinds = " ".join("F" for _ in fields)
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {names}\nSIZE {' '.join('4' for _ in fields)}\nTYPE {kinds}\nCOUNT {' '.join('1' for _ in fields)}\n"
        f"WIDTH {width}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {height * width}\nDATA binary\n"
    )
    file.write(head.encode("ascii"))
    file.write(records.tobytes())
    return count(cloud)


EXPORTER = Exporter(".pcd", "points", _write)
