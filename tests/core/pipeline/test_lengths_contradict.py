"""Measured distances that contradict each other are refused before the work, each with its own name."""

from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError
from core.model import ScaleBar
from core.pipeline.methods.photogrammetric import check_lengths
from core.project.boards import nominal_testfield

BOARD = nominal_testfield(7, 9, 19.0, 9.0)  # dots 19 mm apart
DIAGONAL = 19 * float(np.hypot(6, 8))  # from (6, 0) to (0, 8)


def lengths(scale: float, further: float, to: tuple[int, int] = (0, 8)) -> dict[str, ScaleBar]:
    return {
        "scale": ScaleBar((6, 0), (0, 8), scale, 0.005),
        "lengths, entry 0": ScaleBar((6, 0), to, further, 0.005),
    }


@pytest.mark.parametrize(
    ("bars", "words"),
    [
        (lengths(DIAGONAL, DIAGONAL / 10), r"lengths, entry 0: length_mm is 19, 0\.1 times.*cm instead of mm"),
        (lengths(DIAGONAL, DIAGONAL, (1, 8)), r"lengths, entry 0: .* 1\.06 times"),
        (lengths(DIAGONAL * 1.1, DIAGONAL), r"scale: length_mm is 209, 1\.1 times"),
    ],
)
def test_the_length_that_contradicts_the_others_is_named(bars: dict[str, ScaleBar], words: str) -> None:
    with pytest.raises(InputError, match=words):
        check_lengths(Path("rig"), bars, BOARD)


@pytest.mark.parametrize("unit", [1.0, 0.1, 25.4, 0.97])
def test_lengths_that_agree_pass_whatever_the_board_is_given_in(unit: float) -> None:
    check_lengths(Path("rig"), lengths(DIAGONAL * unit, DIAGONAL * unit * 1.02), BOARD)
    check_lengths(Path("rig"), {}, BOARD)


def test_a_short_length_measured_roughly_passes_and_hides_no_other() -> None:
    """19 mm with a ruler: 21 % off is 2 sigmas, which the adjustment weighs."""
    short = {"lengths, entry 1": ScaleBar((0, 0), (0, 1), 23.0, 2.0)}
    check_lengths(Path("rig"), lengths(DIAGONAL, DIAGONAL) | short, BOARD)
    with pytest.raises(InputError, match=r"lengths, entry 0: length_mm is .* 1\.1 times"):
        check_lengths(Path("rig"), lengths(DIAGONAL, DIAGONAL * 1.1) | short, BOARD)
