"""Boards of every kind as the program prints them, photographed through OpenCV's camera, told without picks."""

from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError, NotRecognisedError
from core.measure import TARGET_KINDS, recognise
from core.measure.identity.turns import relabelled
from core.measure.kinds import tags
from core.model import Testfield
from core.pipeline import print_testfield
from tests.printed import SPEC, Printed, field_of, phase_of, photograph, printed


@cache
def board_of(kind: str) -> Printed:
    return printed(field_of(kind))


@pytest.mark.parametrize("tilt_deg", [20, 60])
@pytest.mark.parametrize("kind", ["rings", "charuco", "aprilgrid", "tags"])
def test_a_coded_board_is_told_from_any_part_of_it(kind: str, tilt_deg: float) -> None:
    rng = np.random.default_rng(tilt_deg)
    field, image_and_truth = field_of(kind), photograph(board_of(kind), rng, tilt_deg, hidden=True)
    found, ways = recognise(phase_of(image_and_truth[0]), field, SPEC)
    assert len(ways) == 1
    assert len(found.row) > (0.6 if tilt_deg == 20 else 0.45) * len(field.row)
    assert len(found.row) + len(found.missing) == len(field.row)
    index = field.index()
    truth = image_and_truth[1][[index[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]]
    # targets are 10 px and more apart: not one is another one; fillPoly widens what it draws, 0.04 px here
    assert np.abs(found.camera_uv - truth).max() < 0.5
    assert np.sqrt(np.mean((found.camera_uv - truth) ** 2)) < 0.15


@pytest.mark.parametrize("kind", ["rings", "charuco", "aprilgrid", "tags"])
def test_a_mirrored_image_is_named(kind: str) -> None:
    image, _ = photograph(board_of(kind), np.random.default_rng(1), 20, hidden=False)
    with pytest.raises(NotRecognisedError, match="recognised in the image's mirror image only; mirror the frames back"):
        recognise(phase_of(np.ascontiguousarray(image[:, ::-1])), field_of(kind), SPEC)


@pytest.mark.parametrize("kind", ["dots", "rings"])
def test_a_board_of_the_other_polarity_is_named(kind: str) -> None:
    image, _ = photograph(board_of(kind), np.random.default_rng(1), 20, hidden=False)
    with pytest.raises(NotRecognisedError, match=r"looks like one of polarity black-on-white, .* says white-on-black"):
        recognise(phase_of(image), replace(field_of(kind), polarity="white-on-black"), SPEC)


@pytest.mark.parametrize("kind", ["dots", "chessboard"])
def test_a_board_without_codes_is_told_but_for_its_turn_with_a_quarter_hidden(kind: str) -> None:
    rng = np.random.default_rng(11)
    for tilt_deg in (10, 58):  # tilted so far, the next dot of a row is not the nearest one
        board = board_of(kind)
        image, truth = photograph(board, rng, tilt_deg, hidden=True, light=3.0)
        found, ways = recognise(phase_of(image), board.field, SPEC)
        assert len(found.row) > 0.4 * len(board.field.row)
        index, off = board.field.index(), []
        for way in ways:
            named = relabelled(found, way, board.field)
            at = [index[key] for key in zip(named.row.tolist(), named.col.tolist(), strict=True)]
            off.append(np.abs(named.camera_uv - truth[at]).max())
        assert min(off) < 0.5


def test_ink_of_blurred_rings_that_draws_their_dots_is_in_the_sigmas() -> None:
    """Blur of a quarter of the dots' radius: their centres err by 0.03 px where noise alone would leave 0.007."""
    board = board_of("rings")
    image, truth = photograph(board, np.random.default_rng(4), 10, hidden=False, blur=(1.5, 1.5), light=1.2)
    found, _ = recognise(phase_of(image), board.field, SPEC)
    index = board.field.index()
    off = found.camera_uv - truth[[index[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]]
    off = off - off.mean(axis=0)  # of the drawing
    assert len(off) > 60
    assert 0.5 < np.sqrt(np.mean(off**2 / np.diagonal(found.camera_cov, axis1=1, axis2=2))) < 1.3


def test_tags_of_a_grid_are_those_of_kalibr() -> None:
    """The first code of the family 36h11, 0xd5d628584, in the lower left tag; Kalibr's frame is two cells wide."""
    patches = TARGET_KINDS["aprilgrid"].drawn(field_of("aprilgrid"))
    bits = np.zeros((10, 10), int)
    for patch in patches:
        low, high = (np.rint(patch.outline_mm.min(axis=0) / 2.4), np.rint(patch.outline_mm.max(axis=0) / 2.4))
        if not patch.ink and np.all(low > 0) and np.all(high < 10):
            bits[int(low[1]) : int(high[1]), int(low[0]) : int(high[0])] = 1
    code = [[0xD5D628584 >> (6 * i + j) & 1 for j in range(6)] for i in range(6)]
    upright = np.rot90(code, 2)[::-1]  # Kalibr turns the tag by half a turn and draws its rows downwards
    np.testing.assert_array_equal(bits[2:-2, 2:-2], upright)
    assert bits.sum() == sum(map(sum, code))


def test_dots_too_close_for_rings_are_refused_with_the_room_they_need() -> None:
    field = field_of("rings")
    close = Testfield(field.row, field.col, field.xyz_mm / 2, field.diameter_mm, field.polarity, "rings")
    with pytest.raises(InputError, match=r"10 mm apart have no room for rings.*leave 13\.2 mm"):
        print_testfield(close, Path("unused.svg"))


@pytest.mark.parametrize("kind", ["aprilgrid", "tags"])
def test_more_tags_than_there_are_of_a_kind_are_refused_by_their_number(kind: str) -> None:
    row, col = (a.ravel() for a in np.mgrid[0:48, 0:50])
    xyz = np.column_stack([col // 2 * 13.0 + col % 2 * 10, row // 2 * 13.0 + row % 2 * 10, 0.0 * row])
    field = Testfield(row, col, xyz, np.full(len(row), 3.0), "black-on-white", kind)
    with pytest.raises(InputError, match="600 tags; there are 587 of this kind"):
        print_testfield(field, Path("unused.svg"))


@pytest.mark.parametrize("seed", [0, 3, 11])
def test_few_blurred_tags_joined_by_their_corners_are_told(seed: int) -> None:
    """Sixteen tags, a quarter of them hidden: fewer than four were parted from each other in six of 40 such images."""
    whole = field_of("aprilgrid")
    use = (whole.row < 8) & (whole.col < 8)
    field = Testfield(
        whole.row[use], whole.col[use], whole.xyz_mm[use], whole.diameter_mm[use], whole.polarity, whole.kind
    )
    image, truth = photograph(printed(field), np.random.default_rng(seed), 30.0, True, blur=(1.2, 1.4), light=3.0)
    found, _ = recognise(phase_of(image), field, SPEC)
    at = [field.index()[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]
    assert np.abs(found.camera_uv - truth[at]).max() < 2.0


def test_sharp_tags_whose_frame_is_one_narrow_cell_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """4 px a cell: where OpenCV parts the grey values hardly a tag is whole until the image is softened."""
    one_cell = replace(tags.APRILGRID_LAYOUT, families=(("APRILTAG_36h11", 1),))
    monkeypatch.setitem(
        TARGET_KINDS, "aprilgrid", replace(TARGET_KINDS["aprilgrid"], drawn=partial(tags._drawn_rows, one_cell))
    )
    large = field_of("aprilgrid")
    field = replace(large, xyz_mm=0.7 * large.xyz_mm, diameter_mm=0.7 * large.diameter_mm)
    image, truth = photograph(printed(field), np.random.default_rng(0), 15, hidden=False, blur=(0.4, 0.5))
    found, _ = recognise(phase_of(image), field, SPEC)
    assert len(found.row) == len(field.row)
    at = [field.index()[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]
    assert np.abs(found.camera_uv - truth[at]).max() < 0.5


@pytest.mark.parametrize("kind", ["dots", "chessboard", "rings"])
def test_neither_of_two_equal_boards_is_taken_silently(kind: str) -> None:
    rng = np.random.default_rng(5)
    whole, _ = photograph(board_of(kind), rng, 15, hidden=False)
    part, _ = photograph(board_of(kind), rng, 35, hidden=True)
    both, camera = np.hstack([whole, part]), replace(SPEC, width=2 * SPEC.width)
    with pytest.raises(NotRecognisedError, match=r"two such boards are seen, .* cover one of them, or pick 4 targets"):
        recognise(phase_of(both), field_of(kind), camera)


@pytest.mark.parametrize("kind", ["dots", "chessboard"])
def test_a_board_whose_coordinates_are_tilted_is_no_second_one(kind: str) -> None:
    """Where it reaches in the image was drawn without the tilt: two thirds of it were told as a second board."""
    image, _ = photograph(board_of(kind), np.random.default_rng(5), 15, hidden=False)
    field, turn = field_of(kind), np.array([[1, 0, 0], [0, 0.28, 0.96], [0, -0.96, 0.28]])
    found, _ = recognise(phase_of(image), replace(field, xyz_mm=field.xyz_mm @ turn), SPEC)
    assert len(found.row) > 0.95 * len(field.row)


def closer_tags(kind: str) -> Testfield:
    """Tags as large as those of `field_of`, with gaps of 4.8 instead of 7.2 mm."""
    field = field_of(kind)
    x, y = field.xyz_mm[:, 0], field.xyz_mm[:, 1]
    xyz = np.column_stack([x - x // 31.2 * 2.4, y - np.trunc(y / 31.2) * 2.4, 0 * x])
    return replace(field, xyz_mm=xyz, diameter_mm=np.full(len(x), 4.8))


@pytest.mark.parametrize("kind", ["aprilgrid", "tags"])
def test_tags_of_another_size_than_the_file_says_are_named(kind: str) -> None:
    """With the gap two thirds of what it is, 26 to 60 of 168 corners were measured, five of them 10 px off."""
    image, _ = photograph(board_of(kind), np.random.default_rng(12), 20, hidden=True)
    with pytest.raises(NotRecognisedError, match=r"tags are 0\.9\d times as large as the testfield file says"):
        recognise(phase_of(image), closer_tags(kind), SPEC)


@pytest.mark.parametrize("scale", [0.55, 0.7])
def test_small_tags_joined_by_their_corners_have_their_size(scale: float) -> None:
    """Of 27 px; their outlines as detected lack the corners, and were called 0.87 times as large as the file says."""
    large = field_of("aprilgrid")
    field = replace(large, xyz_mm=scale * large.xyz_mm, diameter_mm=scale * large.diameter_mm)
    image, truth = photograph(printed(field), np.random.default_rng(3), 15, hidden=False, blur=(0.4, 0.5))
    found, _ = recognise(phase_of(image), field, SPEC)
    at = [field.index()[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]
    assert len(found.row) > 0.9 * len(field.row)
    assert np.abs(found.camera_uv - truth[at]).max() < 0.5


def test_tags_of_another_size_beside_the_board_are_no_reason_to_refuse_it() -> None:
    rng = np.random.default_rng(5)
    whole, truth = photograph(board_of("tags"), rng, 15, hidden=False)
    other, _ = photograph(printed(closer_tags("tags")), rng, 35, hidden=True)
    camera, field = replace(SPEC, width=2 * SPEC.width), field_of("tags")
    found, _ = recognise(phase_of(np.hstack([whole, other])), field, camera)
    at = [field.index()[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]
    assert len(found.row) == len(field.row)
    assert np.abs(found.camera_uv - truth[at]).max() < 0.5
