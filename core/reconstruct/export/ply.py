"""PLY: points with their sigmas and grey values, binary."""

from __future__ import annotations

from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, grey_bytes


def write_ply(file: BinaryIO, cloud: PointCloud, image: Image | None = None) -> int:
    """Write the valid points as a binary little-endian PLY file; give their number.

    Sigmas become the properties sigma_x, sigma_y, sigma_z (mm), where there are any; sight and source say what made
    each point. The `image` has their grey values, stored as red, green and blue from 0 (black) to 255 (the brightest
    percent).
    """
    valid = cloud.valid
    columns: list[tuple[str, str, NDArray[Any]]] = [
        (n, "<f4", cloud.xyz_mm[..., i][valid]) for i, n in enumerate("xyz")
    ]
    if cloud.sigma_mm is not None:
        columns += [(f"sigma_{n}", "<f4", cloud.sigma_mm[..., i][valid]) for i, n in enumerate("xyz")]
    elif cloud.sigma_depth_mm is not None:
        columns.append(("sigma_z", "<f4", cloud.sigma_depth_mm[valid]))
    made_by = (("sight", cloud.sight), ("source", cloud.source))
    columns += [(name, "u1", codes[valid]) for name, codes in made_by if codes is not None]
    if image is not None:
        grey = grey_bytes(np.asarray(image, np.float32)[valid])
        columns += [(n, "u1", grey) for n in ("red", "green", "blue")]
    vertices = np.empty(int(np.count_nonzero(valid)), np.dtype([(name, kind) for name, kind, _ in columns]))
    for name, _, values in columns:
        vertices[name] = values
    kinds = {"<f4": "float", "u1": "uchar"}
    properties = "".join(f"property {kinds[kind]} {name}\n" for name, kind, _ in columns)
    head = (
        "ply\nformat binary_little_endian 1.0\ncomment camera frame, mm: X right, Y up, the camera looks along -Z\n"
        f"element vertex {len(vertices)}\n{properties}end_header\n"
    )
    file.write(head.encode("ascii"))
    file.write(vertices.tobytes())
    return len(vertices)


EXPORTER = Exporter(".ply", "points", write_ply)
