"""Points for other programs: NPZ arrays and the PLY file."""

from __future__ import annotations

from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from core.model import PointCloud


def write_npz(file: BinaryIO, cloud: PointCloud) -> None:
    """Write the arrays of a point cloud, float32, under the names of the interchange contract.

    ``xyz`` (H, W, 3) in mm in the camera's frame, NaN where invalid; ``sigma`` (H, W, 3) in mm, photogrammetric method
    only; ``sigma_depth`` (H, W) in mm, of Z from phase noise alone.
    """
    arrays = {"xyz": cloud.xyz_mm, "sigma": cloud.sigma_mm, "sigma_depth": cloud.sigma_depth_mm}
    stored: dict[str, Any] = {name: np.asarray(a, np.float32) for name, a in arrays.items() if a is not None}
    np.savez(file, **stored)


def write_ply(file: BinaryIO, cloud: PointCloud, image: NDArray[Any] | None = None) -> int:
    """Write the valid points as a binary little-endian PLY file; give their number.

    Parameters
    ----------
    file : binary file
    cloud : PointCloud
        Points (H, W, 3); their sigmas become the properties sigma_x, sigma_y, sigma_z (mm) where there are any.
    image : array, shape (H, W), optional
        Grey values of the points, stored as red, green and blue from 0 (black) to 255 (the brightest percent).
    """
    valid = np.isfinite(cloud.xyz_mm).all(axis=-1)
    columns: list[tuple[str, str, NDArray[Any]]] = [(n, "<f4", cloud.xyz_mm[valid, i]) for i, n in enumerate("xyz")]
    if cloud.sigma_mm is not None:
        columns += [(f"sigma_{n}", "<f4", cloud.sigma_mm[valid, i]) for i, n in enumerate("xyz")]
    elif cloud.sigma_depth_mm is not None:
        columns.append(("sigma_z", "<f4", cloud.sigma_depth_mm[valid]))
    if image is not None:
        grey = _bytes(np.asarray(image, np.float32)[valid])
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


def _bytes(grey: NDArray[np.float32]) -> NDArray[np.uint8]:
    finite = grey[np.isfinite(grey)]
    bright = float(np.percentile(finite, 99)) if finite.size else 1.0
    return np.clip(np.nan_to_num(grey) * (255 / max(bright, 1e-6)) + 0.5, 0, 255).astype(np.uint8)
