"""OpenCV: YAML, XML or JSON of cv2.FileStorage; matrices of camera and projector, then R and T between them, mm.

The projector is written as a second camera, as `cv2.stereoCalibrate` gives it: ``X_projector = R X_camera + T``.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from core.atomic import atomic_write
from core.errors import InputError
from core.exchange.formats.format import Format, coefficients, covariance, numbers, read_text, reading
from core.exchange.pinhole import Pair, Pinhole

_MATRIX = ("camera_matrix", "M1", "K1", "cameraMatrix1", "K"), ("projector_matrix", "M2", "K2", "cameraMatrix2")
_DISTORTION = (
    ("distortion_coefficients", "D1", "distCoeffs1", "D"),
    ("projector_distortion_coefficients", "D2", "distCoeffs2"),
)


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
        storage.write("parameter_covariance", pair.covariance)
    storage.write("fit_rms_px", float(pair.camera.rms_px))
    storage.write("projector_fit_rms_px", float(pair.projector.rms_px))
    with atomic_write(path) as file:
        file.write(storage.releaseAndGetString().encode())
    return [path]


def _read(path: Path) -> Pair:
    text = read_text(path)
    with reading(path, "opencv"):
        try:
            storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        except (cv2.error, SystemError) as error:
            raise InputError(path, "not a file of cv2.FileStorage", "choose its format with --from") from error
        try:
            devices = []
            for name, matrices, distortions, prefix in (
                ("camera", _MATRIX[0], _DISTORTION[0], "image"),
                ("projector", _MATRIX[1], _DISTORTION[1], "projector"),
            ):
                K = numbers(_first(storage, matrices), (3, 3))
                k = coefficients(_first(storage, distortions))
                width, height = (int(_first(storage, (f"{prefix}_{side}",))) for side in ("width", "height"))
                devices.append(Pinhole(name, width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2], k))
            R, T = numbers(_first(storage, ("R",)), (3, 3)), numbers(_first(storage, ("T",)), (3,))
            sigmas = storage.getNode("parameter_covariance")
            cov = None if sigmas.empty() else covariance(sigmas.mat())
        except cv2.error as error:
            raise InputError(path, f"a matrix cannot be read ({error.err})", "export it as opencv again") from error
        finally:
            storage.release()
    return Pair(devices[0], devices[1], R, T, cov)


def _first(storage: cv2.FileStorage, names: tuple[str, ...]) -> np.ndarray | float:
    for name in names:
        node = storage.getNode(name)
        if not node.empty():
            matrix = node.mat() if node.isMap() else None
            return matrix if matrix is not None else node.real()
    raise KeyError(names[0])


FORMAT = Format("opencv", ("k1", "k2", "p1", "p2", "k3"), _write, _read, (".yml", ".yaml", ".xml", ".json"))
