"""GLB, binary glTF 2.0: the surface as one mesh with colours at its corners; points alone where there is no surface.

The format counts in metres: the mesh is in mm, and its node scales it. X right, Y up and a camera that looks along -Z
are its axes too.
"""

from __future__ import annotations

import json
import struct
from typing import Any, BinaryIO

import numpy as np

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, points_and_grey
from core.reconstruct.export.mesh import triangles

_FLOAT, _BYTE, _INT = 5126, 5121, 5125
_VERTICES, _INDICES = 34962, 34963
_POINTS, _TRIANGLES = 0, 4


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    points, grey = points_and_grey(cloud, image)
    faces = triangles(cloud).astype("<u4")
    data, views, accessors = b"", [], []  # type: bytes, list[dict[str, Any]], list[dict[str, Any]]

    def add(array: np.ndarray, kind: int, form: str, target: int, **more: Any) -> int:
        nonlocal data
        content = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content), "target": target})
        data += content + b"\0" * (-len(content) % 4)
        accessors.append({"bufferView": len(views) - 1, "componentType": kind, "type": form, **more})
        return len(accessors) - 1

    scene: dict[str, Any] = {"nodes": []}
    tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": "stripe-core"}, "scene": 0, "scenes": [scene]}
    if len(points):
        ends = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        attributes = {"POSITION": add(points.astype("<f4"), _FLOAT, "VEC3", _VERTICES, count=len(points), **ends)}
        if grey is not None:
            rgba = np.full((len(grey), 4), 255, np.uint8)
            rgba[:, :3] = grey[:, None]
            attributes["COLOR_0"] = add(rgba, _BYTE, "VEC4", _VERTICES, count=len(grey), normalized=True)
        primitive: dict[str, Any] = {"attributes": attributes, "mode": _TRIANGLES if len(faces) else _POINTS}
        if len(faces):
            primitive["indices"] = add(faces.ravel(), _INT, "SCALAR", _INDICES, count=faces.size)
        scene["nodes"] = [0]
        tree["nodes"] = [{"mesh": 0, "name": "points", "scale": [0.001, 0.001, 0.001]}]
        tree["meshes"] = [{"primitives": [primitive]}]
        tree |= {"accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(data)}]}
    else:
        del scene["nodes"]
    text = json.dumps(tree, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if data:
        chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    file.write(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return len(points)


EXPORTER = Exporter(".glb", "mesh", _write)
