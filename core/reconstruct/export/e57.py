"""E57 of the ASTM (E2807-11): one scan with colours, in metres as the standard has it.

The file is a row of pages of 1020 bytes, each with its CRC-32C behind it. After the header come the points as one
compressed vector (data packets of one byte stream a field), its index, and the XML that describes all.
"""

from __future__ import annotations

import hashlib
import struct
import uuid
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from core.model import PointCloud
from core.reconstruct.export.exporter import Exporter, Image, points_and_grey

PAGE, PAYLOAD = 1024, 1020
HEADER, SECTION = 48, 32
RECORDS = 3000  # in a packet: 15 bytes each, and a packet has 64 KiB at most
POLYNOMIAL = 0x82F63B78  # CRC-32C (Castagnoli), reflected


def _write(file: BinaryIO, cloud: PointCloud, image: Image | None) -> int:
    points, grey = points_and_grey(cloud, image)
    metres = (points.astype(np.float64) / 1000).astype("<f4")
    packets = b"".join(
        _packet(metres[i : i + RECORDS], None if grey is None else grey[i : i + RECORDS])
        for i in range(0, len(metres), RECORDS)
    )
    data_at = HEADER + SECTION
    index_at = data_at + len(packets)
    # one entry: where the first packet of the records is
    index = struct.pack("<BBHHB9s", 0, 0, 16 + 16 - 1, 1, 0, b"") + struct.pack("<QQ", 0, _physical(data_at))
    length = SECTION + len(packets) + len(index)
    section = struct.pack("<B7sQQQ", 1, b"", length, _physical(data_at), _physical(index_at))
    xml = _xml(metres, grey).encode()
    xml_at = HEADER + length
    whole = xml_at + len(xml)
    pages = -(-whole // PAYLOAD)
    head = struct.pack("<8sIIQQQQ", b"ASTM-E57", 1, 0, pages * PAGE, _physical(xml_at), len(xml), PAGE)
    content = np.zeros(pages * PAYLOAD, np.uint8)
    content[:whole] = np.frombuffer(head + section + packets + index + xml, np.uint8)
    rows = content.reshape(pages, PAYLOAD)
    file.write(np.hstack([rows, crc32c(rows).astype(">u4").view(np.uint8).reshape(pages, 4)]).tobytes())
    return len(points)


def _physical(logical: int) -> int:
    """Where a byte stands in the file, page ends counted."""
    return logical // PAYLOAD * PAGE + logical % PAYLOAD


def _packet(metres: NDArray[np.float32], grey: NDArray[np.uint8] | None) -> bytes:
    streams = [metres[:, i].tobytes() for i in range(3)]
    if grey is not None:
        streams += [grey.tobytes()] * 3
    body = struct.pack(f"<{len(streams)}H", *(len(s) for s in streams)) + b"".join(streams)
    body += b"\0" * (-(len(body) + 6) % 4)
    return struct.pack("<BBHH", 1, 0, len(body) + 6 - 1, len(streams)) + body


def crc32c(rows: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Checksums of byte rows, (n, k), all at once: (n,)."""
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, table >> 1 ^ POLYNOMIAL, table >> 1).astype(np.uint32)
    crc = np.full(len(rows), 0xFFFFFFFF, np.uint32)
    for column in np.ascontiguousarray(rows.T):
        crc = table[(crc ^ column) & 0xFF] ^ crc >> 8
    return crc ^ np.uint32(0xFFFFFFFF)


def _xml(metres: NDArray[np.float32], grey: NDArray[np.uint8] | None) -> str:
    guid = uuid.uuid5(uuid.NAMESPACE_OID, hashlib.sha256(metres.tobytes()).hexdigest())  # equal points, equal files
    least = metres.min(axis=0) if len(metres) else np.zeros(3)
    most = metres.max(axis=0) if len(metres) else np.zeros(3)
    fields = "".join(f'<cartesian{n} type="Float" precision="single"/>' for n in "XYZ")
    limits = ""
    if grey is not None:
        names = ("Red", "Green", "Blue")
        fields += "".join(f'<color{n} type="Integer" minimum="0" maximum="255"/>' for n in names)
        ends = "".join(
            f'<color{n}Minimum type="Integer">0</color{n}Minimum><color{n}Maximum type="Integer">255</color{n}Maximum>'
            for n in names
        )
        limits = f'<colorLimits type="Structure">{ends}</colorLimits>'
    bounds = "".join(
        f'<{n.lower()}Minimum type="Float">{float(a)!r}</{n.lower()}Minimum>'
        f'<{n.lower()}Maximum type="Float">{float(b)!r}</{n.lower()}Maximum>'
        for n, a, b in zip("XYZ", least, most, strict=True)
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0">\n'
        '<formatName type="String"><![CDATA[ASTM E57 3D Imaging Data File]]></formatName>\n'
        f'<guid type="String"><![CDATA[{{{guid}}}]]></guid>\n'
        '<versionMajor type="Integer">1</versionMajor>\n<versionMinor type="Integer">0</versionMinor>\n'
        '<e57LibraryVersion type="String"><![CDATA[stripe-core]]></e57LibraryVersion>\n'
        '<coordinateMetadata type="String"/>\n'
        '<data3D type="Vector" allowHeterogeneousChildren="1">\n<vectorChild type="Structure">\n'
        f'<guid type="String"><![CDATA[{{{uuid.uuid5(guid, "scan")}}}]]></guid>\n'
        '<name type="String"><![CDATA[points]]></name>\n'
        f'<cartesianBounds type="Structure">{bounds}</cartesianBounds>\n{limits}\n'
        f'<points type="CompressedVector" fileOffset="{HEADER}" recordCount="{len(metres)}">\n'
        f'<prototype type="Structure">{fields}</prototype>\n'
        '<codecs type="Vector" allowHeterogeneousChildren="1"/>\n</points>\n</vectorChild>\n</data3D>\n'
        '<images2D type="Vector" allowHeterogeneousChildren="1"/>\n</e57Root>\n'
    )


EXPORTER = Exporter(".e57", "points", _write)
