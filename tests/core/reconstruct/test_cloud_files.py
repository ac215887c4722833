"""The NPZ and PLY files, read back by hand."""

from __future__ import annotations

import io
import struct

import numpy as np

from core.model import PointCloud
from core.reconstruct import write_npz, write_ply


def _cloud() -> PointCloud:
    xyz = np.arange(18, dtype=np.float32).reshape(2, 3, 3) - 600
    xyz[0, 1] = np.nan
    sigma = np.full((2, 3, 3), 0.25, np.float32)
    return PointCloud(xyz, sigma, np.full((2, 3), 0.5, np.float32))


def _head(content: bytes) -> tuple[list[str], bytes]:
    head, _, body = content.partition(b"end_header\n")
    return head.decode("ascii").splitlines(), body


def test_ply_holds_the_valid_points_with_sigma_and_grey_values() -> None:
    cloud, file = _cloud(), io.BytesIO()
    image = np.array([[0, 50, 100], [100, 100, 100]], np.float32)
    assert write_ply(file, cloud, image) == 5
    lines, body = _head(file.getvalue())
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    assert "element vertex 5" in lines
    properties = [line.split()[1:] for line in lines if line.startswith("property")]
    names = ["x", "y", "z", "sigma_x", "sigma_y", "sigma_z", "red", "green", "blue"]
    assert properties == [["float" if i < 6 else "uchar", name] for i, name in enumerate(names)]
    vertices = list(struct.iter_unpack("<6f3B", body))
    assert len(vertices) == 5
    assert vertices[0] == (-600.0, -599.0, -598.0, 0.25, 0.25, 0.25, 0, 0, 0)
    assert vertices[1] == (-594.0, -593.0, -592.0, 0.25, 0.25, 0.25, 255, 255, 255)


def test_ply_of_the_depth_look_up_holds_the_sigma_of_z() -> None:
    file = io.BytesIO()
    write_ply(file, PointCloud(_cloud().xyz_mm, None, _cloud().sigma_depth_mm))
    lines, body = _head(file.getvalue())
    assert [line.split()[2] for line in lines if line.startswith("property")] == ["x", "y", "z", "sigma_z"]
    assert next(struct.iter_unpack("<4f", body)) == (-600.0, -599.0, -598.0, 0.5)


def test_ply_without_points_is_a_valid_file() -> None:
    file = io.BytesIO()
    assert write_ply(file, PointCloud(np.full((2, 2, 3), np.nan, np.float32))) == 0
    lines, body = _head(file.getvalue())
    assert "element vertex 0" in lines
    assert body == b""


def test_npz_holds_the_arrays_of_the_contract() -> None:
    cloud, file = _cloud(), io.BytesIO()
    write_npz(file, cloud)
    file.seek(0)
    with np.load(file) as stored:
        assert sorted(stored.files) == ["sigma", "sigma_depth", "xyz"]
        assert all(stored[name].dtype == np.float32 for name in stored.files)
        np.testing.assert_array_equal(stored["xyz"], cloud.xyz_mm)
        np.testing.assert_array_equal(stored["sigma"], cloud.sigma_mm)


def test_npz_of_the_depth_look_up_has_no_sigma() -> None:
    file = io.BytesIO()
    write_npz(file, PointCloud(_cloud().xyz_mm, None, _cloud().sigma_depth_mm))
    file.seek(0)
    with np.load(file) as stored:
        assert sorted(stored.files) == ["sigma_depth", "xyz"]
