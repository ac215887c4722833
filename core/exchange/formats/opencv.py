"""OpenCV: YAML, XML or JSON of cv2.FileStorage; matrices of camera and projector, then R and T between them, mm.

The projector is written as a second camera, as `cv2.stereoCalibrate` gives it: ``X_projector = R X_camera + T``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from core.atomic import atomic_write
from core.exchange.formats.format import (
    Format,
    coefficients,
    covariance,
    numbers,
    read_text,
    reading,
    xml_root,
    yaml_mapping,
)
from core.exchange.pinhole import Pair, Pinhole

_MATRIX = ("camera_matrix", "M1", "K1", "cameraMatrix1", "K"), ("projector_matrix", "M2", "K2", "cameraMatrix2")
_DISTORTION = (
    ("distortion_coefficients", "D1", "distCoeffs1", "D"),
    ("projector_distortion_coefficients", "D2", "distCoeffs2"),
)
_SIGMAS = "parameter_covariance"


def _write(pair: Pair, path: Path) -> list[Path]:
    kind = path.suffix.lower() if path.suffix.lower() in FORMAT.endings else FORMAT.endings[0]
    storage = cv2.FileStorage(kind, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for device, matrix, distortion, prefix in (
        (pair.camera, _MATRIX[0][0], _DISTORTION[0][0], "image"),
        (pair.projector, _MATRIX[1][0], _DISTORTION[1][0], "projector"),
    ):
        storage.write(f"{prefix}_width", device.width)
        storage.write(f"{prefix}_height", device.height)
        storage.write(matrix, device.matrix)
        k = device.distortion
        storage.write(distortion, np.array([k if any(k[5:]) else k[:5]]))
    storage.write("R", np.ascontiguousarray(pair.rotation))
    storage.write("T", np.asarray(pair.translation_mm, np.float64).reshape(3, 1))
    if pair.covariance is not None:
        storage.write(_SIGMAS, pair.covariance)
    storage.write("fit_rms_px", float(pair.camera.rms_px))
    storage.write("projector_fit_rms_px", float(pair.projector.rms_px))
    with atomic_write(path) as file:
        file.write(storage.releaseAndGetString().encode())
    return [path]


def _read(path: Path) -> Pair:
    with reading(path, "opencv"):
        stored = _mapping(path)
        devices = []
        for name, matrices, distortions, prefix in (
            ("camera", _MATRIX[0], _DISTORTION[0], "image"),
            ("projector", _MATRIX[1], _DISTORTION[1], "projector"),
        ):
            K = numbers(_first(stored, matrices), (3, 3))
            k = coefficients(_first(stored, distortions))
            width, height = (int(stored[f"{prefix}_{side}"]) for side in ("width", "height"))
            devices.append(Pinhole(name, width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2], k))
        R, T = numbers(_first(stored, ("R",)), (3, 3)), numbers(_first(stored, ("T",)), (3,))
        cov = covariance(_first(stored, (_SIGMAS,))) if _SIGMAS in stored else None
    return Pair(devices[0], devices[1], R, T, cov)


def _mapping(path: Path) -> Mapping[str, Any]:
    """Read what a file holds by name; OpenCV's own reader writes past matrices of a damaged file (5.0)."""
    text = read_text(path)
    if text.lstrip().startswith("<"):
        return {e.tag: {part.tag: (part.text or "").split() for part in e} or e.text for e in xml_root(text)}
    return yaml_mapping(path, "opencv", re.sub(r"\A%YAML.*|!!opencv-matrix\b", "", text))


def _first(stored: Mapping[str, Any], names: tuple[str, ...]) -> np.ndarray:
    """Give the matrix that is there by one of the names."""
    matrix = next((stored[name] for name in names if name in stored), None)
    if matrix is None:
        raise KeyError(names[0])
    return numbers(matrix["data"], (int(numbers(matrix["rows"], (1,))[0]), int(numbers(matrix["cols"], (1,))[0])))


FORMAT = Format("opencv", ("k1", "k2", "p1", "p2", "k3"), _write, _read, (".yml", ".yaml", ".xml", ".json"))
