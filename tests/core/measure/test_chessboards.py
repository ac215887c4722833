"""Chessboards and ChArUco boards drawn by OpenCV, seen through OpenCV's camera model: neither is ours."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from core.errors import NotRecognisedError
from core.measure import measure_targets, recognise
from core.measure.centres.corners import fit_corners
from core.measure.centres.crossings import blocks_of_crossings
from core.measure.kinds.chessboard import eight_bits
from core.model import DeviceSpec, PhaseMap, Seed, Testfield

SPEC = DeviceSpec(512, 384, (0.01, 0.01), 8.0)
K = np.array([[800.0, 0, 255.5], [0, 800.0, 191.5], [0, 0, 1.0]])
LENS = np.array([-0.12, 0.05, 1e-4, -2e-4, 0.0])
ROWS, COLS, SQUARE = 8, 11, 14.0  # inner corners; mm
FINE = 3  # samples per pixel along one axis
PX = 40  # of the drawing, per square


def field_of(kind: str) -> Testfield:
    row, col = (x.ravel() for x in np.mgrid[0:ROWS, 0:COLS])
    xyz = np.column_stack([SQUARE * col, -SQUARE * row, 0.0 * row])
    return Testfield(row, col, xyz, np.full(len(row), SQUARE), kind=kind)


def drawing(kind: str) -> np.ndarray:
    if kind == "charuco":
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
        board = cv2.aruco.CharucoBoard((COLS + 1, ROWS + 1), SQUARE, 0.7 * SQUARE, dictionary)
        return board.generateImage(((COLS + 1) * PX, (ROWS + 1) * PX), marginSize=0).astype(np.float32) / 255
    v, u = np.mgrid[0 : (ROWS + 1) * PX, 0 : (COLS + 1) * PX] // PX
    return ((u + v) % 2).astype(np.float32)


@cache
def sight_lines():
    v, u = (np.mgrid[0 : SPEC.height * FINE, 0 : SPEC.width * FINE] + 0.5) / FINE - 0.5
    rays = cv2.undistortPoints(np.stack([u.ravel(), v.ravel()], 1)[:, None], K, LENS).reshape(-1, 2)
    light = 1 + 0.0008 * (u - 256) - 0.0006 * (v - 192)
    return light.astype(np.float32), np.column_stack([rays, np.ones(len(rays))]).astype(np.float32)


def photograph(kind: str, rng: np.random.Generator, tilt_deg: float, *, hidden: bool = False, blur: float = 0.6):
    """A grey image, and the true places (rows, cols, 2) of all corners."""
    about = rng.uniform(0, 2 * np.pi)
    turn = cv2.Rodrigues(np.deg2rad(tilt_deg) * np.array([np.cos(about), np.sin(about), 0.0]))[0]
    turn = turn @ cv2.Rodrigues(np.array([0, 0, rng.uniform(-np.pi, np.pi)]))[0]
    middle = np.array([(COLS - 1) / 2, (ROWS - 1) / 2, 0.0]) * SQUARE  # OpenCV's board: x right, y down, z away
    shift = np.array([*rng.uniform(-12, 12, 2), rng.uniform(430, 520)]) - turn @ middle
    light, rays = sight_lines()
    onto = turn.astype(np.float32)
    reach = np.float32(turn[:, 2] @ shift) / (rays @ onto[:, 2])
    place = (rays @ onto[:, :2] * reach[:, None] - np.float32(shift @ turn[:, :2])).reshape(*light.shape, 2)
    at = (place / np.float32(SQUARE) + 1) * PX - np.float32(0.5)
    albedo = cv2.remap(
        drawing(kind), at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.6
    )
    if hidden:  # a hand over a quarter of the board, corner and all
        x, y = rng.choice([-1, 1], 2)
        albedo[(x * (place[..., 0] - middle[0]) > 0) & (y * (place[..., 1] - middle[1]) > 0)] = 0.3
    image = (15 + 150 * albedo * light).reshape(SPEC.height, FINE, SPEC.width, FINE).mean(axis=(1, 3))
    image = cv2.GaussianBlur(image, (0, 0), blur)
    image = np.rint(image + rng.normal(0, 1.2, image.shape)).astype(np.float32)
    row, col = np.mgrid[0:ROWS, 0:COLS]
    corners = np.stack([col, row, 0 * row], axis=-1).reshape(-1, 3) * SQUARE
    uv = cv2.projectPoints(corners, turn, shift, K, LENS)[0]
    return image, uv.reshape(ROWS, COLS, 2)


def phase_of(image: np.ndarray) -> PhaseMap:
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]].astype(np.float32)
    return PhaseMap(0.7 * u, 0.7 * v, 0 * u + 0.03, 0 * u + 0.03, 0 * u + 50, image, np.zeros(image.shape, np.uint8))


def ratios(found, truth) -> np.ndarray:
    error = found.camera_uv - truth[found.row, found.col]
    return error / np.sqrt(np.diagonal(found.camera_cov, axis1=1, axis2=2))


@pytest.mark.parametrize("tilt_deg", [0, 30, 60])
def test_a_charuco_board_tells_which_corner_is_which_from_any_part_of_it(tilt_deg):
    rng, squares, counts = np.random.default_rng(tilt_deg), [], []
    for k in range(3):
        image, truth = photograph(
            "charuco", rng, tilt_deg, hidden=k % 2 == 1, blur=0.5 + (0.1 if tilt_deg == 60 else 0.2) * k
        )
        found, ways = recognise(phase_of(image), field_of("charuco"), SPEC)
        error = found.camera_uv - truth[found.row, found.col]
        assert np.abs(error).max() < 0.5  # corners are 15 px and more apart: not one is another one
        assert len(ways) == 1
        squares.append(ratios(found, truth) ** 2)
        counts.append(len(found.row))
        assert len(found.row) + len(found.missing) == ROWS * COLS
    assert min(counts[::2]) > (0.85 if tilt_deg == 60 else 0.9) * ROWS * COLS  # squares of 11 px: tags touch some
    assert min(counts[1::2]) > (0.5 if tilt_deg == 60 else 0.6) * ROWS * COLS
    assert 0.75 < np.sqrt(np.mean(np.concatenate(squares))) < 1.25


@pytest.mark.parametrize("tilt_deg", [0, 45])
def test_a_chessboard_is_measured_without_picks(tilt_deg):
    rng, squares = np.random.default_rng(100 + tilt_deg), []
    for _ in range(2):
        image, truth = photograph("chessboard", rng, tilt_deg)
        found, ways = recognise(phase_of(image), field_of("chessboard"), SPEC)
        assert len(found.row) > 0.95 * ROWS * COLS
        assert len(ways) == 1  # 8 and 11 corners: half a turn would change dark and bright
        assert np.abs(found.camera_uv - truth[found.row, found.col]).max() < 0.5
        squares.append(ratios(found, truth) ** 2)
    assert 0.75 < np.sqrt(np.mean(np.concatenate(squares))) < 1.25


def test_a_chessboard_seen_in_part_leaves_opencvs_chance_alone():
    image, truth = photograph("chessboard", np.random.default_rng(7), 40, hidden=True)
    drawn = []
    for look in (False, True):
        cv2.setRNGSeed(5)
        if look:
            found, _ = recognise(phase_of(image), field_of("chessboard"), SPEC)
            assert np.abs(found.camera_uv - truth[found.row, found.col]).max() < 0.5
        drawn.append(cv2.randu(np.zeros(4), 0, 1))
    assert np.array_equal(*drawn)


@cache
def through_a_wide_lens():
    """A large chessboard under strong distortion, before the camera sharpens it, and its corners."""
    fine = 8
    wide, lens = np.array([[300.0, 0, 319.5], [0, 300.0, 239.5], [0, 0, 1.0]]), np.array([-0.2, 0.03, 0, 0, 0])
    r = np.linspace(1e-6, 2.5, 2000)
    bent = r * (1 + lens[0] * r**2 + lens[1] * r**4)
    turn, shift = cv2.Rodrigues(np.array([0.25, -0.3, 0.1]))[0], np.array([-66.0, -52.0, 62.0])
    across = np.linalg.inv(np.column_stack([turn[:, :2], shift]))
    u = ((np.arange(640 * fine) + 0.5) / fine - 320) / 300
    rows = []
    for line in range(480):  # one at a time stays in the cache
        v = ((line * fine + np.arange(fine) + 0.5) / fine - 240)[:, None] / 300
        seen = np.hypot(u, v)
        straight = np.interp(seen, bent, r) / seen
        x, y, far = (a * u * straight + b * v * straight + c for a, b, c in across)
        x, y = (k / far / SQUARE for k in (x, y))
        dark = (np.floor(x) + np.floor(y)) % 2 == 0
        dark &= (x > -1) & (y > -1) & (x < COLS) & (y < ROWS)
        rows.append(dark.mean(axis=0).reshape(640, fine).mean(axis=1))
    image = cv2.GaussianBlur(160.0 - 140.0 * np.array(rows), (0, 0), 0.6)
    row, col = np.mgrid[0:ROWS, 0:COLS]
    corners = np.stack([col, row, 0 * row], axis=-1).reshape(-1, 3) * SQUARE
    return image, cv2.projectPoints(corners, turn, shift, wide, lens)[0].reshape(ROWS, COLS, 2)


@pytest.mark.parametrize("sharpened", [0.0, 1.5])
def test_a_wide_lens_that_sharpens_leaves_no_corner_out(sharpened):
    image, truth = through_a_wide_lens()
    image = image + sharpened * (image - cv2.GaussianBlur(image, (0, 0), 1.5))  # goes over the edges
    image = np.rint(image + np.random.default_rng(2).normal(0, 1, image.shape)).astype(np.float32)
    picks = [Seed(r, c, *truth[r, c]) for r, c in ((0, 0), (0, COLS - 1), (ROWS - 1, COLS - 1), (ROWS - 1, 0))]
    spec = DeviceSpec(640, 480, (0.01, 0.01), 3.0)
    found = measure_targets(phase_of(image), field_of("chessboard"), picks, spec)
    inside = np.all((truth > 8) & (truth < (631, 471)), axis=2).sum()
    assert inside > 0.9 * ROWS * COLS
    assert len(found.row) > 0.97 * inside
    assert np.abs(found.camera_uv - truth[found.row, found.col]).max() < (0.2 if sharpened else 0.06)


def test_blocks_of_corners_lie_on_the_board_in_its_order():
    """Every block is three by three neighbours, its rows to the right of its columns as in the image."""
    image, truth = photograph("chessboard", np.random.default_rng(3), 30)
    places = truth.reshape(-1, 2)
    blocks = list(blocks_of_crossings(eight_bits(image)))
    assert len(blocks) > 0.6 * (ROWS - 2) * (COLS - 2)
    right = []
    for block in blocks:
        near = np.linalg.norm(places - block.reshape(-1, 1, 2), axis=2)
        row, col = (x.reshape(3, 3) for x in np.divmod(near.argmin(axis=1), COLS))
        steps = {(row[0, 1] - row[0, 0], col[0, 1] - col[0, 0]), (row[1, 0] - row[0, 0], col[1, 0] - col[0, 0])}
        turned = steps in ({(0, 1), (1, 0)}, {(1, 0), (0, -1)}, {(0, -1), (-1, 0)}, {(-1, 0), (0, 1)})
        right.append(turned and near.min(axis=1).max() < 4)  # corners are 15 px and more apart
        down, across = block[1, 0] - block[0, 0], block[0, 1] - block[0, 0]
        assert across[0] * down[1] - across[1] * down[0] > 0
    assert np.mean(right) > 0.95


@cache
def tilted() -> np.ndarray:
    return photograph("chessboard", np.random.default_rng(11), 25)[0]


@pytest.mark.parametrize(("rows", "cols"), [(ROWS - 2, COLS - 2), (ROWS, COLS - 4), (4, 5), (ROWS, COLS + 2)])
def test_a_board_of_other_rows_and_columns_is_not_recognised(rows, cols):
    image = tilted()
    row, col = (x.ravel() for x in np.mgrid[0:rows, 0:cols])
    places = np.column_stack([SQUARE * col, -SQUARE * row, 0.0 * row])
    field = Testfield(row, col, places, np.full(len(row), SQUARE), kind="chessboard")
    with pytest.raises(NotRecognisedError, match="corners in order, which do not fit the board"):
        recognise(phase_of(image), field, SPEC)


@pytest.mark.parametrize(
    ("said", "polarity"),
    [("dots", "white-on-black"), ("dots", "black-on-white"), ("charuco", "white-on-black"), ("tags", "white-on-black")],
)
def test_a_board_said_to_be_of_another_kind_is_named_by_what_it_looks_like(said, polarity):
    """Squares look like dots of either polarity: each file was said to be of the other."""
    image = tilted()
    field = replace(field_of("chessboard"), kind=said, polarity=polarity, diameter_mm=np.full(ROWS * COLS, SQUARE / 2))
    with pytest.raises(NotRecognisedError, match=f"looks like one of kind chessboard, its testfield file says {said}"):
        recognise(phase_of(image), field, SPEC)


def test_no_board_is_no_board():
    image = np.random.default_rng(0).normal(80, 20, (SPEC.height, SPEC.width)).astype(np.float32)
    for kind in ("charuco", "chessboard"):
        with pytest.raises(NotRecognisedError):
            recognise(phase_of(image), field_of(kind), SPEC)


@pytest.mark.parametrize("single", [False, True])
def test_light_that_falls_off_over_a_corner_does_not_move_it(single):
    """0.4 % a pixel across 19 px."""
    rng, fine, found, true = np.random.default_rng(5), 8, [], []
    v, u = (np.mgrid[0 : 21 * fine, 0 : 21 * fine] + 0.5) / fine - 0.5 - 10
    for angle in rng.uniform(0, np.pi, 8):
        centre, light = rng.uniform(-0.5, 0.5, 2), rng.uniform(0, 2 * np.pi)
        edges = np.array([[np.cos(a), np.sin(a)] for a in (angle, angle + 1.4)])
        a, b = (np.clip(fine * (e[0] * (v - centre[1]) - e[1] * (u - centre[0])) + 0.5, 0, 1) for e in edges)
        dark = a * (1 - b) if single else a + b - 2 * a * b  # between the first arm and the second
        image = (200 - 190 * dark) * (1 + 0.004 * (np.cos(light) * u + np.sin(light) * v))
        image = cv2.GaussianBlur(image, (0, 0), 0.6 * fine).reshape(21, fine, 21, fine).mean(axis=(1, 3))
        at = fit_corners(image.astype(np.float32), np.full((1, 2), 10.0), 9 * edges.T[None], single).uv[0]
        found.append(at - 10)
        true.append(centre)
    assert np.abs(np.array(found) - true).max() < 0.007  # with light taken as added: 0.015 and 0.033
