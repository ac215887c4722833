"""Files of frames: what others read of the plain TIFF that is stored, and what theirs must not be."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from core.errors import InputError
from core.project import read_image, write_image
from core.project.images import check_frame


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_another_reader_sees_the_same_pixels_and_ours_reads_anothers(kind: type, tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, np.iinfo(kind).max, (37, 53)).astype(kind)
    write_image(tmp_path / "ours.tif", image)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "ours.tif"), cv2.IMREAD_UNCHANGED), image)
    found = read_image(tmp_path / "ours.tif", image.shape)
    np.testing.assert_array_equal(found, image)
    assert found.dtype == kind
    assert found.flags.writeable
    cv2.imwrite(str(tmp_path / "theirs.tif"), image)  # compressed
    np.testing.assert_array_equal(read_image(tmp_path / "theirs.tif", image.shape), image)


@pytest.mark.parametrize("left", [0, 9, 200, 256, 300, -1])
def test_a_cut_file_is_refused(left: int, tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    write_image(path, np.full((20, 30), 7, np.uint8))
    path.write_bytes(path.read_bytes()[:left])
    with pytest.raises(InputError, match=r"a\.tif"):
        read_image(path)


def test_a_header_that_claims_another_size_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    write_image(path, np.full((20, 30), 7, np.uint8))
    with pytest.raises(InputError, match="30x20 px"):
        read_image(path, (30, 20))


GREY = np.random.default_rng(0).integers(0, 200, (20, 30)).astype(np.uint8)


@pytest.mark.parametrize("turn", [2, 3, 4, 6])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_tiff_that_asks_to_be_turned_is_refused(turn: int, kind: type, tmp_path: Path) -> None:
    Image.fromarray(GREY.astype(kind)).save(tmp_path / "a.tif", tiffinfo={274: turn})
    with pytest.raises(InputError, match=f"orientation {turn}"):
        read_image(tmp_path / "a.tif", GREY.shape)


@pytest.mark.parametrize("name", ["a.png", "a.jpg"])
def test_other_images_that_ask_to_be_turned_are_refused(name: str, tmp_path: Path) -> None:
    said = Image.Exif()
    for unturned in (0, 1):  # some cameras write 0 where they do not know
        said[274] = unturned
        Image.fromarray(GREY).save(tmp_path / name, exif=said)
        check_frame(tmp_path / name, GREY.shape)
    said[274] = 6
    Image.fromarray(GREY).save(tmp_path / name, exif=said)
    for read in (read_image, check_frame):
        with pytest.raises(InputError, match="orientation 6"):
            read(tmp_path / name, GREY.shape)


def test_notes_within_notes_are_no_notes(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8" + 5000 * b"Exif\0\0\xff\xd8")
    with pytest.raises(InputError):
        read_image(tmp_path / "a.jpg", GREY.shape)


def test_a_tiff_of_several_frames_is_refused_and_a_preview_is_none(tmp_path: Path) -> None:
    pages = [Image.fromarray(GREY), Image.fromarray(255 - GREY), Image.fromarray(GREY[::2, ::2])]
    pages[0].save(tmp_path / "two.tif", save_all=True, append_images=pages[1:2])
    with pytest.raises(InputError, match="several images"):
        read_image(tmp_path / "two.tif")
    pages[0].save(tmp_path / "one.tif", save_all=True, append_images=pages[2:])
    np.testing.assert_array_equal(read_image(tmp_path / "one.tif"), GREY)


def test_a_tiff_in_which_0_is_white_is_read_as_light_or_refused(tmp_path: Path) -> None:
    for kind in (np.uint8, np.uint16):
        Image.fromarray(GREY.astype(kind)).save(tmp_path / "a.tif")
        data = (tmp_path / "a.tif").read_bytes()
        black, white = (struct.pack("<HHIHH", 262, 3, 1, which, 0) for which in (1, 0))
        assert black in data
        (tmp_path / "a.tif").write_bytes(data.replace(black, white))
        if kind is np.uint8:
            np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), 255 - GREY)
    with pytest.raises(InputError, match="16 bit in which 0 is white"):
        read_image(tmp_path / "a.tif")


def test_what_a_png_says_beside_its_pixels_does_not_count(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    said = PngInfo()
    said.add(b"gAMA", (22_000).to_bytes(4, "big"))
    said.add_text("Comment", "x" * 5000)
    Image.fromarray(GREY).save(tmp_path / "a.png", pnginfo=said, icc_profile=bytes(128), transparency=7)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png", GREY.shape), GREY)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_pixel_of_which_one_colour_is_saturated_is(kind: type, tmp_path: Path) -> None:
    full = np.iinfo(kind).max
    colours = np.full((4, 4, 3), full // 4, kind)
    colours[1, 2, 1] = full
    cv2.imwrite(str(tmp_path / "a.png"), colours)
    image = read_image(tmp_path / "a.png")
    assert np.argwhere(image == full).tolist() == [[1, 2]]
