"""OpenCV: YAML, XML or JSON of cv2.FileStorage; matrices of camera and projector, then R and T between them, mm.

The projector is written as a second camera, as `cv2.stereoCalibrate` gives it: ``X_projector = R X_camera + T``.
Files of others may lack the image sizes, and name their entries as OpenCV's sample, Brown University's procamcalib or
kamino410's procam-calibration (which misspells its rotation) do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from core.atomic import atomic_write
from core.exchange.formats.format import (
    Format,
    coefficients,
    covariance,
    matrix,
    read_text,
    reading,
    xml_root,
    yaml_mapping,
)
from core.exchange.pinhole import Pair, Pinhole

_MATRIX = (
    ("camera_matrix", "M1", "K1", "cameraMatrix1", "K", "cam_K", "cam_int"),
    ("projector_matrix", "M2", "K2", "cameraMatrix2", "proj_K", "proj_int"),
)
_DISTORTION = (
    ("distortion_coefficients", "D1", "distCoeffs1", "D", "cam_kc", "cam_dist"),
    ("projector_distortion_coefficients", "D2", "distCoeffs2", "proj_kc", "proj_dist"),
)
_ROTATION, _SHIFT = ("R", "rotation", "roration"), ("T", "translation")
_SIGMAS = "parameter_covariance"


def _write(pair: Pair, path: Path) -> list[Path]:
    kind = path.suffix.lower() if path.suffix.lower() in FORMAT.endings else FORMAT.endings[0]
    storage = cv2.FileStorage(kind, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for device, name, distortion, prefix in (
        (pair.camera, _MATRIX[0][0], _DISTORTION[0][0], "image"),
        (pair.projector, _MATRIX[1][0], _DISTORTION[1][0], "projector"),
    ):
        storage.write(f"{prefix}_width", device.width)
        storage.write(f"{prefix}_height", device.height)
        storage.write(name, device.matrix)
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


def _read(path: Path, names: Sequence[str] = ()) -> Pair:
    with reading(path, "opencv"):
        stored = _mapping(path)
        devices = []
        for name, matrices, distortions, prefix in (
            ("camera", _MATRIX[0], _DISTORTION[0], "image"),
            ("projector", _MATRIX[1], _DISTORTION[1], "projector"),
        ):
            K = matrix(_first(stored, matrices), (3, 3))
            k = coefficients(matrix(_first(stored, distortions), (-1,)))
            width, height = (int(stored.get(f"{prefix}_{side}", 0)) for side in ("width", "height"))
            devices.append(Pinhole(name, width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2], k))
        R, T = matrix(_first(stored, _ROTATION), (3, 3)), matrix(_first(stored, _SHIFT), (3,))
        cov = covariance(matrix(stored[_SIGMAS], (30, 30))) if _SIGMAS in stored else None
    return Pair(devices[0], devices[1], R, T, cov)


def _mapping(path: Path) -> Mapping[str, Any]:
    """Read what a file holds by name; OpenCV's own reader writes past matrices of a damaged file (5.0)."""
    text = read_text(path)
    if text.lstrip().startswith("<"):
        return {e.tag: {part.tag: (part.text or "").split() for part in e} or e.text for e in xml_root(text)}
    return yaml_mapping(path, "opencv", text)


def _first(stored: Mapping[str, Any], names: tuple[str, ...]) -> Any:
    """Give the entry that is there by one of the names."""
    name = next((name for name in names if name in stored), None)
    if name is None:
        raise KeyError(names[0])
    return stored[name]


FORMAT = Format("opencv", ("k1", "k2", "p1", "p2", "k3"), _write, _read, (".yml", ".yaml", ".xml", ".json"))
