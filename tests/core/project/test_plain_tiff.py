"""Plain TIFF as captures are stored: what others read of it, and what is no longer whole."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from core.errors import InputError
from core.project import read_image, write_image


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
