"""What an exporter is: the ending of its files, and how they are written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import PointCloud
from core.numerics import quantile_of

Image = NDArray[Any]  # (H, W) grey values
_ROWS = 20_000  # written at once


@dataclass(frozen=True)
class Exporter:
    """A kind of file for points."""

    ending: str  #: of file names, with its dot
    holds: Literal["arrays", "points", "mesh"]
    #: ``(file, cloud, image) -> int``: the number of points written
    write: Callable[[BinaryIO, PointCloud, Image | None], int]


def count(cloud: PointCloud) -> int:
    """Give the number of points."""
    return int(np.count_nonzero(cloud.valid))


def grey_bytes(grey: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Grey values from 0 (black) to 255 (the brightest percent); what is not known is black."""
    bright = quantile_of(grey, 0.99) if np.isfinite(grey).any() else 1.0
    return np.clip(np.nan_to_num(grey) * (255 / max(bright, 1e-6)) + 0.5, 0, 255).astype(np.uint8)


def points_and_grey(cloud: PointCloud, image: Image | None) -> tuple[NDArray[np.float32], NDArray[np.uint8] | None]:
    """Give the valid points, (n, 3), and their grey values, (n,)."""
    valid = cloud.valid
    points = np.ascontiguousarray(cloud.xyz_mm[valid], np.float32)
    return points, None if image is None else grey_bytes(np.asarray(image, np.float32)[valid])


def write_lines(file: BinaryIO, form: str, rows: NDArray[Any]) -> None:
    """Write rows (n, k) as lines of text."""
    for start in range(0, len(rows), _ROWS):
        part = rows[start : start + _ROWS].tolist()
        file.write(("\n".join(form % tuple(row) for row in part) + "\n").encode("ascii"))
