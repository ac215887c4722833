"""Regular boards of which every sixth dot is covered, as by drops of dull paint: who is who."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from core.measure import recognise
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
    """The board seen frontally, and which dots are covered."""
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
