"""MATLAB: a `.mat` with the struct `stereoParams`, as `toStruct` gives it; pixels count from 1, so cx + 1.

``IntrinsicMatrix`` is transposed, and rows multiply from the left: ``[x]2 = [x]1 RotationOfCamera2 +
TranslationOfCamera2`` in mm. In MATLAB: ``s = load(file); p = stereoParameters(s.stereoParams)``; the camera alone:
``cameraParameters(s.stereoParams.CameraParameters1)``. `parameterCovariance` beside it is this program's own: MATLAB
keeps the errors that it estimates in an object apart.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from core.atomic import atomic_write
from core.errors import InputError
from core.exchange.formats.format import Format, covariance, numbers, read_bytes, reading
from core.exchange.pinhole import Pair, Pinhole

# on some damaged files the library does not raise, but ends its process: it gets one of its own
_READER = """
import json, sys, scipy.io
stored = scipy.io.loadmat(sys.argv[1], squeeze_me=True, simplify_cells=True)
found = stored["stereoParams"], stored.get("parameterCovariance")
json.dump(found, sys.stdout, default=lambda value: value.tolist())
"""
_LONGEST_S = 60.0


def _write(pair: Pair, path: Path) -> list[Path]:
    stored = {
        "CameraParameters1": _struct(pair.camera),
        "CameraParameters2": _struct(pair.projector),
        "RotationOfCamera2": pair.rotation.T,
        "TranslationOfCamera2": np.asarray(pair.translation_mm, np.float64).reshape(1, 3),
        "Version": "9.0",
    }
    import scipy.io

    with atomic_write(path) as file:
        known = {} if pair.covariance is None else {"parameterCovariance": pair.covariance}
        scipy.io.savemat(file, {"stereoParams": stored, **known}, oned_as="row")
    return [path]


def _struct(p: Pinhole) -> dict[str, Any]:
    k1, k2, p1, p2, k3 = p.distortion[:5]
    K = p.matrix + np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 0, 0]])
    return {
        "RadialDistortion": np.array([k1, k2, k3]),
        "TangentialDistortion": np.array([p1, p2]),
        "WorldPoints": np.zeros((0, 0)),
        "WorldUnits": "mm",
        "EstimateSkew": False,
        "NumRadialDistortionCoefficients": 3.0,
        "EstimateTangentialDistortion": True,
        "TranslationVectors": np.zeros((0, 0)),
        "ReprojectionErrors": np.zeros((0, 0)),
        "DetectedKeypoints": np.zeros((0, 0)),
        "RotationVectors": np.zeros((0, 0)),
        "ImageSize": np.array([p.height, p.width], np.float64),
        "IntrinsicMatrix": K.T,
        "Version": "9.0",
    }


def _read(path: Path, names: Sequence[str] = ()) -> Pair:
    read_bytes(path)
    try:
        done = subprocess.run(
            [sys.executable, "-c", _READER, str(path)], capture_output=True, timeout=_LONGEST_S, check=True
        )
        s, known = json.loads(done.stdout)
    except (subprocess.SubprocessError, ValueError) as error:
        seen = "no .mat file of version 7 or earlier with the struct stereoParams"
        raise InputError(path, seen, "save it with -v7") from error
    with reading(path, "matlab"):
        R = numbers(s["RotationOfCamera2"], (3, 3)).T
        t = numbers(s["TranslationOfCamera2"], (3,))
        first, second = _device("camera", s["CameraParameters1"]), _device("projector", s["CameraParameters2"])
        return Pair(first, second, R, t, None if known is None else covariance(known))


def _device(name: str, s: dict[str, Any]) -> Pinhole:
    K = numbers(s["IntrinsicMatrix"], (3, 3)).T
    if abs(K[0, 1]) > 1e-9 * abs(K[0, 0]):
        raise ValueError("a skew, which this program does not have")
    radial = [*numbers(s["RadialDistortion"], (-1,)).tolist(), 0.0][:3]
    p1, p2 = numbers(s["TangentialDistortion"], (2,)).tolist()
    height, width = (int(n) for n in numbers(s["ImageSize"], (2,)))
    k = (radial[0], radial[1], p1, p2, radial[2], 0.0, 0.0, 0.0)
    return Pinhole(name, width, height, K[0, 0], K[1, 1], K[0, 2] - 1, K[1, 2] - 1, k)


FORMAT = Format("matlab", ("k1", "k2", "p1", "p2", "k3"), _write, _read, (".mat",))
