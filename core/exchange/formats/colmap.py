"""COLMAP: `cameras.txt` with two FULL_OPENCV cameras; pixels count from the corner of the top-left one, so cx + 0.5.

The orientation stands in `images.txt` beside it, one image of each device: world to camera, Hamilton quaternion with w
first, mm; with the empty `points3D.txt` that makes a model which COLMAP opens. The covariance is a comment in
`cameras.txt`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from core.exchange.formats.format import (
    Format,
    from_first,
    noted,
    noted_covariance,
    numbers,
    read_text,
    reading,
    write_texts,
)
from core.exchange.pinhole import Pair, Pinhole
from core.geometry import matrix_from_rotation_vector, rotation_vector_from_matrix

HALF = 0.5
_MODELS = {  # which of OpenCV's coefficients follow fx, fy, cx, cy
    "PINHOLE": (),
    "OPENCV": (0, 1, 2, 3),
    "FULL_OPENCV": (0, 1, 2, 3, 4, 5, 6, 7),
}


def _write(pair: Pair, path: Path) -> list[Path]:
    cameras = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]: 1 is the camera, 2 the projector\n"
    for number, p in ((1, pair.camera), (2, pair.projector)):
        values = [p.fx, p.fy, p.cx + HALF, p.cy + HALF, *p.distortion]
        cameras += f"{number} FULL_OPENCV {p.width} {p.height} {' '.join(repr(float(v)) for v in values)}\n"
    turn = rotation_vector_from_matrix(pair.rotation)
    half = float(np.linalg.norm(turn)) / 2
    quaternion = np.cos(half), *(np.sinc(half / np.pi) / 2 * turn)
    pose = " ".join(repr(float(v)) for v in (*quaternion, *pair.translation_mm))
    images = (
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME, then a line of points; mm\n"
        f"1 1.0 0.0 0.0 0.0 0.0 0.0 0.0 1 camera.png\n\n2 {pose} 2 projector.png\n\n"
    )
    texts = {
        path: cameras + noted(pair),
        path.with_name("images.txt"): images,
        path.with_name("points3D.txt"): "# no points\n",
    }
    return write_texts(texts)


def _read(path: Path, names: Sequence[str] = ()) -> Pair:
    beside = path.with_name("images.txt")
    cameras, images = read_text(path), read_text(beside)
    with reading(path, "colmap"):
        devices = {fields[0]: _device(fields) for fields in _lines(cameras)}
        if len(devices) < 2:
            raise ValueError(f"{len(devices)} cameras in place of camera and projector")
        known = noted_covariance(cameras)
    with reading(beside, "colmap"):
        poses = {}
        for line in images.splitlines():  # every second line holds points, and may be empty
            fields = line.split()
            if len(fields) == 10 and not line.startswith("#"):
                poses[fields[8]] = numbers([float(v) for v in fields[1:8]], (7,))
        first, *further = sorted(devices, key=int)
        base, *others = (_pose(poses[key]) for key in (first, *further))
    found = [(devices[key], *from_first(base, pose)) for key, pose in zip(further, others, strict=True)]
    return Pair(devices[first], *found[0], known, tuple(found[1:]))


def _pose(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    w, turn = values[0], values[1:4]
    if not values[:4].any():
        raise ValueError("a quaternion of zeros")
    sine = float(np.linalg.norm(turn))
    return matrix_from_rotation_vector(2 * np.arctan2(sine, w) / (sine or 1.0) * turn), values[4:]


def _lines(text: str) -> list[list[str]]:
    return [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]


def _device(fields: list[str]) -> Pinhole:
    model, width, height = fields[1], int(fields[2]), int(fields[3])
    if model not in _MODELS:
        raise ValueError(f"camera model {model}; {', '.join(_MODELS)} can be read")
    fx, fy, cx, cy, *rest = numbers([float(v) for v in fields[4:]], (4 + len(_MODELS[model]),)).tolist()
    k = np.zeros(8)
    k[list(_MODELS[model])] = rest
    name = "camera" if fields[0] == "1" else "projector"
    return Pinhole(name, width, height, fx, fy, cx - HALF, cy - HALF, tuple(k.tolist()))


FORMAT = Format("colmap", ("k1", "k2", "p1", "p2", "k3"), _write, _read, (".txt",))
