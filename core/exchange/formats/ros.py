"""ROS: a `camera_info` YAML for each device (REP 104), plumb_bob; the projector's beside it, with its pose in metres.

The projector's file has the further entries ``T_projector_camera``, four by four, and ``parameter_covariance``, which
readers of `camera_info` ignore.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from core.exchange.formats.format import (
    METRE_MM,
    Format,
    coefficients,
    covariance,
    flow,
    further_files,
    matrix,
    reading,
    second_file,
    write_texts,
    yaml_mapping,
)
from core.exchange.pinhole import Pair, Pinhole


def _write(pair: Pair, path: Path) -> list[Path]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = pair.rotation, np.asarray(pair.translation_mm) / METRE_MM
    known = "" if pair.covariance is None else _entry("parameter_covariance", pair.covariance)
    texts = {
        path: _text(pair.camera),
        second_file(path): _text(pair.projector) + _entry("T_projector_camera", pose) + known,
    }
    return write_texts(texts)


def _text(p: Pinhole) -> str:
    K = p.matrix
    return (
        f"image_width: {p.width}\nimage_height: {p.height}\ncamera_name: {p.name}\n"
        + _entry("camera_matrix", K)
        + "distortion_model: plumb_bob\n"
        + _entry("distortion_coefficients", np.array([p.distortion[:5]]))
        + _entry("rectification_matrix", np.eye(3))
        + _entry("projection_matrix", np.hstack([K, np.zeros((3, 1))]))
    )


def _entry(name: str, values: np.ndarray) -> str:
    rows, cols = values.shape
    return f"{name}:\n  rows: {rows}\n  cols: {cols}\n  data: {flow(values)}\n"


def _read(path: Path, names: Sequence[str] = ()) -> Pair:
    camera, others, cov = yaml_mapping(path, "ros"), [], None
    with reading(path, "ros"):
        first = _device("camera", camera)
    for other in further_files(path, names):
        stored = yaml_mapping(other, "ros")
        with reading(other, "ros"):
            pose = matrix(stored["T_projector_camera"], (4, 4))
            others.append((_device("projector", stored), pose[:3, :3], pose[:3, 3] * METRE_MM))
            if (known := stored.get("parameter_covariance")) is not None:
                cov = covariance(matrix(known, (30, 30)))
    return Pair(first, *others[0], cov if len(others) == 1 else None, tuple(others[1:]))


def _device(name: str, data: Mapping[str, Any]) -> Pinhole:
    if data.get("distortion_model", "plumb_bob") not in ("plumb_bob", "rational_polynomial"):
        raise ValueError(f"distortion_model {data['distortion_model']}")
    K = matrix(data["camera_matrix"], (3, 3))
    k = coefficients(matrix(data["distortion_coefficients"], (-1,)))
    return Pinhole(name, int(data["image_width"]), int(data["image_height"]), K[0, 0], K[1, 1], K[0, 2], K[1, 2], k)


FORMAT = Format("ros", ("k1", "k2", "p1", "p2", "k3"), _write, _read, (".yaml", ".yml"))
