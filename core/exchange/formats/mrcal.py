"""mrcal: a `.cameramodel` of each device, LENSMODEL_OPENCV5 (k1, k2, p1, p2, k3); the projector's beside it, metres.

The reference frame is the camera's: its extrinsics are zero, the projector's are ``rt_projector_camera``. The
covariance is a comment in the camera's file: mrcal's own `optimization_inputs` are all observations of a calibration.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from core.exchange.formats.format import (
    METRE_MM,
    Format,
    from_first,
    further_files,
    noted,
    noted_covariance,
    numbers,
    read_text,
    reading,
    second_file,
    write_texts,
)
from core.exchange.pinhole import Pair, Pinhole
from core.geometry import matrix_from_rotation_vector, rotation_vector_from_matrix

_LENSES = {"LENSMODEL_PINHOLE": 0, "LENSMODEL_OPENCV4": 4, "LENSMODEL_OPENCV5": 5, "LENSMODEL_OPENCV8": 8}


def _write(pair: Pair, path: Path) -> list[Path]:
    pose = [*rotation_vector_from_matrix(pair.rotation), *(np.asarray(pair.translation_mm) / METRE_MM)]
    texts = {path: _text(pair.camera, [0.0] * 6) + noted(pair), second_file(path): _text(pair.projector, pose)}
    return write_texts(texts)


def _text(p: Pinhole, pose: Any) -> str:
    intrinsics = [p.fx, p.fy, p.cx, p.cy, *p.distortion[:5]]
    return (
        "{\n    'lensmodel':  'LENSMODEL_OPENCV5',\n\n"
        "    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....\n"
        f"    'intrinsics': [ {_list(intrinsics)} ],\n\n"
        "    # extrinsics are rt_fromref\n"
        f"    'extrinsics': [ {_list(pose)} ],\n\n"
        f"    'imagersize': [ {p.width}, {p.height} ]\n}}\n"
    )


def _list(values: Any) -> str:
    return ", ".join(repr(float(v)) for v in values)


def _read(path: Path, names: Sequence[str] = ()) -> Pair:
    first, *base = _device("camera", path)
    others = []
    for file in further_files(path, names):
        device, *pose = _device("projector", file)
        R, t = from_first((base[0], base[1]), (pose[0], pose[1]))
        others.append((device, R, t * METRE_MM))
    with reading(path, "mrcal"):
        known = noted_covariance(read_text(path))
    return Pair(first, *others[0], known, tuple(others[1:]))


def _device(name: str, path: Path) -> tuple[Pinhole, np.ndarray, np.ndarray]:
    text = read_text(path)
    with reading(path, "mrcal"):
        try:
            data = ast.literal_eval(text.strip())
        except (SyntaxError, MemoryError) as error:
            raise ValueError("no dictionary") from error
        if not isinstance(data, dict):
            raise ValueError("no dictionary")
        lens = data["lensmodel"]
        if lens not in _LENSES:
            raise ValueError(f"{lens}; {', '.join(_LENSES)} can be read")
        fx, fy, cx, cy, *k = numbers(data["intrinsics"], (4 + _LENSES[lens],)).tolist()
        width, height = (int(n) for n in data["imagersize"])
        pose = numbers(data["extrinsics"], (6,))
        k = [*k, *[0.0] * (8 - len(k))]
    return Pinhole(name, width, height, fx, fy, cx, cy, tuple(k)), matrix_from_rotation_vector(pose[:3]), pose[3:]


FORMAT = Format("mrcal", ("k1", "k2", "p1", "p2", "k3"), _write, _read, (".cameramodel",))
