"""NPZ: the arrays as they are, in the image's raster."""

from __future__ import annotations

from typing import Any, BinaryIO

import numpy as np

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, count


def write_npz(file: BinaryIO, cloud: PointCloud) -> None:
    """Write the arrays of a point cloud, float32, under the names of the interchange contract.

    ``xyz`` (H, W, 3) in mm in the camera's frame, NaN where invalid; ``sigma`` (H, W, 3) in mm, photogrammetric method
    only, and ``sigma_xyz`` of the depth method; ``sigma_depth`` (H, W) in mm, of Z from noise alone; ``sight``
    (H, W), of several cameras only, codes of `core.reconstruct.Sight`; ``source`` (H, W), of joined clouds only, whose
    point it is.
    """
    sigma = "sigma_xyz" if cloud.by_depth else "sigma"
    arrays = {"xyz": cloud.xyz_mm, sigma: cloud.sigma_mm, "sigma_depth": cloud.sigma_depth_mm}
    stored: dict[str, Any] = {name: np.asarray(a, np.float32) for name, a in arrays.items() if a is not None}
    if cloud.sight is not None:
        stored["sight"] = cloud.sight
    if cloud.source is not None:
        stored["source"] = cloud.source
    np.savez(file, **stored)


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    write_npz(file, cloud)
    return count(cloud)


EXPORTER = Exporter(".npz", "arrays", _write)
