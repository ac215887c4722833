"""Frames on disk: single-channel PNG and TIFF of 8 or 16 bit.

What this program records is plain TIFF: a header, one strip of pixels as they are. It goes to and from the disk at the
disk's speed, where a PNG of 28 frames 748x576 takes 0.15 s of a processor to read and 0.4 s to write.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core import parallel
from core.atomic import atomic_write
from core.errors import InputError
from core.fields import regular
from core.model import Capture, DeviceSpec

Image = NDArray[Any]  # (H, W), uint8 or uint16

_PNG = b"\x89PNG\r\n\x1a\n"
# half the time of OpenCV's own filter, which tries several on every row, and no more bytes on stripe images
_PNG_OPTIONS = [
    *(cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP),
    *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
]
_AGAIN = "record or copy this frame again"

_JPEG, _EXIF = b"\xff\xd8", b"eXIf"
_TIFF = {b"II*\0": "<", b"MM\0*": ">"}
_WIDTH, _HEIGHT, _BITS, _COMPRESSION, _LIGHT, _TURNED = _READ = 256, 257, 258, 259, 262, 274  # tags of TIFF
_FURTHER = 0  # no tag: the size in px of a second picture in the file
_UNREADABLE = {34925: "LZMA", 50000: "Zstandard", 50001: "WebP", 50002: "JPEG XL", 34712: "JPEG 2000"}
_PIXELS_AT = 256  # in a plain TIFF
_MOST_PIXELS = 1 << 28  # of a frame whose camera is not known
_MOST_BESIDE = 16 << 20  # bytes that a file may have beside its pixels
_AHEAD = 2  # frames that each processor has read before they are asked for: memory stays flat
_silence = Lock()
_silenced: list[int] = []  # the level of each reading under way; the first one's is the caller's


@contextmanager
def _quiet_opencv() -> Iterator[None]:
    """Keep OpenCV from talking of a file that cannot be read, which our error tells; then as it was before."""
    logging = cv2.utils.logging
    with _silence:
        _silenced.append(logging.getLogLevel() if not _silenced else _silenced[0])
        logging.setLogLevel(logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        with _silence:
            level = _silenced.pop()
            if not _silenced:
                logging.setLogLevel(level)


def read_image(path: Path, shape: tuple[int, int] | None = None) -> Image:
    """Read one frame, shape (H, W), uint8 or uint16; a colour file is converted to grey.

    What its header claims is held against `shape`, the camera's, before a pixel is decoded: a small file may claim any
    number of them.

    Raises
    ------
    InputError
        If the file is missing, truncated, not an image of 8 or 16 bit, or of another shape than `shape`.
    """
    try:
        path = regular(path)
        if shape is not None and path.stat().st_size > 16 * shape[0] * shape[1] + _MOST_BESIDE:
            seen = f"{path.stat().st_size / 1e6:.0f} MB for {shape[1]}x{shape[0]} px"
            raise InputError(path, seen, _AGAIN)
        with path.open("rb", buffering=0) as file:
            data = bytearray(os.fstat(file.fileno()).st_size)  # the pixels of a plain TIFF stay where they are read
            del data[file.readinto(data) or 0 :]
    except OSError as error:
        raise InputError(
            path, f"the frame cannot be read ({error.strerror})", "put it back or record it again"
        ) from error
    if not data:
        raise InputError(path, "the file is empty", _AGAIN)
    if data.startswith(_PNG):
        data = _check_png(path, data)
    said = _check_claimed(path, data, shape)
    if (plain := _plain_pixels(data)) is not None:
        return plain
    try:
        with _quiet_opencv():
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # a header that claims more pixels than OpenCV takes
        image = None
    if image is None and (name := _UNREADABLE.get(said.get(_COMPRESSION, 1))):
        raise InputError(path, f"is a TIFF with {name} compression", "store it uncompressed, or by LZW or deflate")
    if image is None:
        raise InputError(path, f"{len(data)} bytes that are not a whole PNG or TIFF image", _AGAIN)
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(path, f"pixels of type {image.dtype}", "store frames with 8 or 16 bit")
    if image.ndim == 3 and image.shape[2] >= 3:  # alpha says nothing about light
        colours, full = np.ascontiguousarray(image[..., :3]), 255 if image.dtype == np.uint8 else 65535
        image = cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY)
        image[(colours == full).any(axis=2)] = full  # saturated, though the others of its colours may not be
    elif image.ndim == 3:
        image = image[..., 0]
    return np.ascontiguousarray(image)


def iterate_images(capture: Capture, camera: DeviceSpec | None = None) -> Iterator[Image]:
    """Read the frames of a capture one by one in the order of its list, ahead on all processors.

    InputError if one cannot be read, or their sizes or types differ from each other or from the camera's.
    """
    expected = None if camera is None else (camera.height, camera.width)
    of, first = "the camera in project.json has", None
    for frame, image in zip(
        capture.frames, _read_ahead([frame.path for frame in capture.frames], expected), strict=True
    ):
        if expected is not None and image.shape != expected:
            raise wrong_size(frame.path, image.shape, expected, of)
        if first is None:
            first = image.dtype
        elif image.dtype != first:
            raise InputError(
                frame.path, f"the frame is {image.dtype}, the others {first}", "use one bit depth for all frames"
            )
        if expected is None:
            expected, of = image.shape, f"{capture.frames[0].path.name} has"
        yield image


def _read_ahead(paths: Sequence[Path], shape: tuple[int, int] | None) -> Iterator[Image]:
    """Read images in their order, a few of them ahead on threads: OpenCV decodes without the interpreter's lock."""
    if parallel.THREADS == 1 or len(paths) < 2:
        yield from (read_image(path, shape) for path in paths)
        return
    with ThreadPoolExecutor(parallel.THREADS, "frames") as pool:
        waiting = deque(pool.submit(read_image, path, shape) for path in paths[: _AHEAD * parallel.THREADS])
        try:
            for path in (*paths[len(waiting) :], *[None] * len(waiting)):
                image = waiting.popleft().result()
                if path is not None:
                    waiting.append(pool.submit(read_image, path, shape))
                yield image
        finally:
            for left in waiting:
                left.cancel()


def write_image(path: Path, image: Image, durable: bool = True) -> None:
    """Write one frame, atomically: by the name's ending as plain TIFF or as PNG (fast compression)."""
    suffix = path.suffix.lower()
    if suffix in (".tif", ".tiff") and image.ndim == 2 and image.dtype in (np.uint8, np.uint16):
        with atomic_write(path, durable) as file:
            file.write(_plain_head(image))
            file.write(np.ascontiguousarray(image, image.dtype.newbyteorder("<")).data)
        return
    options = _PNG_OPTIONS if suffix == ".png" else []
    done, data = cv2.imencode(suffix, image, options)
    if not done:
        raise InputError(path, f"an image of type {image.dtype} cannot be stored", "use 8 or 16 bit grey values")
    with atomic_write(path, durable) as file:
        file.write(data.tobytes())


def check_frame(path: Path, shape: tuple[int, int] | None = None) -> None:
    """See that a frame is whole and, by its header, of a shape (H, W), without decoding a PNG's pixels."""
    try:
        with regular(path).open("rb") as file:
            png = file.read(len(_PNG)) == _PNG
    except OSError as error:
        raise InputError(path, f"the frame cannot be read ({error.strerror})", _AGAIN) from error
    if not png:
        read_image(path, shape)
        return
    data = bytearray(path.read_bytes())
    _check_png(path, data)
    _check_claimed(path, data, shape)


def wrong_size(path: Path, has: tuple[int, ...], expected: tuple[int, ...], of: str) -> InputError:
    """Make the error for a frame that is not of the camera's size."""
    seen = f"the frame has {has[1]}x{has[0]} px, {of} {expected[1]}x{expected[0]}"
    return InputError(path, seen, "use frames of one size, the camera's")


def _plain_head(image: Image) -> bytes:
    """Give what stands before the pixels of a plain TIFF (TIFF 6.0, section 8): one strip, black is zero."""
    height, width = image.shape
    tags = (
        (256, 4, width),
        (257, 4, height),
        (258, 3, 8 * image.itemsize),
        (259, 3, 1),  # not compressed
        (262, 3, 1),
        (273, 4, _PIXELS_AT),
        (277, 3, 1),
        (278, 4, height),
        (279, 4, image.nbytes),
    )
    listed = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    head = b"II*\0" + struct.pack("<IH", 8, len(tags)) + listed + bytes(4)
    return head.ljust(_PIXELS_AT, b"\0")


def _plain_pixels(data: bytearray) -> Image | None:
    """Take the pixels out of a TIFF just as `_plain_head` begins one; None for all other files."""
    try:
        width, height, bits = (struct.unpack_from("<I", data, 18 + 12 * i)[0] for i in range(3))
        if bits not in (8, 16) or len(data) != _PIXELS_AT + width * height * bits // 8:
            return None
        image = np.frombuffer(data, f"<u{bits // 8}", width * height, _PIXELS_AT).reshape(height, width)
    except struct.error:
        return None
    whole = data.startswith(_plain_head(image))
    return image.astype(image.dtype.newbyteorder("="), copy=False) if whole else None


def _claimed(data: bytes | bytearray) -> dict[int, int]:
    """Read what the header of a PNG, TIFF or JPEG file claims, by TIFF's tags: width, height, bits, compression."""
    try:
        if data.startswith(_PNG):
            claimed = zip((_WIDTH, _HEIGHT, _BITS), struct.unpack_from(">IIB", data, 16), strict=True)
            return _exif(data, _EXIF) | dict(claimed)
        if data.startswith(_JPEG):
            return _exif(data, b"Exif\0\0")
        order = _TIFF.get(bytes(data[:4]))
        if order is None:
            return {}
        (at,) = struct.unpack_from(f"{order}I", data, 4)
        (count,) = struct.unpack_from(f"{order}H", data, at)
        said = {_BITS: 1} | _tags(data, order, at)
        (further,) = struct.unpack_from(f"{order}I", data, at + 2 + 12 * count)
        if further:
            other = _tags(data, order, further)
            said[_FURTHER] = other.get(_WIDTH, 0) * other.get(_HEIGHT, 0)
    except struct.error:
        return {}
    return said


def _exif(data: bytes | bytearray, mark: bytes) -> dict[int, int]:
    """Read how a camera was held, by what follows the mark of its notes: the head of a TIFF file."""
    at = data.find(mark) + len(mark)  # without a mark, what stands there is no such head
    said = _claimed(data[at:]) if bytes(data[at : at + 4]) in _TIFF else {}
    return {_TURNED: said[_TURNED]} if _TURNED in said else {}


def _tags(data: bytes | bytearray, order: str, at: int) -> dict[int, int]:
    """Read what one picture of a TIFF claims."""
    said = {}
    (count,) = struct.unpack_from(f"{order}H", data, at)
    for i in range(count):
        tag, kind, values = struct.unpack_from(f"{order}HHI", data, at + 2 + 12 * i)
        if tag in _READ:  # as 16 or 32 bit; the bits of colours are elsewhere
            form = "H" if kind == 3 and values < 3 else "I"
            (said[tag],) = struct.unpack_from(order + form, data, at + 10 + 12 * i)
    return said


def _check_claimed(path: Path, data: bytes | bytearray, shape: tuple[int, int] | None) -> dict[int, int]:
    """Give what a header claims; an `InputError` where that is not a frame of that shape (H, W), or of any."""
    said = _claimed(data)
    claimed = said.get(_HEIGHT, 0), said.get(_WIDTH, 0)
    if 1 < said.get(_TURNED, 1) < 9:  # the camera was tilted, or rows are stored from below: no telling; 0 is unknown
        seen = f"is an image to be turned or mirrored before it is shown (orientation {said[_TURNED]})"
        raise InputError(path, seen, "store frames as the camera reads them, with orientation 1")
    if said.get(_FURTHER, 0) >= max(claimed[0] * claimed[1], 1):  # a smaller one is a preview
        raise InputError(path, "is a TIFF of several images", "store every frame in a file of its own")
    if all(claimed) and shape is not None and claimed != shape:
        raise wrong_size(path, claimed, shape, "the camera in project.json has")
    if claimed[0] * claimed[1] > _MOST_PIXELS:
        raise InputError(path, f"its header claims {claimed[1]}x{claimed[0]} px", _AGAIN)
    if said.get(_LIGHT, 1) == 0 and said[_BITS] > 8:  # OpenCV turns those of 8 bit alone
        raise InputError(
            path, f"is a TIFF of {said[_BITS]} bit in which 0 is white", "store frames in which 0 is black"
        )
    if said.get(_BITS, 8) < 8:
        raise InputError(path, f"has {said[_BITS]} bit a pixel", "store frames with 8 or 16 bit")
    return said


def _check_png(path: Path, data: bytearray) -> bytearray:
    """Walk the chunks to the end mark, checksums included; give the file without those that say nothing of its pixels.

    Some versions of OpenCV return the upper part of a truncated PNG without a word; others write to stderr themselves,
    and about the profiles and texts of whole ones.
    """
    at, view, said, others = len(_PNG), memoryview(data), [memoryview(_PNG)], 0
    while at + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        stop = at + 12 + length
        if stop > len(data):
            break
        if zlib.crc32(view[at + 4 : stop - 4]) != struct.unpack_from(">I", data, stop - 4)[0]:
            raise InputError(path, f"the PNG is damaged at byte {at} (wrong checksum)", _AGAIN)
        if kind[:1].isupper() or kind == _EXIF:  # critical, by the format, or how the camera was held
            said.append(view[at:stop])
        else:
            others += 1
        if kind == b"IEND":
            return bytearray().join(said) if others else data
        at = stop
    raise InputError(path, f"the PNG ends after {len(data)} bytes without its end mark (truncated)", _AGAIN)
