"""Boards of every kind as the program prints them, photographed through OpenCV's camera, told without picks."""

import re
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.errors import InputError
from core.measure import TARGET_KINDS, recognise
from core.model import DeviceSpec, PhaseMap, Testfield
from core.pipeline import print_testfield

SPEC = DeviceSpec(640, 480, (0.01, 0.01), 9.0)
K = np.array([[900.0, 0, 318.2], [0, 900.0, 241.9], [0, 0, 1.0]])
LENS = np.array([-0.1, 0.04, 1e-4, -2e-4, 0.0])
PER_MM, FINE = 8, 3  # texels a mm; samples a pixel along one axis


def field_of(kind: str) -> Testfield:
    if kind in ("aprilgrid", "tags"):  # Kalibr's rows go up, OpenCV's down
        row, col = (x.ravel() for x in np.mgrid[0:10, 0:12])
        x, y = (k // 2 * 31.2 + k % 2 * 24.0 for k in (col, row))
        xyz, size = np.column_stack([x, y if kind == "aprilgrid" else -y, 0.0 * x]), 7.2
    else:
        row, col = (x.ravel() for x in np.mgrid[0:7, 0:10])
        xyz, size = np.column_stack([20.0 * col, -20.0 * row, 0.0 * row]), 6.0 if kind == "rings" else 20.0
    return Testfield(row, col, xyz, np.full(len(row), size), "black-on-white", kind)


@cache
def printed(kind: str, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """The sheet's picture from its SVG, and the way from the board's mm to its texels."""
    field = field_of(kind)
    sheet = print_testfield(field, folder / f"{kind}.svg")
    root = ET.fromstring((folder / f"{kind}.svg").read_text())
    height, width = int(sheet.height_mm * PER_MM), int(sheet.width_mm * PER_MM)
    tones = {"#000000": 0, "#ffffff": 255}
    image = np.full((4 * height, 4 * width), 255, np.uint8)

    def fill(outline: np.ndarray, tone: int) -> None:
        middle = np.round((outline * 4 * PER_MM - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(image, [middle], tone, shift=4)

    targets = next(g for g in root.iter() if g.get("id") == "targets")
    for e in targets:
        tone = tones[e.get("fill") or targets.attrib["fill"]]
        if e.tag.endswith("circle"):
            x, y, r = (float(e.attrib[key]) for key in ("cx", "cy", "r"))
            angle = np.linspace(0, 2 * np.pi, 90)
            fill(np.column_stack([x + r * np.cos(angle), y + r * np.sin(angle)]), tone)
        else:
            fill(np.array([pair.split(",") for pair in re.findall(r"[-\d.]+,[-\d.]+", e.attrib["d"])], float), tone)
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    places = np.column_stack([field.xyz_mm[:, :2], np.ones(len(field.row))])
    return small, np.linalg.lstsq(places, sheet.targets_mm[:, :2] * PER_MM - 0.5, rcond=None)[0]


@cache
def sight_lines() -> np.ndarray:
    v, u = (np.mgrid[0 : SPEC.height * FINE, 0 : SPEC.width * FINE] + 0.5) / FINE - 0.5
    rays = cv2.undistortPoints(np.stack([u.ravel(), v.ravel()], 1)[:, None], K, LENS).reshape(-1, 2)
    return np.column_stack([rays, np.ones(len(rays))])


def photograph(kind: str, folder: Path, rng: np.random.Generator, tilt_deg: float, hidden: bool):
    """A grey image under a light that falls to a half, and the true places of all targets."""
    picture, to_texels = printed(kind, folder)
    field = field_of(kind)
    about, roll = rng.uniform(0, 2 * np.pi, 2)
    turn = cv2.Rodrigues(np.deg2rad(tilt_deg) * np.array([np.cos(about), np.sin(about), 0.0]))[0]
    turn = turn @ cv2.Rodrigues(np.array([0, 0, roll]))[0] @ np.diag([1.0, -1.0, -1.0])
    middle = field.xyz_mm.mean(axis=0)
    shift = np.array([*rng.uniform(-8, 8, 2), 480.0 if tilt_deg < 45 else 430.0]) - turn @ middle
    rays = sight_lines()
    reach = (turn[:, 2] @ shift) / (rays @ turn[:, 2])
    place = ((rays * reach[:, None] - shift) @ turn)[:, :2]
    at = np.column_stack([place, np.ones(len(place))]) @ to_texels
    shape = (SPEC.height * FINE, SPEC.width * FINE)
    albedo = cv2.remap(picture, *at.T.reshape(2, *shape).astype(np.float32), cv2.INTER_LINEAR, borderValue=0.4)
    if hidden:  # a hand over a quarter, corner and all
        side = rng.choice([-1, 1], 2)
        albedo[np.all(side * (place - middle[:2]) > 0, axis=1).reshape(shape)] = 0.3
    image = cv2.GaussianBlur(15 + 150 * albedo, (0, 0), rng.uniform(0.5, 0.8) * FINE)
    image = cv2.resize(image, (SPEC.width, SPEC.height), interpolation=cv2.INTER_AREA) * np.linspace(
        0.6, 1.2, SPEC.width
    )
    image = np.rint(image + rng.normal(0, 1.2, image.shape)).astype(np.float32)
    return image, cv2.projectPoints(field.xyz_mm, turn, shift, K, LENS)[0][:, 0]


def phase_of(image: np.ndarray) -> PhaseMap:
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]].astype(np.float32)
    return PhaseMap(0.7 * u, 0.7 * v, 0 * u + 0.03, 0 * u + 0.03, 0 * u + 50, image, np.zeros(image.shape, np.uint8))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("printed")


@pytest.mark.parametrize("tilt_deg", [20, 60])
@pytest.mark.parametrize("kind", ["rings", "charuco", "aprilgrid", "tags"])
def test_a_coded_board_is_told_from_any_part_of_it(kind: str, tilt_deg: float, folder: Path) -> None:
    rng = np.random.default_rng(tilt_deg)
    field, image_and_truth = field_of(kind), photograph(kind, folder, rng, tilt_deg, hidden=True)
    found, ways = recognise(phase_of(image_and_truth[0]), field, SPEC)
    assert len(ways) == 1
    assert len(found.row) > (0.6 if tilt_deg == 20 else 0.45) * len(field.row)
    assert len(found.row) + len(found.missing) == len(field.row)
    index = field.index()
    truth = image_and_truth[1][[index[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]]
    # targets are 10 px and more apart: not one is another one; fillPoly widens what it draws, 0.04 px here
    assert np.abs(found.camera_uv - truth).max() < 0.5
    assert np.sqrt(np.mean((found.camera_uv - truth) ** 2)) < 0.15


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
