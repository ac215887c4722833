"""Kalibr: a camera chain of camera (cam0) and projector (cam1), pinhole and radtan: k1, k2, p1, p2; metres.

Chains of others may be of any number of devices.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from core.exchange.formats.format import METRE_MM, Format, covariance, flow, numbers, reading, write_texts, yaml_mapping
from core.exchange.pinhole import Pair, Pinhole


def _write(pair: Pair, path: Path) -> list[Path]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = pair.rotation, np.asarray(pair.translation_mm) / METRE_MM
    rows = "".join(f"  - {flow(row)}\n" for row in pose)
    known = "" if pair.covariance is None else f"  parameter_covariance: {flow(pair.covariance)}\n"
    text = _text("cam0", pair.camera) + _text("cam1", pair.projector) + f"  T_cn_cnm1:\n{rows}{known}"
    return write_texts({path: text})


def _text(key: str, p: Pinhole) -> str:
    return (
        f"{key}:\n  cam_overlaps: [{1 if key == 'cam0' else 0}]\n  camera_model: pinhole\n"
        f"  distortion_coeffs: {flow(p.distortion[:4])}\n  distortion_model: radtan\n"
        f"  intrinsics: {flow([p.fx, p.fy, p.cx, p.cy])}\n  resolution: [{p.width}, {p.height}]\n"
        f"  rostopic: /{p.name}/image_raw\n"
    )


def _read(path: Path, names: Sequence[str] = ()) -> Pair:
    data = yaml_mapping(path, "kalibr")
    with reading(path, "kalibr"):
        first, pose, others = _device("camera", data["cam0"]), np.eye(4), []
        for k in range(1, max(2, sum(re.fullmatch(r"cam\d+", str(key)) is not None for key in data))):
            entry = data[f"cam{k}"]
            pose = numbers(entry["T_cn_cnm1"], (4, 4)) @ pose  # of each from the one before
            others.append((_device("projector", entry), pose[:3, :3], pose[:3, 3] * METRE_MM))
        known = data["cam1"].get("parameter_covariance")
        return Pair(first, *others[0], None if known is None else covariance(known), tuple(others[1:]))


def _device(name: str, data: Mapping[str, Any]) -> Pinhole:
    models = data["camera_model"], data["distortion_model"]
    if models[0] != "pinhole" or models[1] not in ("radtan", "none"):
        raise ValueError(f"{models[0]} with {models[1]}; pinhole with radtan can be read")
    fx, fy, cx, cy = numbers(data["intrinsics"], (4,)).tolist()
    k = tuple(numbers(data["distortion_coeffs"], (4,)).tolist()) if models[1] == "radtan" else (0.0,) * 4
    width, height = (int(n) for n in data["resolution"])
    return Pinhole(name, width, height, fx, fy, cx, cy, (*k, 0.0, 0.0, 0.0, 0.0))


FORMAT = Format("kalibr", ("k1", "k2", "p1", "p2"), _write, _read, (".yaml", ".yml"))
