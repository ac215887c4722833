"""Regular boards of which dots are covered: who is who, or which rows and columns are seen cannot be told."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.measure import placed, recognise, solve_turns
from core.measure.identity.turns import relabelled
from core.model import DeviceSpec, Testfield
from tests.printed import phase_of

SPEC = DeviceSpec(560, 420, (0.01, 0.01), 7.0)
ROWS, COLS, STEP_PX = 13, 17, 28.0
ROW, COL = (x.ravel() for x in np.mgrid[0:ROWS, 0:COLS])
FIELD = Testfield(
    ROW, COL, np.column_stack([12.0 * COL, -12.0 * ROW, 0.0 * ROW]), np.full(len(ROW), 5.5), "white-on-black"
)
UV = np.column_stack([56 + STEP_PX * COL, 42 + STEP_PX * ROW])


def _covered(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The board seen frontally with every sixth dot under a drop of dull paint, and which dots are covered."""
    rng = np.random.default_rng(seed)
    fine = np.full((SPEC.height * 4, SPEC.width * 4), 20, np.float32)
    covered = rng.choice(len(UV), len(UV) // 6, replace=False)
    for places, radius, grey in ((UV, 6.4, 200), (UV[covered], STEP_PX / 2, 70)):
        for at in places:
            u, v = np.round(((at + 0.5) * 4 - 0.5) * 16).astype(int).tolist()
            cv2.circle(fine, (u, v), int(radius * 64), grey, -1, cv2.LINE_AA, 4)
    fine = cv2.GaussianBlur(fine, (0, 0), 4 * rng.uniform(0.6, 1.2))
    image = cv2.resize(fine, (SPEC.width, SPEC.height), interpolation=cv2.INTER_AREA)
    return np.rint(image + rng.normal(0, 1, image.shape)).astype(np.float32), covered


@pytest.mark.parametrize("seed", [7, 11, 0])
def test_dots_beside_covered_ones_are_told(seed: int) -> None:
    """With 7 and 11 the first steps went along a diagonal, and the board had too many columns."""
    image, covered = _covered(seed)
    found, _ = recognise(phase_of(image), FIELD, SPEC)
    index = found.row * COLS + found.col
    off = min(np.abs(found.camera_uv - UV[way]).max() for way in (index, len(UV) - 1 - index))  # either way up
    assert off < 0.5  # a spacing is 28 px
    assert len(index) > 0.95 * (len(UV) - len(covered))


def _beside(cover: float, moved_px: float, end_px: float) -> np.ndarray:
    """Black dots on white, the first three columns under something grey; where the board ends, other grey begins."""
    rng = np.random.default_rng(2)
    u = np.mgrid[0 : SPEC.height * 4, 0 : SPEC.width * 4][1] / 4 - 0.375
    board = np.full(u.shape, 200, np.float32)
    for at in UV + np.array([moved_px, 0]):
        x, y = np.round(((at + 0.5) * 4 - 0.5) * 16).astype(int).tolist()
        cv2.circle(board, (x, y), int(6.4 * 64), 20, -1, cv2.LINE_AA, 4)
    board[u > UV[-1, 0] + moved_px + end_px] = 90
    board[u < UV[2, 0] + moved_px + 9] = cover
    fine = cv2.GaussianBlur(board, (0, 0), 3) * np.linspace(0.7, 1.1, u.shape[1], dtype=np.float32)
    image = cv2.resize(fine, (SPEC.width, SPEC.height), interpolation=cv2.INTER_AREA)
    return np.rint(image + rng.normal(0, 1, image.shape)).astype(np.float32)


BLACK = replace(FIELD, polarity="black-on-white")


@pytest.mark.parametrize("cover", [30.0, 110.0, 160.0])
def test_the_boards_end_tells_that_columns_at_the_other_side_are_covered(cover: float) -> None:
    """What covers them has another brightness than the ground; a dot beyond the last column would be seen on it."""
    found, ways = recognise(phase_of(_beside(cover, 0.0, 0.95 * STEP_PX)), BLACK, SPEC)
    assert len(ways) == 2  # the board may be turned, as always
    assert len(found.row) == ROWS * (COLS - 3)
    at = found.row * COLS + found.col
    assert min(np.abs(found.camera_uv - UV[way]).max() for way in (at, len(UV) - 1 - at)) < 0.5


@pytest.mark.parametrize(("moved_px", "end_px"), [(0.0, 0.5 * STEP_PX), (48.0, 2 * STEP_PX)])
def test_covered_columns_are_not_guessed_where_the_next_one_would_not_be_seen(moved_px: float, end_px: float) -> None:
    """The board ends before it, or the image does: the true columns are among those offered."""
    found, ways = recognise(phase_of(_beside(110.0, moved_px, end_px)), BLACK, SPEC)
    off = []
    for way in ways:
        named = relabelled(found, way, BLACK)
        assert named is not None
        off.append(np.abs(named.camera_uv - UV[named.row * COLS + named.col] - [moved_px, 0]).max())
    assert min(off) < 0.5
    assert len(ways) == 8  # 0 to 3 columns hidden at one side, the others at the other; either way up
    assert not placed(ways, BLACK)
    assert not solve_turns([found, found], [ways, ways], BLACK)[0].told
