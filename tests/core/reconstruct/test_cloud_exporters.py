"""Every kind of point file, read back by a small reader of its own specification that shares no code with ours."""

from __future__ import annotations

import binascii
import io
import json
import struct
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from core.errors import InputError
from core.model import PointCloud
from core.pipeline.reconstruct import check_cloud, write_cloud
from core.reconstruct import EXPORTERS, exporter_for

HEIGHT, WIDTH = 5, 7


@pytest.fixture
def cloud() -> PointCloud:
    """A plane 600 mm away with a step of 40 mm at column 4 and a hole."""
    v, u = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    z = np.where(u < 4, -600.0, -640.0)
    xyz = np.stack([u - 3, 2 - v, z], axis=-1).astype(np.float32)
    xyz[1, 1] = np.nan
    return PointCloud(xyz, None, np.full((HEIGHT, WIDTH), 0.02, np.float32))


IMAGE = np.linspace(10, 100, HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH)


def written(ending: str, cloud: PointCloud, image=IMAGE) -> bytes:
    file = io.BytesIO()
    count = EXPORTERS[ending].write(file, cloud, image)
    assert count == np.isfinite(cloud.xyz_mm[..., 0]).sum()
    return file.getvalue()


def points(cloud: PointCloud) -> np.ndarray:
    return cloud.xyz_mm[np.isfinite(cloud.xyz_mm[..., 0])]


def sound_faces(corners: np.ndarray) -> None:
    """Of 24 squares, those over the step and around the hole are open: 6 columns - 1, 4 rows, less the hole's six."""
    assert len(corners) == 2 * 5 * 4 - 6
    assert np.ptp(corners[..., 2], axis=1).max() < 1
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normal[:, 2] > 0).all()  # towards the camera


def test_all_endings_of_the_contract_are_there() -> None:
    assert set(EXPORTERS) == {f".{name}" for name in ["npz", "ply", "stl", "obj", "glb", "pcd", "xyz", "e57", "las"]}


@pytest.mark.parametrize("ending", [".stl", ".obj", ".glb"])
def test_points_of_several_images_make_no_mesh(ending: str, cloud: PointCloud, tmp_path: Path) -> None:
    """Files without a triangle were written, and called so many points."""
    joined = PointCloud(points(cloud)[None], None, np.full((1, len(points(cloud))), 0.02, np.float32))
    out = tmp_path / f"joined{ending}"
    for attempt in (lambda: check_cloud(out, joined=True), lambda: write_cloud(out, IMAGE, joined)):
        with pytest.raises(InputError, match=r"triangles between neighbouring pixels.*\.npz.*--camera"):
            attempt()
    assert not out.exists()
    check_cloud(out)
    assert write_cloud(out.with_suffix(".ply"), joined.xyz_mm[..., 2], joined) == len(points(cloud))


def test_an_unknown_ending_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"\.abc.*\.e57.*\.stl"):
        exporter_for(Path("a.abc"))


def test_stl(cloud: PointCloud) -> None:
    data = written(".stl", cloud)
    assert not data.startswith(b"solid")  # that would be the text form
    (count,) = struct.unpack_from("<I", data, 80)
    assert len(data) == 84 + 50 * count
    facets = np.array([struct.unpack_from("<12f", data, 84 + 50 * i) for i in range(count)]).reshape(-1, 4, 3)
    sound_faces(facets[:, 1:])
    assert np.allclose(facets[:, 0], [0, 0, 1])


def test_obj(cloud: PointCloud) -> None:
    lines = [line.split() for line in written(".obj", cloud).decode().splitlines()]
    vertices = np.array([[float(x) for x in line[1:]] for line in lines if line[0] == "v"])
    faces = np.array([[int(x) for x in line[1:]] for line in lines if line[0] == "f"])
    assert np.allclose(vertices[:, :3], points(cloud))
    assert vertices.shape[1] == 6
    assert 0 <= vertices[:, 3:].min() < vertices[:, 3:].max() == 1
    assert faces.min() >= 1
    sound_faces(vertices[faces - 1, :3])


def test_glb(cloud: PointCloud) -> None:
    data = written(".glb", cloud)
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    tree = json.loads(data[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert (size % 4, binary_size % 4, kind) == (0, 0, b"BIN\0")
    binary = data[28 + size :]
    assert len(binary) == binary_size == tree["buffers"][0]["byteLength"]

    def array(number: int) -> np.ndarray:
        accessor = tree["accessors"][number]
        view = tree["bufferViews"][accessor["bufferView"]]
        dtype = {5126: "<f4", 5121: "u1", 5125: "<u4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        start = view["byteOffset"]
        return np.frombuffer(binary[start : start + view["byteLength"]], dtype).reshape(accessor["count"], width)

    (primitive,) = tree["meshes"][0]["primitives"]
    position = array(primitive["attributes"]["POSITION"])
    assert np.allclose(position * tree["nodes"][0]["scale"], points(cloud) / 1000)  # the format counts in metres
    accessor = tree["accessors"][primitive["attributes"]["POSITION"]]
    assert np.allclose(accessor["min"], position.min(axis=0))
    assert np.allclose(accessor["max"], position.max(axis=0))
    assert array(primitive["attributes"]["COLOR_0"]).shape == (len(position), 4)
    sound_faces(position[array(primitive["indices"]).reshape(-1, 3)])


def test_pcd(cloud: PointCloud) -> None:
    data = written(".pcd", cloud)
    head, _, body = data.partition(b"DATA binary\n")
    fields = dict(line.split(" ", 1) for line in head.decode().splitlines()[1:])
    assert fields["FIELDS"] == "x y z rgb"
    assert (fields["WIDTH"], fields["HEIGHT"], fields["POINTS"]) == (str(WIDTH), str(HEIGHT), str(WIDTH * HEIGHT))
    found = np.array(list(struct.iter_unpack("<fff4B", body)))
    assert np.array_equal(found[:, :3].reshape(HEIGHT, WIDTH, 3).astype(np.float32), cloud.xyz_mm, equal_nan=True)
    assert found[-1, 3:].tolist() == [255, 255, 255, 0]


def test_xyz(cloud: PointCloud) -> None:
    assert np.allclose(np.loadtxt(io.BytesIO(written(".xyz", cloud))), points(cloud), atol=1e-5)


def test_las(cloud: PointCloud) -> None:
    data = written(".las", cloud)
    assert data[:4] == b"LASF"
    assert data[24:26] == bytes([1, 2])
    (header,) = struct.unpack_from("<H", data, 94)
    offset, variable, kind, size, count = struct.unpack_from("<IIBHI", data, 96)
    assert (header, offset, variable, kind, size) == (227, 227, 0, 2, 26)
    assert len(data) == offset + size * count
    scale, shift = np.array(struct.unpack_from("<3d", data, 131)), np.array(struct.unpack_from("<3d", data, 155))
    raw = np.array([struct.unpack_from("<3i", data, offset + size * i) for i in range(count)])
    found = raw * scale + shift
    assert np.allclose(found, points(cloud), atol=1e-4)
    bounds = struct.unpack_from("<6d", data, 179)
    assert np.allclose(bounds[::2], found.max(axis=0))
    assert np.allclose(bounds[1::2], found.min(axis=0))
    assert struct.unpack_from("<3H", data, offset + size * (count - 1) + 20) == (65535, 65535, 65535)


def crc_32c(data: bytes) -> int:
    """Bit by bit, as the polynomial's definition says."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def test_e57(cloud: PointCloud) -> None:
    assert crc_32c(b"123456789") == 0xE3069283  # the published check value
    data = written(".e57", cloud)
    assert len(data) % 1024 == 0
    pages = [data[i : i + 1024] for i in range(0, len(data), 1024)]
    for page in pages:
        assert struct.unpack(">I", page[1020:]) == (crc_32c(page[:1020]),)
    logical = b"".join(page[:1020] for page in pages)
    magic, major, minor, size, xml_at, xml_size, page_size = struct.unpack_from("<8sIIQQQQ", logical)
    assert (magic, major, minor, size, page_size) == (b"ASTM-E57", 1, 0, len(data), 1024)

    def at(physical: int) -> int:
        return physical // 1024 * 1020 + physical % 1024

    root = ElementTree.fromstring(logical[at(xml_at) : at(xml_at) + xml_size])
    space = "{http://www.astm.org/COMMIT/E57/2010-e57-v1.0}"
    (entry,) = root.iter(f"{space}points")
    section = at(int(entry.get("fileOffset")))
    kind, _, length, data_at, index_at = struct.unpack_from("<B7sQQQ", logical, section)
    assert (kind, length % 4) == (1, 0)
    assert logical[at(index_at)] == 0
    names = [child.tag.removeprefix(space) for child in entry.find(f"{space}prototype")]
    assert names == ["cartesianX", "cartesianY", "cartesianZ", "colorRed", "colorGreen", "colorBlue"]
    packet = at(data_at)
    kind, _, less, streams = struct.unpack_from("<BBHH", logical, packet)
    assert (kind, (less + 1) % 4, streams) == (1, 0, 6)
    sizes = struct.unpack_from("<6H", logical, packet + 6)
    start, found = packet + 18, []
    for k, n in enumerate(sizes):
        found.append(np.frombuffer(logical[start : start + n], "<f4" if k < 3 else "u1"))
        start += n
    assert int(entry.get("recordCount")) == len(found[0])
    assert np.allclose(np.stack(found[:3], axis=1), points(cloud) / 1000)
    assert found[5][-1] == 255


@pytest.mark.parametrize("ending", sorted(EXPORTERS))
def test_a_cloud_without_points_gives_a_whole_file(ending: str) -> None:
    empty = PointCloud(np.full((3, 4, 3), np.nan, np.float32), None, np.full((3, 4), np.nan, np.float32))
    assert len(written(ending, empty, np.zeros((3, 4), np.float32))) >= (0 if ending == ".xyz" else 1)


@pytest.mark.parametrize("ending", sorted(EXPORTERS))
def test_without_an_image_there_are_no_colours(ending: str, cloud: PointCloud) -> None:
    assert binascii.crc32(written(ending, cloud, None))
