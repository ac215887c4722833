"""Agisoft Metashape: a calibration XML of each device; the projector's beside it, with its transform in metres.

``u = W/2 + cx + x' f + x' b1 + y' b2``, ``v = H/2 + cy + y' f`` from the corner of the top-left pixel, with
``x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2x²) + 2 p2 x y``: p1 and p2 are OpenCV's p2 and p1, and b1 = fx - fy.
The projector's `transform` takes its coordinates to the camera's, as that of a Metashape camera does to its chunk's,
and `parameter_covariance` beside it is this program's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from core.exchange.formats.format import (
    METRE_MM,
    Format,
    covariance,
    further_files,
    numbers,
    read_text,
    reading,
    second_file,
    write_texts,
    xml_root,
)
from core.exchange.pinhole import Pair, Pinhole

if TYPE_CHECKING:
    from xml.etree import ElementTree

_SIGMAS = "parameter_covariance"


def _write(pair: Pair, path: Path) -> list[Path]:
    pose = np.eye(4)
    pose[:3, :3] = pair.rotation.T
    pose[:3, 3] = -pair.rotation.T @ np.asarray(pair.translation_mm) / METRE_MM
    more = f"  <transform>{_line(pose)}</transform>\n"
    if pair.covariance is not None:
        more += f"  <{_SIGMAS}>{_line(pair.covariance)}</{_SIGMAS}>\n"
    texts = {path: _text(pair.camera), second_file(path): _text(pair.projector, more)}
    return write_texts(texts)


def _line(values: np.ndarray) -> str:
    return " ".join(repr(float(v)) for v in values.ravel())


def _text(p: Pinhole, more: str = "") -> str:
    k1, k2, p1, p2, k3 = p.distortion[:5]
    values = {
        "f": p.fy,
        "cx": p.cx + 0.5 - p.width / 2,
        "cy": p.cy + 0.5 - p.height / 2,
        "b1": p.fx - p.fy,
        "k1": k1,
        "k2": k2,
        "k3": k3,
        "p1": p2,
        "p2": p1,
    }
    told = "".join(f"  <{name}>{float(v)!r}</{name}>\n" for name, v in values.items())
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<calibration>\n  <projection>frame</projection>\n'
        f"  <width>{p.width}</width>\n  <height>{p.height}</height>\n{told}{more}</calibration>\n"
    )


def _read(path: Path, names: Sequence[str] = ()) -> Pair:
    first, _ = _device("camera", path)
    others, known = [], None
    for other in further_files(path, names):
        device, root = _device("projector", other)
        with reading(other, "agisoft"):
            text = root.findtext("transform")
            if text is None:
                raise KeyError("transform")
            pose = numbers([float(v) for v in text.split()], (4, 4))
            told = root.findtext(_SIGMAS)
            known = None if told is None else covariance([float(v) for v in told.split()])
        R = pose[:3, :3].T
        others.append((device, R, -R @ pose[:3, 3] * METRE_MM))
    return Pair(first, *others[0], known if len(others) == 1 else None, tuple(others[1:]))


def _device(name: str, path: Path) -> tuple[Pinhole, ElementTree.Element]:
    text = read_text(path)
    with reading(path, "agisoft"):
        root = xml_root(text)
        if (root.findtext("projection") or "frame") != "frame":
            raise ValueError(f"projection {root.findtext('projection')}; frame can be read")
        v = {e.tag: float(e.text or 0) for e in root if e.tag not in ("projection", "date", "transform", _SIGMAS)}
        if any(v.get(name) for name in ("b2", "k4", "p3", "p4")):
            raise ValueError("b2, k4, p3 or p4, which this program does not have")
        f = v["f"]
        numbers(list(v.values()), (-1,))
        k = (v.get("k1", 0.0), v.get("k2", 0.0), v.get("p2", 0.0), v.get("p1", 0.0), v.get("k3", 0.0), 0.0, 0.0, 0.0)
        width, height = int(v["width"]), int(v["height"])
        cx, cy = v.get("cx", 0.0) + width / 2 - 0.5, v.get("cy", 0.0) + height / 2 - 0.5
    return Pinhole(name, width, height, f + v.get("b1", 0.0), f, cx, cy, k), root


FORMAT = Format("agisoft", ("k1", "k2", "p1", "p2", "k3"), _write, _read, (".xml",))
